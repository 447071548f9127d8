"""Birth and death of landmarks, and how often they are refreshed in between."""

from __future__ import annotations

import numpy as np
import pytest
from lives import BOWL, CUP, NOTHING, cup, empty, follow, twins
from rooms import KINECT
from stages import Stage, Thing

from thingmap.mapper.config import MapperConfig, TrackConfig
from thingmap.mapper.estimation.ledger import Ledger
from thingmap.mapper.estimation.outcomes import Outcome
from thingmap.mapper.estimation.records import DepthCentre, Look, NewLandmark, Retire, Scores
from thingmap.mapper.estimation.size_site import propagate
from thingmap.mapper.estimation.smoother import Smoother


def test_a_detection_starts_a_candidate():
    stage = Stage()
    view = stage.show(0.0, cup())
    (track,) = stage.scene.tracks
    assert track.number == 1 and track.hits == {0} and not track.misses
    assert track.first_seen == track.last_seen == view.frame.stamp
    own = track.belief.evidence.own[0]
    assert track.belief.hits == 1.0 and own[0] > own[1]
    np.testing.assert_allclose(track.position, [0.0, 0.0, 0.0], atol=0.1)
    assert stage.outcomes[Outcome.NEW_TRACK] == 1


def test_the_third_hit_makes_a_landmark():
    stage = Stage()
    for promoted, x in zip((0, 0, 1, 1), (-0.4, -0.2, 0.0, 0.2), strict=True):
        stage.show(x, cup())
        assert stage.outcomes[Outcome.PROMOTED] == promoted
    assert stage.scene.tracks == [] and list(stage.scene.landmarks) == [1]
    landmark = stage.scene.landmarks[1]
    assert landmark.supporting == {0, 1, 2, 3} and landmark.measurements == 4
    assert landmark.first_seen == 0.0 and landmark.last_seen == pytest.approx(0.3)
    np.testing.assert_allclose(landmark.position, [0.0, 0.0, 0.0], atol=0.06)
    np.testing.assert_allclose(landmark.half_axes[[0, 2]], 0.1, rtol=0.1)


def test_what_is_probably_an_object_is_a_landmark_at_once():
    """Unless only hits are to decide, one good look is enough; a doubtful one is not."""
    quick = MapperConfig(tracks=TrackConfig(min_existence=0.6))
    for scores, landmarks in ((CUP, 1), (NOTHING, 0)):
        stage = follow(Stage(quick), cup(scores=scores), places=(0.0,))
        assert len(stage.scene.landmarks) == landmarks and len(stage.scene.tracks) == 1 - landmarks
    (landmark,) = follow(Stage(quick), cup(), places=(0.0,)).scene.landmarks.values()
    assert landmark.measurements == 1 and landmark.supporting == {0}


def test_the_past_of_a_candidate_is_in_the_ledger():
    stage = follow(Stage(), cup(), places=(-0.4, -0.2, 0.0))
    kinds = [type(record) for record in stage.smoother.ledger]
    assert kinds.count(NewLandmark) == 1 and kinds.count(Scores) == 3 and kinds.count(DepthCentre) == 3
    stage.show(0.2, cup())
    assert [r.keyframe for r in stage.smoother.ledger if isinstance(r, Look)] == [3]  # looks are of landmarks


def test_numbers_are_never_used_twice():
    stage = empty(follow(Stage(), cup()))
    assert list(stage.scene.retired) == [1]
    follow(stage, cup())
    assert list(stage.scene.landmarks) == [2] and list(stage.scene.retired) == [1]


def test_a_candidate_that_is_missed_is_dropped():
    """A false box on the wall: the wall stays, the box does not come again."""
    stage = Stage()
    stage.show(0.0, Thing((0.0, 2.0, 0.0), scores=NOTHING, there=False))
    follow(stage, places=np.linspace(-0.5, 0.5, stage.config.tracks.max_misses))
    assert stage.scene.tracks == [] and stage.scene.landmarks == {}
    assert stage.outcomes[Outcome.REJECTED_MISSED] == 1


def test_a_candidate_that_is_seen_through_is_dropped_for_that():
    stage = Stage()
    stage.show(0.0, cup())
    follow(stage, places=np.linspace(-0.5, 0.5, stage.config.tracks.max_misses))
    assert stage.outcomes[Outcome.REJECTED_FREE_SPACE] == 1 and stage.scene.tracks == []


def test_two_things_are_two_landmarks():
    stage = follow(Stage(), cup(-0.3), Thing((0.3, 0.0, 0.0), scores=BOWL))
    a, b = stage.scene.landmarks.values()
    assert [stage.CLASSES[int(np.argmax(x.belief.class_posterior()))] for x in (a, b)] == ["cup", "bowl"]
    assert a.belief.existence > 0.95 and b.belief.existence > 0.95
    assert stage.outcomes[Outcome.MERGED] == 0


def test_size_decides_between_classes_that_score_alike():
    """Named cup and monitor alike; once as large as a cup, once as a monitor."""
    for half_axes, label in (((0.045, 0.045, 0.05), "cup"), ((0.26, 0.1, 0.2), "monitor")):
        stage = follow(Stage(), Thing((0.0, 0.0, 0.0), half_axes, (0.4, 0.02, 0.4)))
        (landmark,) = stage.scene.landmarks.values()
        posterior = dict(zip(stage.CLASSES, landmark.belief.class_posterior(), strict=True))
        assert posterior[label] > 0.9


def test_beliefs_and_sites_agree_with_the_graph():
    """After `refresh_fully` and an update, another propagation step has nothing left to change."""
    stage = follow(Stage(), cup(), places=np.linspace(-0.8, 0.8, 12))
    (landmark,) = stage.scene.landmarks.values()
    smoother = stage.smoother
    for _ in range(6):
        smoother.settle()
        stage.lifecycle.refresh(set())
        stage.lifecycle.refresh_fully(landmark)
    smoother.settle()
    log_size, covariance = smoother.log_size(1), smoother.log_size_covariance(1)
    outlier = stage.config.beliefs.size_outlier
    belief = landmark.belief
    result = propagate(log_size, covariance, smoother.sites[1], belief.log_belief(), stage.priors, outlier)
    assert smoother.sites[1].distance(result.site) <= stage.config.beliefs.site_tolerance
    np.testing.assert_allclose(result.posterior, belief.posterior, atol=0.01)


def test_a_full_refresh_reads_the_graph_as_it_is():
    """A site was replaced and solved since the last refresh: mean and covariance have to be of the same moment."""
    stage = follow(Stage(), cup(), places=(-0.4, -0.2, 0.0))
    (landmark,) = stage.scene.landmarks.values()
    site = stage.smoother.sites[1]
    stage.smoother.set_site(1, type(site)(site.mean + 1.0, 4.0 * site.information))
    stage.smoother.update()
    arguments = landmark.belief.log_belief(), stage.priors, stage.config.beliefs.size_outlier
    now = stage.smoother.log_size(1), stage.smoother.log_size_covariance(1)
    expected = propagate(*now, stage.smoother.sites[1], *arguments)
    stage.lifecycle.refresh_fully(landmark)
    np.testing.assert_allclose(landmark.belief.posterior, expected.posterior, atol=1e-9)


def test_retired_landmarks_leave_the_graph_and_stay_known():
    stage = follow(Stage(), cup())
    landmark = stage.scene.landmarks[1]
    empty(stage)
    assert stage.scene.landmarks == {} and stage.scene.retired == {1: landmark}
    assert landmark.belief.existence < stage.config.lifecycle.retire_below
    assert stage.smoother.sites == {}
    assert stage.outcomes[Outcome.RETIRED] == 1
    assert [record.landmark for record in stage.smoother.ledger if isinstance(record, Retire)] == [1]


def test_nothing_retires_before_it_was_looked_at_often_enough():
    stage = follow(Stage(), cup(), places=(-0.4, -0.2, 0.0))
    landmark = stage.scene.landmarks[1]
    belief, views = landmark.belief, stage.config.lifecycle.retire_views
    assert belief.effective_views < views - 0.1
    belief.look(np.array([0.0, 0.0, 1.0]), free=-50.0, seen=1.0)
    belief.update()
    assert belief.existence < stage.config.lifecycle.retire_below
    stage.lifecycle.retire()
    assert list(stage.scene.landmarks) == [1]
    for side in (-1.0, 1.0):
        belief.look(np.array([side, 0.0, 0.0]), misses=1.0)
    belief.update()
    stage.lifecycle.retire()
    assert list(stage.scene.landmarks) == []


def test_the_graph_of_a_whole_life_can_be_rebuilt(tmp_path):
    stage = twins(0.02)
    follow(stage, Thing((0.5, 0.0, 0.0), scores=BOWL))
    empty(stage)
    follow(stage, cup())
    assert stage.outcomes[Outcome.MERGED] >= 1 and stage.outcomes[Outcome.RETIRED] >= 1
    stage.smoother.settle()
    stage.smoother.ledger.save(tmp_path / "ledger.npz")
    ledger, _ = Ledger.load(tmp_path / "ledger.npz")
    loaded = Smoother.from_ledger(ledger, stage.config.smoother, KINECT)
    assert loaded.sites.keys() == stage.smoother.sites.keys() == stage.scene.landmarks.keys()
    for j in loaded.sites:
        np.testing.assert_allclose(loaded.position(j), stage.smoother.position(j), atol=0.01)
        np.testing.assert_allclose(loaded.log_size(j), stage.smoother.log_size(j), atol=0.1)


def refreshed(stage, settling: bool, measured: bool, keyframes: int) -> int:
    """How often the only landmark is refreshed fully in so many keyframes without a look at it."""
    (landmark,) = stage.scene.landmarks.values()
    times, fully = [], stage.lifecycle.refresh_fully
    stage.lifecycle.refresh_fully = lambda it: (times.append(it), fully(it))  # type: ignore[method-assign]
    for _ in range(keyframes):
        stage.smoother.add_keyframe(np.eye(4), np.diag(np.full(6, 1e-4)))
        stage.smoother.update()
        landmark.unsettled = settling
        landmark.measurements += measured
        stage.lifecycle.refresh(set())
    return len(times)


@pytest.mark.parametrize(
    ("settling", "measured", "expected"), [(True, True, 10), (True, False, 2), (False, True, 3), (False, False, 0)]
)
def test_landmarks_are_refreshed_when_measured_and_settle_slowly_otherwise(settling, measured, expected):
    """Every third measurement of what was measured often; every one while it is settling; else every fifth keyframe."""
    stage = follow(Stage(), cup(), places=np.linspace(-0.8, 0.8, 12))
    (landmark,) = stage.scene.landmarks.values()
    landmark.measurements = landmark.refreshed_at = 12
    assert refreshed(stage, settling, measured, 10) == expected
