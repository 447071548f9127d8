"""From a bag to a map, by the commands alone."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.mapper.cli.main import app
from thingmap.mapper.map.object_map import ObjectMap

FRAMES, STEP = 12, 2


def thingmap(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def sample_bag(tmp_path: Path, record: Callable[..., Any], known: Any) -> Path:
    """The first frames of the sample, and what its detector finds in them, under the bag's names."""
    sequence = open_sequence("sample:tabletop", stride=STEP, max_frames=FRAMES)
    messages, rows = record("mcap").messages, []
    k = sequence.intrinsics
    for i, frame in enumerate(sequence):
        stamp = known.start + i * STEP * known.period
        info = messages.info(stamp, k=(k.fx, k.fy, k.cx, k.cy))
        info.width, info.height = k.width, k.height
        rows += [
            (known.names["color"], stamp, messages.image(stamp, frame.color, "rgb8")),
            (known.names["depth"], stamp, messages.image(stamp, frame.depth, "32FC1")),
            (known.names["info"], stamp, info),
        ]
    path = messages.write(tmp_path / "desk.mcap", rows)
    found = tmp_path / "detections.json"
    thingmap(
        "detect", "sample:tabletop", "--detector", "simulated", "--stride", STEP, "--max-frames", FRAMES, "-o", found
    )
    names = dict(zip(sequence.names, open_sequence(path).names, strict=True))
    text = found.read_text()
    for old, new in names.items():
        assert f'"{old}"' in text
        text = text.replace(f'"{old}"', f'"{new}"')
    (path / "detections.json").write_text(text)
    return path


def test_a_bag_becomes_a_map(tmp_path: Path, sample_bag: Path, known: Any) -> None:
    shown = thingmap("info", sample_bag)
    for topic in known.names.values():
        assert f"topic {topic}" in shown
    assert re.search(rf"^colour +{known.names['color']}, 0 images without depth", shown, re.MULTILINE)
    assert "ros (NAME.bag" in shown
    thingmap("run", sample_bag, "-o", tmp_path / "out")
    things = ObjectMap.load(tmp_path / "out")
    assert things.source == "desk"
    truth = open_sequence("sample:tabletop").objects  # type: ignore[attr-defined]
    assert {thing.label for thing in things.things} <= {thing.label for thing in truth}
    assert len(things.things) >= 5
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["frames_used"] == FRAMES


def test_topics_are_shown_where_they_cannot_be_chosen(tmp_path: Path, record: Callable[..., Any], known: Any) -> None:
    made = record("bag")
    for stamp, depth in zip(made.stamps, made.depth, strict=True):
        made.rows.append(("/second/depth", stamp, made.messages.image(stamp, depth + np.uint16(1), "16UC1")))
        made.rows.append(("/second/color", stamp, made.messages.image(stamp, made.rgb[0], "bgr8")))
    path = made.write(tmp_path / "a.bag")
    result = CliRunner().invoke(app, ["info", str(path)])
    assert result.exit_code == 2
    assert "topic /second/color  sensor_msgs/msg/Image, 3 messages, bgr8 64 x 48" in result.output
    assert "2 that could be" in result.output and "color=TOPIC" in result.output
