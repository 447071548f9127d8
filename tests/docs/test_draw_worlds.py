"""The picture of the synthetic world."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import pytest

from thingmap.datasets.synthetic.config import Preset
from thingmap.datasets.synthetic.synth import parse_synth

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))

import draw_worlds


def test_every_preset_is_shown_once_by_a_frame_that_it_has():
    configs = [parse_synth(line) for line in draw_worlds.FRAMES]
    assert sorted(config.preset for config in configs) == sorted(Preset)
    assert all(index < config.frame_count for config, index in zip(configs, draw_worlds.FRAMES.values(), strict=True))


def test_the_frames_stand_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    lines = {f"synth:survey?width=64&objects=1&clutter=low&frames={frames}": 0 for frames in (1, 2, 3, 4)}
    monkeypatch.setattr(draw_worlds, "FRAMES", lines)
    monkeypatch.setattr(draw_worlds, "WIDTH", 64)
    monkeypatch.setattr(sys, "argv", ["draw_worlds.py", "-o", str(tmp_path / "w.jpg")])
    draw_worlds.main()
    picture = cv2.imread(str(tmp_path / "w.jpg"))
    assert picture is not None and picture.shape == (96, 128, 3) and picture.std() > 5.0
