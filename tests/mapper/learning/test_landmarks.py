"""Landmarks of a small rendered scene, taken down on the way, beside what the evaluator makes of the same maps."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame, FrameProblem
from thingmap.datasets.ground_truth import GroundTruth
from thingmap.datasets.synthetic.config import ClutterLevel, Preset, SyntheticConfig
from thingmap.datasets.synthetic.sequence import SyntheticSequence
from thingmap.detectors.detections import Detections
from thingmap.detectors.spec import make_detector
from thingmap.factors.evidence_model import generic_evidence_model
from thingmap.factors.existence import Evidence
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.beliefs import Belief
from thingmap.mapper.estimation.landmarks import Landmark
from thingmap.mapper.estimation.size_site import SizeSite
from thingmap.mapper.evaluation.uncertainty.claims import class_claims, existence_claims
from thingmap.mapper.learning import landmarks
from thingmap.mapper.learning.known_scene import known_scene
from thingmap.mapper.learning.landmarks import TAKEN_AFTER, LandmarkSamples, landmark_samples

FRAMES = 12  # each a keyframe: the survey's camera moves 5 degrees at a time
CONFIG = MapperConfig()
GENERIC = generic_evidence_model()


class Seen:
    """A rendered sequence and its detections, each frame made once."""

    def __init__(self, sequence: SyntheticSequence) -> None:
        self.frames = [sequence[index] for index in range(len(sequence))]
        detector = make_detector("simulated?seed=1", sequence)
        self.found = [detector(frame) for frame in self.frames]
        for name in ("name", "names", "intrinsics", "poses", "stamps", "gravity", "classes", "objects", "truth"):
            setattr(self, name, getattr(sequence, name))

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int):
        return self.frames[index]

    def __iter__(self):
        return iter(self.frames)

    def detect(self, frame) -> Detections:
        return self.found[frame.index]


@pytest.fixture(scope="module")
def seen() -> Seen:
    config = SyntheticConfig(Preset.SURVEY, objects=8, clutter=ClutterLevel.LOW, seed=3, frames=FRAMES, width=240)
    return Seen(SyntheticSequence(config))


@pytest.fixture(scope="module")
def scene(seen):
    return known_scene(seen, truth_of(seen), "truth")


def truth_of(seen: Seen) -> GroundTruth:
    names, stamps = tuple(seen.names), np.asarray(seen.stamps, dtype=np.float64)
    up = np.array([0.0, 0.0, 1.0])
    return GroundTruth(seen.name, seen.classes, seen.objects, up=up, names=names, stamps=stamps, poses=seen.poses)


@pytest.fixture(scope="module")
def taken(seen, scene):
    """The samples, and the cases of the evaluator that they were labelled by."""
    cases, make = [], landmarks.build_case

    def remember(*arguments):
        cases.append(make(*arguments))
        return cases[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(landmarks, "build_case", remember)
        return landmark_samples(scene, seen.detect, GENERIC, seen.classes, CONFIG), cases


def test_labels_are_those_of_the_evaluator(taken):
    samples, cases = taken
    row = 0
    for case in cases:
        matching = landmarks.match_ranked(case)
        _, stands = existence_claims(matching)
        _, true_class = class_claims(case, matching)
        label = samples.label[row : row + len(stands)]
        np.testing.assert_array_equal(label >= 0, stands)
        names = [case.run.object_map.classes[k] for k in label[label >= 0]]
        assert names == [case.truth.classes[k] for k in true_class]
        row += len(stands)
    assert row == len(samples)
    assert np.count_nonzero(samples.label < 0) >= 10 and np.count_nonzero(samples.label >= 0) >= 10


def test_a_row_is_one_landmark_in_all_its_columns(taken):
    samples, cases = taken
    things = [placed.thing for case in cases for placed in case.things]
    np.testing.assert_allclose(2.0 * np.exp(samples.log_size), [thing.size for thing in things])
    views = samples.evidence.hits + samples.evidence.misses
    for k, thing in enumerate(things):
        assert views[k] <= thing.evidence.supporting + thing.evidence.occluded + thing.evidence.contradicting + 1e-6


def test_landmarks_are_taken_down_young_and_old(taken):
    _, cases = taken
    frames = [len(case.run.stamps) for case in cases]
    assert frames == sorted(set(frames)) and set(frames) <= set(TAKEN_AFTER)
    assert frames[0] <= 4 and frames[-1] == FRAMES


def test_shapes(taken, seen):
    samples, _ = taken
    N, K = len(samples), len(seen.classes)
    assert samples.evidence.own.shape == samples.evidence.excess.shape == (N, K)
    assert samples.evidence.log_size.shape == (N, K + 1) and not samples.evidence.log_size.any()
    assert samples.information.shape == (N, 3, 3)
    assert samples.vector.shape == samples.log_size.shape == (N, 3)
    assert (samples.evidence.hits > 0.0).all()  # nothing is a landmark that was never detected
    assert all(np.isfinite(getattr(samples.evidence, field.name)).all() for field in fields(Evidence))


def test_mapping_again_gives_the_same(taken, scene, seen):
    assert same(taken[0], landmark_samples(scene, seen.detect, GENERIC, seen.classes, CONFIG))


@pytest.mark.parametrize("believed", [-6.0, 0.0, 3.0])
def test_measured_sizes_are_free_of_what_was_believed_of_them(believed):
    """Whatever Gaussian stood for the class in the graph, it is divided out again."""
    measured, information = np.log([0.05, 0.06, 0.07]), np.array([[40.0, 5.0, 0.0], [5.0, 30.0, 2.0], [0.0, 2.0, 90.0]])
    site = SizeSite(np.full(3, believed), 25.0 * np.eye(3))
    covariance = np.linalg.inv(information + site.information)
    log_size = covariance @ (information @ measured + site.information @ site.mean)
    landmark = Landmark(1, Belief(3, GENERIC), np.zeros(3), log_size, 0.0, 1.0)
    landmark.log_size_covariance, landmark.size_site = covariance, site
    samples = landmarks._samples([landmark], np.array([-1]), np.arange(3))
    np.testing.assert_allclose(samples.information[0], information, atol=1e-6)
    np.testing.assert_allclose(np.linalg.solve(samples.information[0], samples.vector[0]), measured, atol=1e-6)


def test_sizes_speak_for_the_true_class(taken, seen):
    samples = taken[0]
    background = samples.background_size()
    sized = samples.with_size(seen.classes, background, CONFIG)
    assert not samples.evidence.log_size.any()
    says = sized.evidence.log_size
    assert says.shape == (len(samples), len(seen.classes) + 1) and np.isfinite(says).all()
    true = np.flatnonzero(samples.label >= 0)
    others = says[true, 1:].mean(axis=1)
    assert (says[true, samples.label[true] + 1] - others).mean() > 0.5
    false = samples.label < 0
    np.testing.assert_allclose(background[0], samples.log_size[false].mean(axis=0))
    assert (np.linalg.eigvalsh(background[1]) > 0.0).all()


def test_select_takes_rows_of_everything(taken):
    samples = taken[0]
    rows = np.array([4, 0, 2])
    chosen = samples.select(rows)
    assert len(chosen) == 3
    for field in fields(Evidence):
        np.testing.assert_array_equal(getattr(chosen.evidence, field.name), getattr(samples.evidence, field.name)[rows])
    for field in fields(LandmarkSamples)[1:]:
        np.testing.assert_array_equal(getattr(chosen, field.name), getattr(samples, field.name)[rows])
    assert same(samples.select(samples.label < 0), samples.select(np.flatnonzero(samples.label < 0)))


def test_joined_counts_the_sequences(taken):
    first, second = taken[0].select(np.arange(5)), taken[0].select(np.arange(3))
    both = LandmarkSamples.joined([first, second])
    assert both.scene.tolist() == [0] * 5 + [1] * 3
    np.testing.assert_array_equal(both.label, np.concatenate([first.label, second.label]))
    np.testing.assert_array_equal(both.evidence.own[5:], second.evidence.own)
    np.testing.assert_array_equal(both.information[:5], first.information)


def test_classes_in_another_order_are_put_in_order(taken, scene, seen):
    order = [*range(1, len(seen.classes)), 0]

    def turned(frame) -> Detections:
        found = seen.detect(frame)
        return Detections(tuple(found.classes[k] for k in order), found.xyxy, found.scores[:, order], found.part)

    samples = landmark_samples(scene, turned, GENERIC, seen.classes, CONFIG)
    np.testing.assert_array_equal(samples.label, taken[0].label)
    np.testing.assert_allclose(samples.evidence.own, taken[0].evidence.own, atol=1e-6)
    np.testing.assert_allclose(samples.evidence.excess, taken[0].evidence.excess, atol=1e-6)


def test_a_detector_of_other_classes_is_refused(scene, seen):
    with pytest.raises(UserError, match="the same 8 classes for all sequences, found one of 7"):
        landmark_samples(scene, seen.detect, GENERIC, (*seen.classes, "zebra"), CONFIG)


def test_nothing_found_is_no_sample(scene, seen):
    assert landmark_samples(scene, lambda frame: Detections.empty(seen.classes), GENERIC, seen.classes, CONFIG) is None


class Torn(Seen):
    """The same sequence, but that frame 5 cannot be read."""

    def __init__(self, seen: Seen) -> None:
        vars(self).update(vars(seen))

    def __getitem__(self, index: int):
        if index == 5:
            raise BrokenFrame("torn", FrameProblem.UNREADABLE)
        return self.frames[index]

    def __iter__(self):
        return (self[index] for index in range(len(self)))


def test_frames_that_cannot_be_read_are_left_out(seen):
    torn = known_scene(Torn(seen), truth_of(seen), "truth")
    samples = landmark_samples(torn, seen.detect, GENERIC, seen.classes, CONFIG)
    assert samples is not None and len(samples) > 20


def test_names_are_spelled_as_anybody_likes(taken, scene, seen):
    names = tuple(name.replace(" ", "_").upper() for name in seen.classes)

    def spelled(frame) -> Detections:
        found = seen.detect(frame)
        return Detections(names, found.xyxy, found.scores, found.part)

    assert same(taken[0], landmark_samples(scene, spelled, GENERIC, names, CONFIG))


def test_what_the_detector_has_no_name_for_is_no_object(scene, seen):
    """As in the first stage; and the sequence still counts."""
    kept = [k for k, name in enumerate(seen.classes) if name != "flashlight"]
    names = tuple(seen.classes[k] for k in kept)
    assert len(names) == len(seen.classes) - 1 and "flashlight" in {thing.label for thing in seen.objects}

    def without(frame) -> Detections:
        found = seen.detect(frame)
        return Detections(names, found.xyxy, found.scores[:, kept], found.part)

    samples = landmark_samples(scene, without, GENERIC, names, CONFIG)
    assert samples.evidence.own.shape[1] == len(kept)
    assert (samples.label >= 0).any() and samples.label.max() < len(kept)


def test_false_ones_count_whatever_they_are_called(taken, scene, seen):
    """Or of the false ones only those would count whose name is one of the truth's."""
    present = tuple(dict.fromkeys(thing.label for thing in seen.objects if thing.label != "bowl"))
    objects = tuple(thing for thing in scene.truth.objects if thing.label != "bowl")
    known = known_scene(seen, replace(scene.truth, classes=present, objects=objects), "truth")
    samples = landmark_samples(known, seen.detect, GENERIC, seen.classes, CONFIG)
    assert len(samples) == len(taken[0])


def test_poses_of_the_sequence_do_where_the_truth_has_none(taken, scene, seen):
    objects_only = replace(scene.truth, poses=None, names=(), stamps=np.empty(0))
    known = known_scene(seen, objects_only, "truth")
    assert same(taken[0], landmark_samples(known, seen.detect, GENERIC, seen.classes, CONFIG))


def same(a: LandmarkSamples, b: LandmarkSamples) -> bool:
    pairs = [(getattr(a, f.name), getattr(b, f.name)) for f in fields(LandmarkSamples)[1:]]
    pairs += [(getattr(a.evidence, f.name), getattr(b.evidence, f.name)) for f in fields(Evidence)]
    return all(np.array_equal(x, y) for x, y in pairs)
