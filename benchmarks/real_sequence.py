"""A recorded sequence with poses: is the trajectory right, and are the objects that are known to be there in the map?

    uv run python benchmarks/real_sequence.py --sequence DIR --detector onnx:MODEL

Exits with 1 where a check fails, with 2 for a user's mistake.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence as Items
from pathlib import Path

import numpy as np
from kiss_alone import KissAlone
from known_objects import KnownObject, check_things, read_known_objects
from real_sequence_report import ALIGNMENTS, Track, describe
from results import machine, write_section

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import BrokenFrame
from thingmap.datasets.open import open_sequence
from thingmap.datasets.sequence import Sequence
from thingmap.datasets.views import usable_frames
from thingmap.detectors.spec import make_detector
from thingmap.mapper.config import MapperConfig, OdometryConfig
from thingmap.mapper.config_file import load_config
from thingmap.mapper.mapper import SemanticMapper
from thingmap.mapper.runner import run_sequence

KNOWN_OBJECTS = "objects_derived.json"


def main(arguments: Items[str] | None = None) -> int:
    """Map, compare, print, and write if asked to."""
    options = _options(arguments)
    try:
        return _run(options)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace) -> int:
    config = load_config(options.config, MapperConfig)
    sequence = open_sequence(options.sequence, max_frames=options.max_frames)
    if sequence.poses is None:
        raise UserError(f"{options.sequence}: the sequence has no poses to compare with")
    known = _known_objects(options)
    mapper = SemanticMapper(
        make_detector(options.detector, sequence), config, source=sequence.name, gravity=sequence.gravity
    )
    report = run_sequence(sequence, mapper)
    object_map = mapper.object_map(include_doubtful=True)
    ours = beside_truth(mapper.trajectory(), sequence)
    kiss = beside_truth(register_all(sequence, config.odometry), sequence)
    checks = {name: check_things(object_map.things, known, a) for name, a in ours.alignments().items()}
    text = describe(report, object_map, sequence.gravity, ours, kiss, checks)
    print(text)
    if options.write:
        write_section("Real sequence", f"{text}\n\n{machine()}")
    return 0 if all(check.passed for check in checks[options.alignment]) else 1


def beside_truth(trajectory: tuple[np.ndarray, np.ndarray], sequence: Sequence) -> Track:
    """(N,) stamps and (N, 4, 4) poses beside the sequence's own; frames without a true pose are left out."""
    assert sequence.poses is not None
    stamps, poses = trajectory
    index = {float(stamp): i for i, stamp in enumerate(sequence.stamps)}
    truth = sequence.poses[[index[float(stamp)] for stamp in stamps]]
    known = np.isfinite(truth).all(axis=(1, 2))
    return Track(poses[known], truth[known])


def register_all(sequence: Sequence, config: OdometryConfig) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and poses of KISS-ICP alone."""
    odometry, stamps, poses = KissAlone(config), [], []
    for frame in usable_frames(sequence, lambda broken: None):
        try:
            poses.append(odometry.register(frame))
            stamps.append(frame.stamp)
        except BrokenFrame:
            continue
    return np.array(stamps), np.array(poses).reshape(-1, 4, 4)


def _known_objects(options: argparse.Namespace) -> list[KnownObject]:
    path = options.objects or options.sequence / KNOWN_OBJECTS
    if options.objects is None and not path.exists():
        print(f"no {KNOWN_OBJECTS} in the sequence's folder: only the trajectory is compared", file=sys.stderr)
        return []
    return read_known_objects(path)


def _options(arguments: Items[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", type=Path, required=True, metavar="DIR", help="folder of a recorded sequence with poses")
    add("--detector", required=True, metavar="SPEC", help="onnx:MODEL, recorded:FILE, ...")
    add("--objects", type=Path, metavar="FILE", help=f"known objects (default {KNOWN_OBJECTS} in the folder)")
    choice = "by which the checks decide (default positions)"
    add("--alignment", choices=list(ALIGNMENTS), default="positions", help=choice)
    add("--config", type=Path, metavar="FILE", help="YAML over the mapper's defaults")
    add("--max-frames", type=int, metavar="N", help="take only the first N frames")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
