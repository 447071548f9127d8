from dataclasses import replace

import gtsam
import numpy as np
import pytest

from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.inputs.case import KeyframePoses
from thingmap.mapper.evaluation.protocols.honesty import evaluate
from thingmap.mapper.evaluation.result import NotEvaluated
from thingmap.mapper.evaluation.uncertainty.calibration import LOG_FLOOR


@pytest.fixture
def perfect(scene_truth, perfect_run):
    return perfect_run(scene_truth)


@pytest.fixture
def score(scene_truth, perfect, make_case, change_things):
    """`score(things, truth, keyframes)`: the protocol on the perfect run with some of it changed."""

    def run(things=None, truth=scene_truth, keyframes=perfect.keyframes, config=EvaluationConfig()):  # noqa: B008
        changed = change_things(perfect, perfect.object_map.things if things is None else things)
        return evaluate(make_case(replace(changed, keyframes=keyframes), truth, config=config))

    return run


def saying(thing, existence=1.0, **posterior):
    """The thing with another existence and class posterior; underscores in labels are spaces."""
    posterior = {label.replace("_", " "): p for label, p in posterior.items()} or dict(thing.class_posterior)
    label = max(posterior, key=posterior.get)
    return replace(thing, label=label, probability=posterior[label], class_posterior=posterior, existence=existence)


def rows(result):
    found = next(table for table in result.tables if table.title == "Normalised errors squared")
    return {row[0]: dict(zip(found.columns, row, strict=True)) for row in found.rows}


def test_a_perfect_map_is_sure_and_right(score):
    result = score()
    for kind in ("class", "existence"):
        for name in ("ECE", "MCE", "Brier score", "log loss"):
            assert result.value(f"{kind} {name}") == pytest.approx(0.0, abs=2e-6)
        assert result.value(f"{kind} samples") == 8
    for kind, samples in (("position", 8), ("size", 8), ("pose", 9)):
        assert result.value(f"{kind} NEES") == pytest.approx(0.0, abs=1e-9)
        assert result.value(f"{kind} NEES samples") == samples
        assert result.value(f"{kind} inside the 95 % ellipsoid") == 1.0
    assert any("--all" in note for note in result.notes)
    assert len({metric.name for metric in result.metrics}) == len(result.metrics)


def test_existence_of_duplicates_and_phantoms_by_hand(score, perfect):
    things = [saying(thing, 0.9) for thing in perfect.object_map.things[:3]]
    things.append(replace(saying(things[0], 0.7), id="twin"))
    things.append(replace(saying(things[0], 0.2), id="phantom", position=things[0].position + 2.0))
    result = score(things)
    assert result.value("existence samples") == 5
    assert result.value("existence Brier score") == pytest.approx((3 * 0.1**2 + 0.7**2 + 0.2**2) / 5)
    assert result.value("existence log loss") == pytest.approx(-np.log([0.9, 0.9, 0.9, 0.3, 0.8]).mean())
    assert result.value("existence ECE") == pytest.approx((3 * 0.1 + 0.7 + 0.2) / 5)
    assert result.value("existence MCE") == pytest.approx(0.7)
    assert result.value("class samples") == 3
    assert not any("--all" in note for note in result.notes)


def test_a_ghost_nearer_to_the_object_does_not_take_it_from_the_thing_that_is_sure(score, perfect):
    sure, ghost = saying(perfect.object_map.things[0], 0.9), saying(perfect.object_map.things[0], 0.2)
    result = score([replace(sure, position=sure.position + 0.01), replace(ghost, id="ghost")])
    assert result.value("existence log loss") == pytest.approx(-np.log([0.9, 0.8]).mean())


def test_positions_are_judged_relative_to_the_first_pose(scene_truth, perfect, make_case):
    """An error of the first pose alone is one of all positions: the map claims them relative to it."""
    poses = perfect.poses.copy()
    poses[0, :3, 3] += [0.03, 0.0, 0.0]
    things = [replace(t, position_covariance=0.01**2 * np.eye(3)) for t in perfect.object_map.things]
    object_map = replace(perfect.object_map, things=tuple(things))
    result = evaluate(make_case(replace(perfect, poses=poses, object_map=object_map), scene_truth))
    assert result.value("position NEES") == pytest.approx((0.03 / 0.01) ** 2 / 3)


def test_classes_by_hand(score, perfect):
    bowls = perfect.object_map.things[:2]
    things = [saying(bowls[0], bowl=0.8, cup=0.2), saying(bowls[1], bowl=0.3, cup=0.6, soda_can=0.1)]
    result = score(things)
    assert result.value("class log loss") == pytest.approx(-np.log([0.8, 0.3]).mean())
    brier = [2 * 0.2**2, 0.7**2 + 0.6**2 + 0.1**2]
    assert result.value("class Brier score") == pytest.approx(np.mean(brier))
    assert result.value("class ECE") == pytest.approx((0.2 + 0.6) / 2)


def test_what_a_posterior_lacks_belongs_to_the_classes_it_does_not_name(score, perfect):
    bowl = perfect.object_map.things[0]
    result = score([saying(bowl, cup=0.9, soda_can=0.06)])  # 0.04 for bowl and cereal box
    assert result.value("class log loss") == pytest.approx(-np.log(0.02))
    assert result.value("class Brier score") == pytest.approx(0.9**2 + 0.06**2 + 0.98**2 + 0.02**2)
    result = score([saying(bowl, cup=0.9, soda_can=0.1)])
    assert result.value("class log loss") == pytest.approx(-np.log(LOG_FLOOR))


def test_labels_that_mean_the_same_are_added_and_strange_ones_are_wrong(scene_truth, perfect, make_case):
    thing = saying(perfect.object_map.things[4], mug=0.5, cup=0.2, fork=0.2, spoon=0.1)
    object_map = replace(perfect.object_map, things=(thing,), classes=(*scene_truth.classes, "mug", "fork", "spoon"))
    config = EvaluationConfig(aliases={"mug": "cup"})
    result = evaluate(make_case(replace(perfect, object_map=object_map), scene_truth, config=config))
    assert result.value("class log loss") == pytest.approx(-np.log(0.7))
    assert result.value("class Brier score") == pytest.approx(0.3**2 + 0.2**2 + 0.1**2)
    assert result.value("class ECE") == pytest.approx(0.3)


def test_calibrated_posteriors_have_a_small_error(score, perfect, scene_truth):
    """400 maps in one: each object again and again, with labels drawn from the posterior that is claimed."""
    rng = np.random.default_rng(3)
    things, objects = [], []
    for k in range(400):
        shift = np.array([0.0, 0.0, 2.0 * k])
        true, thing = scene_truth.objects[0], perfect.object_map.things[0]
        p = rng.dirichlet(np.ones(4))
        label = scene_truth.classes[rng.choice(4, p=p)]
        objects.append(replace(true, id=k, label=label, position=true.position + shift))
        posterior = dict(zip((name.replace(" ", "_") for name in scene_truth.classes), p, strict=True))
        in_map = np.linalg.inv(scene_truth.poses[0])[:3, :3] @ shift
        things.append(replace(saying(thing, **posterior), id=f"t{k}", position=thing.position + in_map))
    result = score(things, replace(scene_truth, objects=tuple(objects)))
    assert result.value("class samples") == 400
    assert result.value("class ECE") < 0.08  # 400 draws in 8 bins: about 0.05 by chance
    wrong = [saying(t, **{t.label.replace(" ", "_"): 0.99}) for t in things]
    assert score(wrong, replace(scene_truth, objects=tuple(objects))).value("class ECE") > 0.3


def test_existence_is_not_judged_by_an_incomplete_truth(score, scene_truth):
    result = score(truth=replace(scene_truth, complete=False, tolerance={0: 0.1}))
    assert result.value("existence ECE") is None and result.value("existence samples") == 0
    assert result.value("class samples") == 8
    assert result.value("position NEES samples") == 7  # one is known to a tolerance only
    assert any("existence is not judged" in note for note in result.notes)


def test_position_errors_count_along_the_axes_of_their_covariance(score, perfect):
    covariance = np.diag([0.01**2, 0.02**2, 0.04**2])  # map axes, which are those of a tilted camera
    error = np.array([0.01, 0.0, 0.04])
    things = [
        replace(t, position=t.position + error, position_covariance=covariance) for t in perfect.object_map.things
    ]
    result = score(things)
    assert result.value("position NEES") == pytest.approx(2.0 / 3.0)
    assert rows(result)["position"]["the map is"] == "honest"


@pytest.mark.parametrize(("scale", "verdict"), [(1.0, "honest"), (2.0, "too sure"), (0.3, "too careful")])
def test_positions_and_sizes_drawn_from_their_covariances(score, perfect, scale, verdict):
    rng = np.random.default_rng(2)
    root = 0.005 * np.array([[1.0, 0.0, 0.0], [0.5, 0.8, 0.0], [-0.3, 0.2, 1.2]])
    things = []
    for thing in perfect.object_map.things:
        size_std = 0.03 * thing.size  # too little to exchange the longer and the shorter side
        things.append(
            replace(
                thing,
                position=thing.position + scale * root @ rng.normal(size=3),
                position_covariance=root @ root.T,
                size=thing.size + scale * size_std * rng.normal(size=3),
                size_std=size_std,
            )
        )
    result = rows(score(things))
    assert result["position"]["the map is"] == verdict
    assert result["size"]["the map is"] == verdict


def test_a_size_without_deviation_is_counted_and_left_out(score, perfect):
    things = list(perfect.object_map.things)
    things[0] = replace(things[0], size_std=[0.0, 0.01, 0.01])
    result = score(things)
    assert rows(result)["size"]["singular, left out"] == 1
    assert result.value("size NEES samples") == 7


def drifting(keyframes, covariance, scale=1.0, seed=0):
    """Keyframes with errors drawn from the covariance in the right tangent; the first has none."""
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    poses = [keyframes.poses[0]]
    for pose in keyframes.poses[1:]:
        error = gtsam.Pose3.Expmap(scale * root @ rng.normal(size=6))
        poses.append(pose @ error.matrix())
    return KeyframePoses(keyframes.stamps, np.array(poses), np.tile(covariance, (len(poses), 1, 1)))


COVARIANCE = np.diag([0.01, 0.03, 0.02, 0.02, 0.05, 0.01]) ** 2
COVARIANCE[0, 4] = COVARIANCE[4, 0] = 0.6 * 0.01 * 0.05


@pytest.mark.parametrize(("scale", "verdict"), [(1.0, "honest"), (2.0, "too sure"), (0.3, "too careful")])
def test_keyframes_drawn_from_their_covariance(score, perfect, scale, verdict):
    result = score(keyframes=drifting(perfect.keyframes, COVARIANCE, scale))
    assert rows(result)["pose"]["the map is"] == verdict
    assert result.value("pose NEES samples") == 9


def test_the_tangent_is_rotation_first_on_the_right(score, perfect):
    keyframes = drifting(perfect.keyframes, COVARIANCE)
    moved = np.eye(4)
    moved[:3, 3] = [0.0, 0.05, 0.0]  # camera axes
    poses = np.concatenate([keyframes.poses[:1], perfect.keyframes.poses[1:] @ moved])
    covariances = np.tile(np.diag([1.0, 1.0, 1.0, 1.0, 0.05**2, 1.0]), (len(poses), 1, 1))
    result = score(keyframes=replace(keyframes, poses=poses, covariances=covariances))
    assert result.value("pose NEES") == pytest.approx(1.0 / 6.0)


def test_the_gauge_is_no_error(score, perfect):
    keyframes = drifting(perfect.keyframes, COVARIANCE)
    turned = gtsam.Pose3.Expmap(np.array([0.3, -0.2, 1.0, 4.0, 5.0, 6.0])).matrix()
    moved = replace(keyframes, poses=turned @ keyframes.poses)
    assert score(keyframes=moved).value("pose NEES") == pytest.approx(score(keyframes=keyframes).value("pose NEES"))


def test_what_is_absent_is_said(score, scene_truth, perfect):
    assert any("no covariances" in note for note in score(keyframes=None).notes)
    poses = scene_truth.poses.copy()
    poses[0] = np.nan
    result = score(truth=replace(scene_truth, poses=poses))
    assert result.value("pose NEES") is None and any("first one" in note for note in result.notes)
    poses_only = replace(scene_truth, objects=(), frame_truth=None)
    result = score(truth=poses_only)
    assert result.value("pose NEES samples") == 9
    assert result.value("existence samples") == 0  # nobody knows what is there
    with pytest.raises(NotEvaluated, match="position of any object"):
        score(truth=poses_only, keyframes=None)


def test_an_empty_map_claims_nothing(score):
    result = score([])
    assert result.value("class samples") == result.value("existence samples") == 0
    assert result.value("position NEES") is None and not any("--all" in note for note in result.notes)
