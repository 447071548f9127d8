"""`thingmap detect --validate OUT`, and what `thingmap label` says of things."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from thingmap.datasets.open import open_sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper.cli.main import app
from thingmap.mapper.map.object_map import ObjectMap

SYNTH = "synth:tabletop?seed=3&frames=12&width=240&clutter=low"
DETECTOR = "simulated?half_side=6&score_side=7&background_spots=0&chance_rate=0"  # one for small images
DREAMER = "simulated?half_side=6&score_side=7&chance_rate=2"  # sees two things a frame that are not there


def thingmap(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="thingmap")


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    out = tmp_path_factory.mktemp("mapped") / "out"
    assert thingmap("run", SYNTH, "-o", out, "--odometry", "poses", "--detector", DETECTOR).exit_code == 0
    return out


@pytest.fixture(scope="module")
def labelled(mapped, tmp_path_factory):
    """The folder of a labelled run, and what labelling it said."""
    out = shutil.copytree(mapped, tmp_path_factory.mktemp("labelled") / "out")
    result = thingmap("label", out, "--stride", 2, "--smoothness", "colour")
    assert result.exit_code == 0, result.output
    return out, result.stdout


def detect(tmp_path, *arguments):
    file = tmp_path / f"{len(list(tmp_path.iterdir()))}.json"
    result = thingmap("detect", SYNTH, "--detector", DREAMER, "-o", file, *arguments)
    return result, file


def found_in(file, sequence):
    """Detections of each frame, read as a run would read them."""
    recorded = make_detector(f"recorded:{file}", sequence)
    return [recorded(frame) for frame in (sequence[i] for i in range(len(sequence)))]


def near_objects(found, sequence) -> tuple[int, int]:
    """How many boxes have their middle in the box of an object of their class, and how many do not."""
    near = total = 0
    label_of = {thing.id: thing.label for thing in sequence.objects}
    for index, detections in enumerate(found):
        truth = sequence.truth(index)
        labels = np.array([label_of[int(id_)] for id_ in truth.object_id])
        middle = (detections.xyxy[:, :2] + detections.xyxy[:, 2:]) / 2.0
        own = np.array([detections.classes[k] for k in detections.class_id])
        inside = (middle[:, None] >= truth.xyxy[None, :, :2]) & (middle[:, None] <= truth.xyxy[None, :, 2:])
        near += int((inside.all(axis=2) & (own[:, None] == labels[None, :])).any(axis=1).sum())
        total += len(detections)
    return near, total - near


def test_boxes_that_disagree_with_the_points_are_left_out(labelled, tmp_path):
    out, _ = labelled
    before, all_file = detect(tmp_path)
    after, kept_file = detect(tmp_path, "--validate", out)
    assert before.exit_code == after.exit_code == 0, after.output
    sequence = open_sequence(SYNTH)
    every, kept = found_in(all_file, sequence), found_in(kept_file, sequence)
    for a, b in zip(every, kept, strict=True):
        assert {tuple(row) for row in b.scores.tolist()} <= {tuple(row) for row in a.scores.tolist()}
    (right, wrong), (right_kept, wrong_kept) = near_objects(every, sequence), near_objects(kept, sequence)
    assert wrong > 15 and wrong_kept < 0.4 * wrong and right_kept > 0.7 * right
    pruned = right + wrong - right_kept - wrong_kept
    assert f"{pruned} more were left out" in after.stdout and "left out" not in before.stdout


def test_frames_that_were_not_mapped_are_told(labelled, tmp_path):
    out = shutil.copytree(labelled[0], tmp_path / "out")
    lines = (out / "trajectory.txt").read_text().splitlines(keepends=True)
    (out / "trajectory.txt").write_text("".join(lines[:-4]))
    result, _ = detect(tmp_path, "--validate", out)
    assert result.exit_code == 0 and "4 frames are not in" in result.stderr, result.output


def test_mistakes_are_told_in_a_line(mapped, labelled, tmp_path):
    def refused(*arguments) -> str:
        result, file = detect(tmp_path, *arguments)
        assert result.exit_code == 2 and not file.exists(), result.output
        assert "Traceback" not in result.output and result.stderr.count("error: ") == 1
        return result.stderr

    assert "thingmap label" in refused("--validate", mapped)
    assert "thingmap run" in refused("--validate", tmp_path / "nothing")
    other = shutil.copytree(labelled[0], tmp_path / "other")  # the run of another recording, an hour later
    header, *lines = (other / "trajectory.txt").read_text().splitlines()
    rows = [line.split() for line in lines]
    later = [" ".join([str(float(row[0]) + 3600.0), *row[1:]]) for row in rows]
    (other / "trajectory.txt").write_text("\n".join([header, *later]) + "\n")
    assert "none of its frames are in" in refused("--validate", other)


def test_labelling_says_which_things_have_points(labelled):
    out, said = labelled
    things = json.loads((out / "map.json").read_text())["things"]
    having = sum(thing["points"] > 0 for thing in things)
    assert having > 3 and f"{having} of {len(things)} things have points" in said
    object_map = ObjectMap.load(out)
    assert [len(object_map.points(thing)) for thing in object_map.things] == [thing["points"] for thing in things]
    told = sum("volume" in thing for thing in things)
    assert (f"{told} have their place and size from their points" in said) == bool(told)
