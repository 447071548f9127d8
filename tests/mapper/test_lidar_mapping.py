"""`SemanticMapper` on LiDAR sweeps with camera detections, from files on disk to things in their places."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # `lidar_street` is there

import lidar_street as world

from thingmap.datasets.lidar_sequence import LidarSequence
from thingmap.datasets.open import open_sequence
from thingmap.detectors.detections import Detections
from thingmap.mapper.cli.main import app
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.config_file import load_config
from thingmap.mapper.estimation.lifting import LiftedDetection, lift_box
from thingmap.mapper.lidar_config import default_config, lidar_defaults
from thingmap.mapper.map.object_map import MapFrame
from thingmap.mapper.mapper import SemanticMapper

BOXES = world.street()
FRAMES = 30
CAR_SIZE = "car:\n  size: [4.3, 1.8, 1.5]\n  spread: 0.1\n"  # the built-in table is of things in rooms


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("street")
    world.write_kitti(root, FRAMES, BOXES)
    (root / "sizes.yaml").write_text(CAR_SIZE)
    return root


@pytest.fixture(scope="module")
def sequence(written: Path) -> LidarSequence:
    sequence = open_sequence(written)
    assert isinstance(sequence, LidarSequence)
    return sequence


@pytest.fixture(scope="module")
def mapper(written: Path, sequence: LidarSequence) -> SemanticMapper:
    """The whole drive; treat as read-only."""
    config = replace(default_config(sequence), class_sizes=str(written / "sizes.yaml"))
    mapper = SemanticMapper(world.Finder(BOXES), config, source=sequence.name)
    for frame in sequence:
        mapper.process_frame(frame)
    return mapper


def in_street(points: np.ndarray) -> np.ndarray:
    """(..., 3) points of the map, whose world is the first camera, in the street's axes."""
    T = world.drive(1)[1][0] @ np.linalg.inv(world.T_CAMERA_LIDAR)
    return points @ T[:3, :3].T + T[:3, 3]


def test_things_are_where_they_stand_and_once(mapper: SemanticMapper) -> None:
    things = mapper.object_map().things
    for box in BOXES:
        if not box.label:
            continue
        # how deep a thing is cannot be seen from ahead: its centre lies within it, give or take the odometry
        at = [t for t in things if (np.abs(in_street(t.position) - box.centre) < np.array(box.size) / 2 + 0.4).all()]
        assert [t.label for t in at] == [box.label], (box, [(t.label, in_street(t.position)) for t in things])
        assert at[0].existence > 0.9 and at[0].probability > 0.9
        assert at[0].size[2] == pytest.approx(box.size[2], abs=0.3)
    assert len(things) == 4


def test_the_path_is_the_vehicles(mapper: SemanticMapper, sequence: LidarSequence) -> None:
    stamps, poses = mapper.trajectory()
    assert sequence.poses is not None and len(stamps) == FRAMES
    true = np.linalg.inv(sequence.poses[0]) @ sequence.poses
    assert np.sqrt(((poses[:, :3, 3] - true[:, :3, 3]) ** 2).sum(axis=1).mean()) < 0.3  # on 17 m
    steps = np.linalg.norm(np.diff(mapper.keyframes()[1][:, :3, 3], axis=0), axis=1)
    assert 1.0 < np.median(steps) < 1.5  # a keyframe a metre


def test_up_is_the_scanners_axis(mapper: SemanticMapper) -> None:
    object_map = mapper.object_map()
    assert object_map.frame is MapFrame.FIRST_CAMERA and object_map.up.source == "LiDAR axis"
    assert object_map.up.direction @ np.array([0.0, -1.0, 0.0]) > np.cos(0.05)


def test_the_cloud_is_of_all_around_in_the_images_colours(mapper: SemanticMapper) -> None:
    points, colors = mapper.cloud()
    points = in_street(points)
    assert points[:, 0].min() < -20.0 and points[:, 0].max() > 40.0
    red = (colors == BOXES[-4].color).all(axis=1)
    assert red.sum() > 10
    assert np.abs(np.median(points[red], axis=0) - BOXES[-4].centre).max() < 2.2
    on_ground = np.abs(points[:, 2]) < 0.25
    assert on_ground.mean() > 0.3


def test_without_a_camera_there_is_a_path_and_a_grey_cloud(tmp_path: Path) -> None:
    world.write_pcd_folder(tmp_path / "scans", 6, BOXES, with_images=False)
    sequence = open_sequence(tmp_path / "scans")
    mapper = SemanticMapper(config=default_config(sequence))
    for frame in sequence:
        mapper.process_frame(frame, Detections.empty(()))
    _, poses = mapper.trajectory()
    assert poses[-1, 2, 3] == pytest.approx(3.0, abs=0.4)  # 5 steps of 0.6 m
    points, colors = mapper.cloud()
    assert len(points) > 5000 and (colors == 128).all()
    assert len(mapper.object_map()) == 0 and mapper.object_map().up.source == "LiDAR axis"


# -- numbers, and the command line


def test_a_lidar_starts_from_its_own_numbers_and_a_file_overrides_any(tmp_path: Path, sequence: LidarSequence) -> None:
    from thingmap.datasets.synthetic.sample import open_sample

    assert default_config(open_sample("tabletop?frames=2&seed=1")) == MapperConfig()
    assert default_config(sequence) == lidar_defaults() != MapperConfig()
    file = tmp_path / "config.yaml"
    file.write_text("lifting: {max_range: 30}\nodometry: {lidar: {voxel_size: 0.5}}\n")
    config = load_config(file, MapperConfig, lidar_defaults())
    assert config.lifting.max_range == 30.0 and config.odometry.lidar.voxel_size == 0.5
    assert config.lifting.noise_floor == lidar_defaults().lifting.noise_floor > 0.0
    assert config.keyframes == lidar_defaults().keyframes
    assert load_config(None, MapperConfig, lidar_defaults()) == lidar_defaults()
    assert load_config(file, MapperConfig).keyframes == MapperConfig().keyframes


def test_a_lidars_noise_hardly_grows_with_distance(sequence: LidarSequence) -> None:
    frame = sequence[0]
    frame = replace(frame, depth=np.full_like(frame.depth, 40.0))
    box = np.array([200.0, 60.0, 240.0, 100.0])
    scores = np.array([0.9])
    near_sighted = replace(MapperConfig().lifting, max_range=50.0)
    lidar = lift_box(box, scores, frame, replace(lidar_defaults().lifting, sigma_range=0.0))
    camera = lift_box(box, scores, frame, replace(near_sighted, sigma_range=0.0))
    assert isinstance(lidar, LiftedDetection) and isinstance(camera, LiftedDetection)
    assert lidar.sigma_range == pytest.approx(0.02 + 1e-5 * 40.0**2)
    assert camera.sigma_range == pytest.approx(0.0028 * 40.0**2)


def test_info_tells_points_per_scan(written: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["info", str(written)])
    assert result.exit_code == 0, result.output
    lines = dict(line.split("  ", 1) for line in result.output.splitlines())
    assert "kitti (velodyne/*.bin and calib.txt)" in lines["loader"]
    scan = lines["scan of 000000"]
    assert int(scan.split()[0]) == len(world.sweep(100.0, BOXES)[0]) and "points of one moment" in scan
    assert "% valid" in lines["depth of 000000"]
    world.write_pcd_folder(tmp_path / "scans", 1, BOXES, with_images=False)
    result = CliRunner().invoke(app, ["info", str(tmp_path / "scans")])
    assert "none: a LiDAR without a camera" in result.output and "taken from -0.050 to +0.050 s" in result.output
    assert "% valid" not in result.output


def test_run_maps_a_sequence_of_scans_with_a_lidars_numbers(written: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--detector", "none", "--max-frames", "6"]
    result = CliRunner().invoke(app, ["run", str(written), "-o", str(out), *options])
    assert result.exit_code == 0, result.output
    used = yaml.safe_load((out / "config.yaml").read_text())
    assert used["lifting"]["max_range"] == 50.0 and used["keyframes"]["translation"] == 1.0
    assert load_config(out / "config.yaml", MapperConfig) == lidar_defaults()
    last = (out / "trajectory.txt").read_text().splitlines()[-1].split()
    assert float(last[3]) == pytest.approx(3.0, abs=0.4)
    assert (out / "cloud.ply").stat().st_size > 50_000
