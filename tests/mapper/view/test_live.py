"""A run of the sample, recorded by the live view and read back by rerun."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rerun_reading import Recorded, rgb
from sample_maps import as_text

from thingmap.datasets.views import subset
from thingmap.detectors.simulated import SimulatedDetector
from thingmap.mapper.batch.batch_mapper import BatchMapper
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.multiview.track_mapper import TrackMapper
from thingmap.mapper.queries.answer import PROBABLE
from thingmap.mapper.runner import SequenceRun, run_sequence
from thingmap.mapper.view.live import LiveView
from thingmap.mapper.view.live_targets import LiveTargets
from thingmap.mapper.view.rerun_frame import DETECTION_COLOR, SEEN_COLORS
from thingmap.mapper.view.shown_things import Seen

pytest.importorskip("rerun", reason="the live view needs the extra `view`")

FRAMES = 30


@pytest.fixture(scope="module")
def few(sample):
    return subset(sample, stride=2, max_frames=FRAMES)


def watched(sequence, mapper, file):
    warnings = []
    view = LiveView(mapper, LiveTargets(file=file).open(sequence.name), MapperConfig().cloud, warnings.append)
    run_sequence(sequence, mapper, on_update=view)
    object_map = mapper.object_map()
    view.finish(object_map)
    view.close()
    assert warnings == []
    return object_map


@pytest.fixture(scope="module")
def run(few, tmp_path_factory):
    """The mapper, its map and what was recorded."""
    mapper, file = SemanticMapper(SimulatedDetector(few)), tmp_path_factory.mktemp("live") / "run.rrd"
    object_map = watched(few, mapper, file)
    return mapper, object_map, Recorded(file)


def test_watching_changes_no_map(few, run):
    alone = SemanticMapper(SimulatedDetector(few))
    run_sequence(few, alone)
    watched_mapper, object_map, _ = run
    assert as_text(alone.object_map()) == as_text(object_map)
    for mine, other in zip(alone.keyframes(), watched_mapper.keyframes(), strict=True):
        assert np.array_equal(mine, other)


def test_time_is_that_of_frames_and_of_the_sensor(few, run):
    *_, recorded = run
    assert recorded.timelines == {"frame", "sensor time"}
    assert [frame for frame, _ in recorded.rows("world/camera", "Transform3D:translation")] == [f.index for f in few]


def test_the_last_things_drawn_are_those_of_the_map(run):
    _, object_map, recorded = run
    things = sorted(object_map.things, key=lambda thing: thing.id)
    assert len(things) >= 5
    centers = np.array(recorded.latest("world/things", "Boxes3D:centers"))
    assert np.allclose(centers, [t.position for t in things], atol=1e-5)
    half_sizes = np.array(recorded.latest("world/things", "Boxes3D:half_sizes"))
    assert np.allclose(2.0 * half_sizes, [t.size for t in things], atol=1e-5)
    labels = recorded.latest("world/things", "Boxes3D:labels")
    expected = [f"{t.label} {int(t.id[6:])}: {t.probability * t.existence:.2f}" for t in things]
    assert labels == expected


def test_ellipsoids_hold_95_percent(run):
    _, object_map, recorded = run
    things = sorted(object_map.things, key=lambda thing: thing.id)
    half_axes = np.sort(np.array(recorded.latest("world/positions", "Ellipsoids3D:half_sizes")), axis=1)
    variances = np.array([np.linalg.eigvalsh(t.position_covariance) for t in things])
    assert np.allclose(half_axes**2, 7.815 * variances, rtol=1e-3)


def test_the_camera_is_where_the_mapper_has_it(few, run):
    mapper, _, recorded = run
    last = recorded.rows("world/camera", "Transform3D:translation")[-1][1][0]
    assert np.linalg.norm(np.array(last) - mapper.trajectory()[1][-1, :3, 3]) < 0.02
    K = np.array(recorded.latest("world/camera/image", "Pinhole:image_from_camera")[0]).reshape(3, 3).T
    k = few.intrinsics
    assert np.allclose(K, [[k.fx, 0.0, k.cx + 0.5], [0.0, k.fy, k.cy + 0.5], [0.0, 0.0, 1.0]], atol=1e-3)


def test_outlines_have_the_colour_of_what_the_keyframe_said(few, run):
    mapper, _, recorded = run
    keyframe = mapper.statistics()["keyframes"] - 1
    stamp = mapper.keyframes()[0][keyframe]
    frame = next(f.index for f in few if f.stamp == stamp)
    landmarks = {x.number: x for x in mapper.landmarks()}
    rows = dict(recorded.rows("world/camera/image/things", "Boxes2D:labels"))
    colors = dict(recorded.rows("world/camera/image/things", "Boxes2D:colors"))
    by_number = {int(text.rsplit(" ", 1)[1]): rgb(c) for text, c in zip(rows[frame], colors[frame], strict=True)}
    said = {
        number: Seen.SUPPORTED if keyframe in x.supporting else Seen.CONTRADICTED if keyframe in x.contradicting else 0
        for number, x in landmarks.items()
    }
    supported = {number for number, color in by_number.items() if color == SEEN_COLORS[Seen.SUPPORTED]}
    assert len(supported) >= 3
    for number, color in by_number.items():
        if number in said:
            assert color == SEEN_COLORS[said[number] or Seen.OCCLUDED]


def test_detections_are_those_of_the_detector_and_only_in_their_frame(few, run):
    *_, recorded = run
    rows = recorded.rows("world/camera/image/detections", "Boxes2D:centers")
    colors = recorded.rows("world/camera/image/detections", "Boxes2D:colors")
    detector = SimulatedDetector(few)
    by_index = {f.index: f for f in few}
    for (frame, centers), (_, color) in zip(rows, colors, strict=True):
        xyxy = detector(by_index[frame]).xyxy
        assert np.allclose(np.array(centers), (xyxy[:, :2] + xyxy[:, 2:]) / 2.0, atol=1e-3)
        assert rgb(color[0]) == DETECTION_COLOR
    cleared = [f for f, _ in recorded.rows("world/camera/image/detections", "Clear:is_recursive")]
    keyframes = [f for f, _ in rows]
    order = [f.index for f in few]
    followed = [order[order.index(k) + 1] for k in keyframes if k != order[-1]]
    assert cleared == [f for f in followed if f not in keyframes]


def test_images_and_depth_are_those_of_the_frames(few, run):
    import cv2

    *_, recorded = run
    frame, blob = recorded.rows("world/camera/image", "EncodedImage:blob")[-1]
    image = cv2.imdecode(np.array(blob[0], dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
    color = next(f.color for f in few if f.index == frame)
    assert np.abs(image.astype(float) - color).mean() < 6.0
    frame, buffer = recorded.rows("world/camera/depth", "DepthImage:buffer")[-1]
    depth = next(f.depth for f in few if f.index == frame)
    shown = np.array(buffer[0], dtype=np.uint8).view(np.uint16).reshape(depth.shape) / 1000.0
    assert np.abs(shown - depth).max() < 1.1e-3


def test_the_cloud_is_in_pieces_that_hang_on_keyframes(run):
    mapper, _, recorded = run
    pieces = sorted(e for e in recorded.entities if e.startswith("world/cloud/"))
    assert 1 < len(pieces) <= mapper.statistics()["keyframes"]
    poses = mapper.keyframes()[1]
    size, seen = MapperConfig().cloud.voxel_size, []
    for piece in pieces:
        points = np.array(recorded.latest(piece, "Points3D:positions"))
        R = np.array(recorded.latest(piece, "Transform3D:mat3x3")[0]).reshape(3, 3).T
        t = np.array(recorded.latest(piece, "Transform3D:translation")[0])
        expected = poses[int(piece.rsplit("k", 1)[1])]
        assert np.abs(t - expected[:3, 3]).max() < 3e-3 and np.abs(R - expected[:3, :3]).max() < 3e-3
        seen.append(points @ R.T + t)
    shown = np.concatenate(seen)
    voxels = np.unique(np.floor(shown / size), axis=0)
    assert len(voxels) > 0.7 * len(shown)  # hardly any place twice, though poses have moved since
    from scipy.spatial import KDTree

    assert np.percentile(KDTree(mapper.cloud()[0]).query(shown)[0], 95) < 2.0 * size


def test_series_tell_of_existence_class_and_stages(run):
    _, object_map, recorded = run
    for thing in object_map.things:
        rows = recorded.rows(f"series/existence/{thing.id}", "Scalars:scalars")
        assert rows and all(0.0 <= value[0] <= 1.0 for _, value in rows)
    thing = object_map.things[0]
    names = recorded.latest(f"series/classes/{thing.id}", "SeriesLines:names")
    values = recorded.latest(f"series/classes/{thing.id}", "Scalars:scalars")
    assert len(names) == len(values)
    assert any(name.endswith(thing.label) for name in names)
    assert {"series/times/odometry", "series/times/smoothing", "series/times/cloud"} <= recorded.entities
    counted = recorded.latest("series/counts/things", "Scalars:scalars")[0]
    assert counted == pytest.approx(len(object_map), abs=2)
    assert len(recorded.layouts) == 1


def test_other_mappers_show_what_they_know_and_their_things_at_the_end(few, tmp_path):
    detector = SimulatedDetector(few)
    for name, mapper in (
        ("batch", BatchMapper(detector, views=(0, 8, 16, 24))),
        ("tracks", TrackMapper(detector)),
    ):
        object_map = watched(few, mapper, tmp_path / f"{name}.rrd")
        recorded = Recorded(tmp_path / f"{name}.rrd")
        probable = [thing for thing in object_map.things if thing.existence >= PROBABLE]
        assert len(recorded.latest("world/things", "Boxes3D:centers")) == len(probable) > 0
        assert {"world/path/0000", "world/camera/image", "world/camera/image/detections"} <= recorded.entities


def test_a_view_that_fails_is_told_once_and_mapping_goes_on(few, monkeypatch, tmp_path):
    mapper, warnings = SemanticMapper(SimulatedDetector(few)), []
    recording = LiveTargets(file=tmp_path / "run.rrd").open("x")
    view = LiveView(mapper, recording, MapperConfig().cloud, warnings.append)
    monkeypatch.setattr(view._path, "draw", lambda *_: 1 / 0)
    report = SequenceRun(subset(few, max_frames=8), mapper, view).execute()
    view.finish(mapper.object_map())
    view.close()
    assert report.frames_used == 8
    assert len(warnings) == 1 and "ZeroDivisionError" in warnings[0] and "mapping goes on" in warnings[0]
