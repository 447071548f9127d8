"""A judge learns what tracks are, keeps it in a file, and refuses what is none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError, UserError
from thingmap.mapper.multiview.track_evidence import feature_count
from thingmap.mapper.multiview.track_judge import TrackJudge, fit_judge, load_judge

CLASSES = ("cup", "bowl")
WIDE = feature_count(2)


@pytest.fixture(scope="module")
def tracks() -> tuple[np.ndarray, np.ndarray]:
    """Features whose first two columns tell the classes, and the classes; the rest is noise."""
    rng = np.random.default_rng(4)
    label = np.repeat([0, 1, 2], [40, 40, 120])
    features = rng.normal(0.0, 1.0, (len(label), WIDE))
    features[:, :2] += 3.0 * np.eye(3)[label][:, :2]
    return features, label


@pytest.fixture(scope="module")
def judge(tracks) -> TrackJudge:
    features, label = tracks
    return fit_judge(features, label, np.ones(len(label)), CLASSES, "noise")


def test_it_tells_what_it_learned(judge, tracks):
    features, label = tracks
    p = judge.distribution(features)
    np.testing.assert_allclose(p.sum(axis=1), 1.0)
    assert np.mean(p.argmax(axis=1) == label) > 0.9
    strongest = np.abs(judge.weights[:2]).argmax(axis=1)
    assert strongest.tolist() == [0, 1]


def test_probabilities_are_those_of_the_sample(judge, tracks):
    """The offsets have no prior: mean probabilities are the classes' shares."""
    features, label = tracks
    np.testing.assert_allclose(judge.distribution(features).mean(axis=0), np.bincount(label) / len(label), atol=1e-3)


def test_weights_count_as_repetitions(tracks):
    features, label = tracks
    twice = fit_judge(features, label, np.where(label == 0, 2.0, 1.0), CLASSES, "")
    again = np.concatenate([features, features[label == 0]]), np.concatenate([label, label[label == 0]])
    repeated = fit_judge(*again, np.ones(len(again[1])), CLASSES, "")
    # centre and scale differ between the two, and the ridge with them: nearly the same
    np.testing.assert_allclose(twice.distribution(features), repeated.distribution(features), atol=0.05)


def test_a_feature_far_out_says_no_more_than_a_large_one(judge):
    far = judge.centre + 1e9 * judge.scale
    np.testing.assert_allclose(
        judge.distribution(far[None]), judge.distribution((judge.centre + 6 * judge.scale)[None])
    )


def test_file_and_back(judge, tracks, tmp_path: Path):
    judge.save(tmp_path / "judge.json")
    back = load_judge(tmp_path / "judge.json")
    assert back.classes == CLASSES and back.learned_from == "noise"
    np.testing.assert_allclose(back.distribution(tracks[0]), judge.distribution(tracks[0]), atol=1e-3)


def test_what_is_no_judge_is_refused(judge, tmp_path: Path):
    file = tmp_path / "judge.json"
    with pytest.raises(InputError, match="shape_context_judge"):
        load_judge(file)
    judge.save(file)
    content = json.loads(file.read_text())
    for wrong in (
        {**content, "schema": "other"},
        {key: value for key, value in content.items() if key != "scale"},
        {**content, "weights": content["weights"][:-1]},
        {**content, "centre": "none"},
        [1, 2],
    ):
        file.write_text(json.dumps(wrong))
        with pytest.raises(InputError, match=r"judge\.json"):
            load_judge(file)
    with pytest.raises(UserError, match="cannot be written"):
        judge.save(tmp_path / "absent" / "judge.json")


def test_wrong_numbers_are_refused(judge, tracks):
    features, label = tracks
    with pytest.raises(ValueError, match="scale"):
        replace(judge, scale=np.zeros(WIDE))
    with pytest.raises(ValueError, match="offset"):
        replace(judge, offset=np.zeros(5))
    with pytest.raises(ValueError, match="at least one"):
        fit_judge(features, label[:-1], np.ones(len(label)), CLASSES, "")
    with pytest.raises(ValueError, match="range"):
        fit_judge(features, label + 1, np.ones(len(label)), CLASSES, "")


def test_other_classes_are_the_users_mistake(judge):
    judge.check(["cup", "bowl"])
    with pytest.raises(UserError, match="cup, bowl, but the detector has bowl, cup"):
        judge.check(["bowl", "cup"])
