import itertools

import numpy as np
import pytest
import yaml

from thingmap.datasets.errors import UserError
from thingmap.mapper.queries.embeddings import find_by_embedding
from thingmap.mapper.queries.label_match import Match, match_labels
from thingmap.mapper.queries.synonyms import FILE, normal_words, synonyms

CLASSES = ("coffee mug", "cup", "soda can", "cereal box", "tissue box", "dining table", "couch", "bottle")


@pytest.mark.parametrize(
    ("text", "labels", "how"),
    [
        ("Cup", ("cup",), Match.LABEL),
        ("cups", ("cup",), Match.SYNONYM),
        ("coffee-mugs", ("coffee mug",), Match.SYNONYM),
        ("mug", ("coffee mug", "cup"), Match.SYNONYM),
        ("sofa", ("couch",), Match.SYNONYM),
        ("box", ("cereal box", "tissue box"), Match.SYNONYM),
        ("the red can", ("soda can",), Match.WORDS),
        ("the table by the window", ("dining table",), Match.WORDS),
        ("botle", ("bottle",), Match.SPELLING),
        ("dinning table", ("dining table",), Match.WORDS),
        ("zebra", (), Match.NONE),
        ("", (), Match.NONE),
        ("the", (), Match.NONE),
    ],
)
def test_words_become_labels(text, labels, how):
    match = match_labels(text, CLASSES)
    assert (match.labels, match.how) == (labels, how)


def test_what_is_not_understood_is_said():
    match = match_labels("the big red can", CLASSES)
    assert match.ignored == ("big", "red")
    assert str(match) == "'the big red can' is taken as soda can; the map knows nothing of 'big', 'red'"
    assert "not understood" in str(match_labels("zebra", CLASSES))


def test_a_label_of_the_map_counts_before_its_synonyms():
    assert match_labels("cup", ["coffee mug", "cup"]).labels == ("cup",)
    assert match_labels("cup", ["coffee mug", "bowl"]).labels == ("coffee mug",)
    assert match_labels("mug", ["coffee mug", "mug"]).labels == ("mug",)


@pytest.mark.parametrize(
    ("plural", "singular"),
    [
        *(("dishes", "dish"), ("knives", "knife"), ("glasses", "glass"), ("boxes", "box"), ("scissors", "scissors")),
        *(("tomatoes", "tomato"), ("bus", "bus"), ("teddies", "teddy"), ("shoes", "shoe"), ("chairs", "chair")),
    ],
)
def test_plurals(plural, singular):
    assert normal_words(plural) == (singular,)


def test_the_file_of_synonyms_is_in_order():
    document = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    phrases = [phrase for group in document["groups"] for phrase in group]
    assert all(phrase == phrase.lower().strip() for phrase in phrases)
    assert all(len(group) == len({normal_words(phrase) for phrase in group}) > 1 for group in document["groups"])
    groups = synonyms().groups
    assert not any(a <= b for a, b in itertools.permutations(groups, 2))
    assert ("kitchen", "table") in synonyms().flat_topped and ("chair",) not in synonyms().flat_topped


def test_find_by_a_synonym_sums_what_it_may_mean(make_thing, make_map):
    either = {"cup": 0.5, "coffee mug": 0.4, "bowl": 0.1}
    object_map = make_map(
        make_thing(1, "cup", 0.5, class_posterior=either, existence=0.9),
        make_thing(2, "bowl", 0.9),
        classes=("cup", "coffee mug", "bowl"),
    )
    (first, second) = object_map.find("mugs")
    assert first.thing.id == "thing-0001" and first.probability == pytest.approx(0.9 * 0.9)
    assert second.probability == pytest.approx(0.95 * 0.1)
    assert [a.thing.id for a in object_map.find("the mug", min_probability=0.5)] == ["thing-0001"]
    assert object_map.nearest([0, 0, 1], "mug")[0].thing.id == "thing-0001"
    assert object_map.find("zebra") == []


def test_find_by_a_given_name(make_thing, make_map):
    mine = make_thing(1, "bowl", 0.7, name="Grandma's mug", existence=0.8)
    object_map = make_map(mine, make_thing(2, "cup", 0.9, name="bowl"))
    (answer,) = object_map.find("grandma's mug")
    assert answer.thing.id == "thing-0001" and answer.probability == 0.8
    assert {a.thing.id for a in object_map.find("bowl")} == {"thing-0001", "thing-0002"}  # a label is a label


class Looks:
    """A thing's appearance in memory."""

    def __init__(self, vector):
        self.embedding = np.array(vector, dtype=np.float32)

    def read(self):
        return self


def test_find_by_embedding_ranks_by_likeness(make_thing, make_map):
    object_map = make_map(
        make_thing(1, appearance=Looks([1.0, 0.0])),
        make_thing(2, appearance=Looks([0.6, 0.8]), existence=0.5),
        make_thing(3),
    )
    encoder = {"red": np.array([0.0, 2.0]), "blue": np.array([[3.0, 0.0]])}.__getitem__
    red, blue = object_map.find("red", encoder=encoder), object_map.find("blue", encoder=encoder)
    assert red[0].thing.id == "thing-0002" and red[0].probability == pytest.approx(0.5, abs=1e-6)
    assert blue[0].thing.id == "thing-0001" and blue[0].probability == pytest.approx(0.95, abs=1e-6)
    warm = object_map.find("red", encoder=encoder, temperature=1.0)
    share = np.exp(0.8) / (np.exp(0.8) + 1.0)
    assert [a.probability for a in warm] == pytest.approx([0.5 * share, 0.95 * (1 - share)])


def test_embeddings_that_do_not_fit_are_refused(make_thing, make_map):
    object_map = make_map(make_thing(1, appearance=Looks([1.0, 0.0])))
    with pytest.raises(UserError, match="2 finite numbers"):
        object_map.find("red", encoder=lambda text: np.ones(3))
    with pytest.raises(UserError, match="no thing of this map has an embedding"):
        make_map().find("red", encoder=lambda text: np.ones(2))
    with pytest.raises(ValueError, match="temperature"):
        find_by_embedding(object_map.things, "red", lambda text: np.ones(2), 0.0)
