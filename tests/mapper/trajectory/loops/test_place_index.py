"""Keyframes recognised by appearance: votes against a slow twin, scores, order, revisits of a rendered path."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.mapper.config import PlaceConfig, VisualConfig
from thingmap.mapper.trajectory.loops.inverted_file import BLOCK, InvertedFile
from thingmap.mapper.trajectory.loops.place_index import PlaceIndex
from thingmap.mapper.trajectory.loops.vocabulary import Vocabulary, packed, train_vocabulary
from thingmap.mapper.trajectory.visual.features import FeatureExtractor


def image(seed: int, count: int = 200) -> np.ndarray:
    """(count, 32) uint8 descriptors that no other seed's are like."""
    return np.random.default_rng(seed).integers(0, 256, (count, 32), dtype=np.uint8)


def seen_again(descriptors: np.ndarray, flipped: float, seed: int = 0) -> np.ndarray:
    bits = np.unpackbits(descriptors, axis=1)
    return np.packbits(bits ^ (np.random.default_rng(seed).random(bits.shape) < flipped), axis=1)


def filled(images: list[np.ndarray], config: PlaceConfig | None = None, first: int = 0) -> PlaceIndex:
    index = PlaceIndex(config or PlaceConfig())
    for number, descriptors in enumerate(images, start=first):
        index.add(number, descriptors)
    return index


def bits_apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) of (N, 32) and (M, 32) uint8."""
    return np.bitwise_count(a[:, None] ^ b[None]).sum(axis=2)


def slow_votes(images: list[np.ndarray], words: list[np.ndarray], query: int, nearest: int, limit: int) -> np.ndarray:
    """What `InvertedFile.votes` counts, by comparing everything with everything."""
    votes = np.zeros(query, dtype=np.int64)
    for descriptor, word in zip(images[query], words[query], strict=True):
        closest = []
        for slot in range(query):
            rows = images[slot][words[slot] == word]
            if len(rows):
                closest.append((int(bits_apart(descriptor[None], rows).min()), slot))
        for distance, slot in sorted(closest)[:nearest]:
            votes[slot] += distance <= limit
    return votes


@pytest.mark.parametrize("nearest", [1, 3, 20])
@pytest.mark.parametrize("limit", [0, 40, 110, 256])
def test_votes_are_those_of_an_exhaustive_search(nearest: int, limit: int) -> None:
    rng = np.random.default_rng(1)
    kinds = image(7, 12)  # few kinds of features: words are shared, chains are longer than a block, distances are tied
    images = [seen_again(kinds[rng.integers(0, 12, 40)], 0.1 * rng.random(), seed) for seed in range(9)]
    words = [rng.integers(0, 5, 40) for _ in images]
    file = InvertedFile(6)
    for slot in range(9):
        file.add(slot, words[slot], packed(images[slot]))
    assert max(np.bincount(np.concatenate(words))) > 2 * BLOCK
    found = file.votes(words[6], packed(images[6]), 6, nearest, limit)  # slots 6, 7, 8 are not asked for
    np.testing.assert_array_equal(found, slow_votes(images, words, 6, nearest, limit))


def test_the_rarest_words_are_asked_for_first() -> None:
    file = InvertedFile(3)
    words = np.repeat([0, 1, 2], [30, 5, 10])
    file.add(0, words, packed(image(0, 45)))
    asked = np.array([0, 2, 1, 2])
    assert file.rarest(asked, 24).tolist() == [2, 1]
    assert file.rarest(asked, 25).tolist() == [2, 1, 3]
    assert file.rarest(asked, 55).tolist() == [2, 1, 3, 0]


def test_a_place_seen_again_is_found_and_no_other() -> None:
    index = filled([image(seed) for seed in range(40)])
    found = index.query(seen_again(image(17), 0.01))
    assert [match.keyframe for match in found] == [17]
    assert 0.4 < found[0].score <= 1.0
    assert index.query(image(99)) == []
    assert len(index) == 40


def test_only_keyframes_up_to_a_number_are_named() -> None:
    index = filled([image(seed) for seed in range(10)], first=100)
    assert [m.keyframe for m in index.query(image(7), exclude_after=107)] == [107]
    assert index.query(image(7), exclude_after=106) == []
    assert index.query(image(0), exclude_after=99) == []


def test_best_first_and_at_most_so_many() -> None:
    place = image(1, 400)
    views = {5: place[:300], 15: place[:100], 25: place[:200], 35: place[:50]}
    index = filled([views.get(number, image(1000 + number)) for number in range(40)])
    found = index.query(place)
    assert [m.keyframe for m in found] == [5, 25, 15, 35]
    assert [m.score for m in found] == sorted((m.score for m in found), reverse=True)
    assert index.query(place, count=2) == found[:2]


def test_of_neighbours_only_the_best_is_named() -> None:
    place = image(1, 400)
    images = [image(1000 + number) for number in range(30)]
    images[10], images[11], images[12], images[13] = place[:200], place[:300], place[:200], place[:100]
    near = filled(images, PlaceConfig(neighbours=1)).query(place)
    every = filled(images, PlaceConfig(neighbours=0)).query(place)
    assert [m.keyframe for m in near] == [11, 13]
    assert [m.keyframe for m in every] == [11, 10, 12, 13]


def test_scores_mean_the_same_for_few_features_and_in_large_maps() -> None:
    small = filled([image(seed) for seed in range(30)]).query(seen_again(image(3), 0.01))[0].score
    large = filled([image(seed) for seed in range(300)]).query(seen_again(image(3), 0.01))[0].score
    few = filled([image(seed) for seed in range(30)]).query(seen_again(image(3), 0.01)[:50])[0].score
    assert small == pytest.approx(large, rel=0.1)
    assert small == pytest.approx(few, rel=0.2)


def test_a_map_of_one_place_still_knows_it() -> None:
    assert filled([image(1)]).query(image(1))[0].score > 0.9


def test_a_budget_leaves_the_place_recognised() -> None:
    images = [seen_again(image(0, 100), 0.15, seed) for seed in range(60)] + [image(1)]
    images = [np.concatenate([picture, image(500 + number, 100)]) for number, picture in enumerate(images)]
    cheap = filled(images, PlaceConfig(max_comparisons=2000))
    assert cheap.query(seen_again(images[20], 0.02))[0].keyframe == 20


def test_the_same_calls_give_the_same_answers() -> None:
    images = [image(seed % 7) for seed in range(30)]
    assert filled(images).query(images[3]) == filled(images).query(images[3])


def test_images_without_features() -> None:
    empty = np.empty((0, 32), dtype=np.uint8)
    index = PlaceIndex(PlaceConfig())
    assert index.query(image(0)) == []
    index.add(0, empty)
    index.add(1, image(1))
    assert index.query(empty) == []
    assert [m.keyframe for m in index.query(image(1))] == [1]


def test_wrong_calls_are_refused() -> None:
    index = filled([image(0)], first=4)
    with pytest.raises(ValueError, match="after 4"):
        index.add(4, image(1))
    with pytest.raises(ValueError, match=r"\(200, 31\)"):
        index.add(5, image(1)[:, :31])
    with pytest.raises(ValueError, match="float64"):
        index.query(image(1).astype(float))
    assert len(index) == 1


def test_rendered_views_are_recognised_from_the_frames_beside_them(tabletop) -> None:
    extract = FeatureExtractor(VisualConfig())
    pictures = [extract(frame).descriptors for frame in tabletop]
    index = filled(pictures[0::5] + [image(seed, 600) for seed in range(20)])
    for number in range(len(pictures[0::5])):
        assert index.query(pictures[5 * number + 1], count=1)[0].keyframe == number


def test_memory_of_a_large_map_stays_small() -> None:
    index = filled([image(seed, 850) for seed in range(300)])
    assert index.nbytes / 300 < 50_000


def test_the_shipped_words() -> None:
    vocabulary = Vocabulary.load()
    assert vocabulary.size == 4096
    words = vocabulary.words(packed(image(0, 5000)))
    assert words.min() >= 0
    assert words.max() < 4096
    assert len(np.unique(words)) > 500


def test_a_vocabulary_finds_the_clusters_that_made_it(tmp_path) -> None:
    kinds = image(3, 9)
    data = packed(np.concatenate([seen_again(kinds, 0.02, seed) for seed in range(40)]))
    vocabulary = train_vocabulary(data, branching=3, depth=2, seed=0)
    words = vocabulary.words(data).reshape(40, 9)
    assert vocabulary.size == 9
    assert (words == words[0]).mean() > 0.97
    again = train_vocabulary(data, branching=3, depth=2, seed=0)
    np.testing.assert_array_equal(vocabulary.centres, again.centres)
    vocabulary.save(tmp_path / "words.npz")
    np.testing.assert_array_equal(Vocabulary.load(tmp_path / "words.npz").centres, vocabulary.centres)


def test_words_of_fewer_descriptors_than_branches() -> None:
    data = packed(image(0, 2))
    vocabulary = train_vocabulary(data, branching=4, depth=2)
    assert len(np.unique(vocabulary.words(data))) == 2


def test_a_file_without_words_is_named(tmp_path) -> None:
    path = tmp_path / "words.npz"
    with pytest.raises(InputError, match=r"words\.npz"):
        Vocabulary.load(path)
    path.write_bytes(b"no archive")
    with pytest.raises(InputError, match="full tree"):
        Vocabulary.load(path)
    np.savez(path, branching=4, centres=image(0, 7))
    with pytest.raises(InputError, match="7 centres"):
        Vocabulary.load(path)
