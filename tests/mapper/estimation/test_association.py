"""Which detection shows which target."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from thingmap.datasets.frame import Intrinsics
from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.factors.score_model import ScoreModel
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import AssociationConfig
from thingmap.mapper.estimation.association import Assignment, Targets, associate
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.evidence import class_evidence
from thingmap.mapper.estimation.lifting import LiftedDetection

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
CONFIG = AssociationConfig()
HALF_AXES = np.array([0.1, 0.1, 0.1])
SIZES = np.log(HALF_AXES)


@dataclass
class Member:
    """All that `class_evidence` asks of a member of the scene."""

    belief: Belief = field(default_factory=lambda: Belief(3, generic_evidence_model()))


def named_as(belief: Belief, model: ScoreModel, scores: np.ndarray, views: int) -> Belief:
    """Detected with these scores from `views` places 0.2 rad apart."""
    for angle in 0.2 * np.arange(views):
        place = np.array([np.cos(angle), np.sin(angle), 0.0])
        belief.look(place, hits=1.0, scores=model.evidence(scores, 0.0))
    belief.update()
    return belief


def box_at(centre: ArrayLike, half_axes: ArrayLike = HALF_AXES, T: np.ndarray | None = None) -> np.ndarray:
    log_size = np.log(half_axes)[None]
    return project_solids(np.eye(4) if T is None else T, np.eye(3), np.array([centre]), log_size, KINECT)[0][0]


def detection(
    centre: ArrayLike, sigma: float = 0.03, xyxy: ArrayLike | None = None, half_axes: ArrayLike = HALF_AXES
) -> LiftedDetection:
    """Something seen at (3,) in the camera."""
    box = box_at(centre, half_axes) if xyxy is None else np.array(xyxy, dtype=float)
    return LiftedDetection(
        np.array([0.6, 0.1, 0.1]), box, np.ones(4, bool), 2.0, np.array(centre, dtype=float), sigma, sigma,
        np.array(half_axes),
    )  # fmt: skip


def targets(
    *centres: ArrayLike, sigma: float = 0.03, half_axes: ArrayLike = HALF_AXES, visible: float = 1.0
) -> Targets:
    positions = np.array(centres, dtype=float).reshape(-1, 3)
    count, size = len(positions), np.log(half_axes)
    boxes = np.array([box_at(p, half_axes) for p in positions]).reshape(-1, 4)
    return Targets(
        positions,
        np.tile(sigma**2 * np.eye(3), (count, 1, 1)),
        np.tile(size, (count, 1)),
        np.clip(boxes, -0.5, np.array([639.5, 479.5] * 2)),
        np.full(count, visible),
    )


def run(detections, seen: Targets, evidence: ArrayLike | None = None, T=None, config=CONFIG) -> Assignment:
    log_ratio = np.zeros((len(detections), len(seen))) if evidence is None else np.array(evidence, dtype=float)
    return associate(detections, seen, log_ratio, np.eye(4) if T is None else T, np.eye(3), config)


A, B, C = (0.0, 0.0, 2.0), (0.5, 0.0, 2.0), (-0.5, 0.2, 2.5)


def test_nothing_to_match():
    for found in (run([], targets()), run([], targets(A))):
        assert found.target.shape == (0,) and found.duplicate_of.shape == (0,)
    lonely = run([detection(A), detection(B)], targets())
    assert lonely.target.tolist() == [-1, -1] and lonely.duplicate_of.tolist() == [-1, -1]
    assert lonely.target is not lonely.duplicate_of


def test_everything_finds_its_own():
    found = run([detection(B), detection(C), detection(A)], targets(A, B, C))
    assert found.target.tolist() == [1, 2, 0]
    assert found.duplicate_of.tolist() == [-1, -1, -1]


def test_the_pose_of_the_camera_counts():
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    T[:3, 3] = [1.0, -2.0, 0.5]
    seen = targets(A, B)
    moved = replace(seen, positions=seen.positions @ T[:3, :3].T + T[:3, 3])
    assert run([detection(B), detection(A)], moved, T=T).target.tolist() == [1, 0]
    assert run([detection(B), detection(A)], moved).target.tolist() == [-1, -1]


def test_what_is_far_from_everything_is_new():
    assert run([detection((0.0, 0.0, 3.5))], targets(A)).target.tolist() == [-1]
    assert run([detection((1.0, 0.5, 2.0))], targets(A)).target.tolist() == [-1]


def test_objects_behind_each_other_are_told_apart_by_depth():
    """One box in the image, 2 m and 4 m away: twice the size at twice the distance projects alike."""
    near, far = targets(A), targets((0.0, 0.0, 4.0), half_axes=2.0 * HALF_AXES)
    np.testing.assert_allclose(near.xyxy, far.xyxy, atol=1e-6)
    both = Targets(*(np.concatenate([getattr(near, n), getattr(far, n)]) for n in Targets.__dataclass_fields__))
    for depth, expected in ((2.0, 0), (4.0, 1), (3.0, -1)):
        found = run([detection((0.0, 0.0, depth), xyxy=near.xyxy[0])], both)
        assert found.target.tolist() == [expected]


def test_the_gate_is_a_mahalanobis_distance():
    """0.2 m off is far for 3 cm sigmas and near for 10 cm ones; along the uncertain axis only."""
    off = detection((0.0, 0.0, 2.2), xyxy=box_at(A))
    assert run([off], targets(A, sigma=0.03)).target.tolist() == [-1]
    assert run([off], targets(A, sigma=0.10)).target.tolist() == [0]
    along = replace(targets(A), covariances=np.diag([1e-4, 1e-4, 0.04])[None])
    across = replace(targets(A), covariances=np.diag([0.04, 0.04, 1e-4])[None])
    assert run([off], along).target.tolist() == [0]
    assert run([off], across).target.tolist() == [-1]


def test_no_class_evidence_opens_the_gate():
    """The scores are those of this very target, which is 0.25 m away."""
    off = detection((0.0, 0.0, 2.25), xyxy=box_at(A))
    assert run([off], targets(A), [[30.0]]).target.tolist() == [-1]
    assert run([detection(A)], targets(A), [[30.0]]).target.tolist() == [0]


def test_a_detection_is_unsure_along_its_own_ray_wherever_the_camera_looks():
    """With range noise of half a metre, 0.3 m off is near along the ray and far across it. The camera looks along x."""
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    vague = replace(detection(A), sigma_range=0.5)
    for offset, expected in (((0.3, 0.0, 0.0), 0), ((0.0, 0.3, 0.0), -1), ((0.0, 0.0, 0.3), -1)):
        place = T[:3, :3] @ A + offset
        seen = replace(targets(A), positions=place[None])  # its box stays where the detection is
        assert run([vague], seen, T=T).target.tolist() == [expected]


def test_the_hungarian_assignment_beats_the_greedy_one():
    """The first detection lies nearest to the target that is the only one the second can have."""
    seen = targets((0.0, 0.0, 2.0), (0.12, 0.0, 2.0), sigma=0.06)
    first, second = detection((0.01, 0.0, 2.0), sigma=0.06), detection((-0.10, 0.0, 2.0), sigma=0.06)
    costs = [[np.sum((np.array(d.centre) - p) ** 2) for p in seen.positions] for d in (first, second)]
    assert np.argmin(costs[0]) == 0 and np.argmin(costs[1]) == 0
    alone = [run([d], seen).target.tolist() for d in (first, second)]
    assert alone == [[0], [0]]  # each would take target 0 ...
    assert run([first, second], seen).target.tolist() == [1, 0]  # ... and together they share
    assert run([second, first], seen).target.tolist() == [0, 1]


def test_a_target_is_given_once_and_a_second_box_on_it_is_a_duplicate():
    found = run([detection(A), detection(A), detection(C)], targets(A, C))
    assert sorted(found.target[:2].tolist()) == [-1, 0] and found.target[2] == 1
    assert sorted(found.duplicate_of[:2].tolist()) == [-1, 0] and found.duplicate_of[2] == -1


def test_a_small_box_on_a_large_target_is_another_thing():
    """A mug on a table: inside its box and at its place, but a tenth of its size."""
    table = targets(A, half_axes=[0.5, 0.5, 0.3])
    mug = detection((0.0, 0.0, 1.9), half_axes=[0.05, 0.05, 0.05])
    found = run([mug], table)
    assert found.target.tolist() == [-1] and found.duplicate_of.tolist() == [-1]
    half = detection((0.1, 0.0, 1.9), half_axes=[0.3, 0.3, 0.2])  # the left half of the table
    found = run([detection(A, half_axes=[0.5, 0.5, 0.3]), half], table)
    assert found.target.tolist() == [0, -1] and found.duplicate_of.tolist() == [-1, 0]


def test_a_box_before_a_target_is_no_duplicate_of_it():
    front = detection((0.0, 0.0, 1.0), half_axes=[0.05, 0.05, 0.05])
    np.testing.assert_allclose(front.xyxy, box_at(A), atol=1.0)
    assert run([front], targets(A)).duplicate_of.tolist() == [-1]


def test_what_cannot_be_seen_is_not_matched():
    assert run([detection(A)], targets(A, visible=0.05)).target.tolist() == [-1]
    assert run([detection(A)], targets(A, visible=0.15)).target.tolist() == [0]
    behind = replace(targets(A), xyxy=np.full((1, 4), np.nan), visible=np.zeros(1))
    found = run([detection(A)], behind)
    assert found.target.tolist() == [-1] and found.duplicate_of.tolist() == [-1]
    assert behind.side_px.tolist() == [0.0]


def test_boxes_of_another_scale_are_another_thing():
    assert run([detection(A, xyxy=[300.0, 220.0, 340.0, 260.0])], targets(A)).target.tolist() == [0]
    assert run([detection(A, xyxy=[316.0, 236.0, 324.0, 244.0])], targets(A)).target.tolist() == [-1]


def test_between_equal_places_the_class_decides():
    seen = targets(A, A)
    assert run([detection(A)], seen, [[0.0, 2.0]]).target.tolist() == [1]
    assert run([detection(A)], seen, [[2.0, 0.0]]).target.tolist() == [0]
    assert run([detection(A), detection(A)], seen, [[0.0, 2.0], [0.0, 2.0 + 1e-3]]).target.tolist() == [0, 1]


@pytest.mark.parametrize("classes", [2, 6, 80, 1200])
def test_the_class_never_gates(classes):
    """A thing that everybody was sure was the first class is now named the second with the highest score there is."""
    model = generic_evidence_model().bind([f"class {k}" for k in range(classes)]).scores
    sure, named = np.full(classes, 0.01), np.full(classes, 0.0)
    sure[0], named[1] = 0.9, 1.0
    member = Member(named_as(Belief(classes, generic_evidence_model()), model, sure, 30))
    assert member.belief.class_posterior()[0] > 0.999
    for scores in (named, np.where(named > 0.0, 1.0, np.nan)):
        evidence = class_evidence([model.evidence(scores, 0.0)], [member])  # type: ignore[list-item]
        assert evidence[0, 0] < -0.1 and np.isfinite(evidence).all()
        assert run([detection(A)], targets(A), evidence).target.tolist() == [0]


def test_class_evidence_of_nothing_and_of_an_open_posterior():
    model = generic_evidence_model().bind("abc").scores
    scores = [model.evidence(np.array([0.6, 0.1, 0.1]), 0.0)]
    assert class_evidence([], [Member()]).shape == (0, 1)  # type: ignore[list-item]
    assert class_evidence(scores, []).shape == (1, 0)
    np.testing.assert_allclose(class_evidence(scores, [Member()]), 0.0, atol=1e-12)  # type: ignore[list-item]


def test_class_evidence_favours_the_member_of_the_named_class():
    model, members = generic_evidence_model().bind("abc").scores, [Member(), Member()]
    for k, member in enumerate(members):
        own = np.full(3, 0.02)
        own[k] = 0.6
        named_as(member.belief, model, own, 3)
    evidence = class_evidence([model.evidence(np.array([0.02, 0.6, 0.02]), 0.0)], members)  # type: ignore[list-item]
    assert evidence[0, 1] > 0.5 > 0.0 > evidence[0, 0]
