"""How fast the mapper is and what memory it takes.

uv run python benchmarks/throughput.py                                       the back end alone
uv run python benchmarks/throughput.py --sequence DIR --detections FILE      and the whole loop on a sequence
uv run python benchmarks/throughput.py --sequence DIR --detector onnx:MODEL  the same; detections recorded first
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from back_end_report import describe_back_end, run_back_end
from results import show_section
from whole_loop import describe_laps, describe_loop, record, run_laps, run_loop

from thingmap.datasets.errors import UserError
from thingmap.datasets.open import open_sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    try:
        if options.sequence is not None:
            _measure_sequence(options)
        if options.keyframes:
            marks, quality = run_back_end(options.keyframes, options.objects, options.phantoms)
            show_section("Throughput: back end", describe_back_end(marks, quality, options.objects), options.write)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _measure_sequence(options: argparse.Namespace) -> None:
    with tempfile.TemporaryDirectory() as folder:
        spec, detector_ms = f"recorded:{options.detections}", None
        if options.detections is None:
            recording = Path(folder) / "detections.json"
            sequence = open_sequence(options.sequence, max_frames=options.max_frames)
            detector_ms = record(sequence, options.detector, recording)
            spec = f"recorded:{recording}"
        loop = run_loop(options.sequence, spec, options.max_frames)
        show_section("Throughput: whole loop", describe_loop(loop, detector_ms), options.write)
        if options.laps:
            samples = run_laps(options.sequence, spec, options.max_frames, options.laps)
            show_section("Throughput: memory", describe_laps(samples, options.laps), options.write)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", type=Path, metavar="DIR", help="folder of a recorded sequence")
    add("--detections", type=Path, metavar="FILE", help="recorded detections of it")
    add("--detector", metavar="SPEC", help="detector to record them with first, such as onnx:MODEL")
    add("--max-frames", type=int, metavar="N", help="take only the first N frames")
    add("--laps", type=int, default=3, metavar="N", help="times to the end and back for memory; 0 for none (default 3)")
    marks = "sizes at which the back end is timed (default 100 300 1000); none to leave it out"
    add("--keyframes", type=int, nargs="*", default=[100, 300, 1000], metavar="N", help=marks)
    add("--objects", type=int, default=100, metavar="N", help="in the back end's world (default 100)")
    add("--phantoms", type=int, default=30, metavar="N", help="false ones in it (default 30)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.sequence is not None and (options.detections is None) == (options.detector is None):
        parser.error("with --sequence give either --detections FILE or --detector SPEC")
    if options.laps < 0 or min([options.objects, *options.keyframes]) < 1 or options.phantoms < 0:
        parser.error("--keyframes and --objects count from 1, --laps and --phantoms from 0")
    return options


if __name__ == "__main__":
    sys.exit(main())
