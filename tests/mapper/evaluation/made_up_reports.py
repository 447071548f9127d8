"""A report with everything that a protocol may answer, some of it nasty."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from thingmap.mapper.evaluation.config import EvaluationConfig
from thingmap.mapper.evaluation.reporting.report import Report
from thingmap.mapper.evaluation.result import (
    VERSION,
    Better,
    Metric,
    Plot,
    PlotKind,
    ProtocolResult,
    Series,
    Table,
    WorstCase,
)

NASTY = "<script>alert('x & \"y\"')</script>"


def make_protocol(name: str = "objects", *metrics: Metric) -> ProtocolResult:
    """An answer of the given metrics, with details."""
    gap = float("nan")
    return ProtocolResult(
        protocol=name,
        title=f"Title of {name}",
        follows="a paper & its section",
        metrics=metrics or (Metric("joint F1", 0.75), Metric("centre error", 0.0123, "m", Better.LOWER)),
        tables=(Table("By class", ("class", "found", "error, m"), (("cup", 3, 0.25), (NASTY, 0, None))),),
        plots=(
            Plot("Curve", "recall", "precision", (Series("cup", (0.0, 0.5, 1.0), (1.0, gap, 0.25)),), (0, 1, 0, 1)),
            Plot(
                NASTY,
                "$x_1$ & more",
                "n",
                (
                    Series("bars", (0.5, 1.5), (3.0, 4.0), PlotKind.BARS),
                    Series(NASTY, (0.5, 1.5), (1.0, 2.0), PlotKind.POINTS),
                ),
            ),
        ),
        worst=(
            WorstCase("cup 3 was never found", 1, truth_xyxy=(20.0, 10.0, 29.0, 19.0)),
            WorstCase(NASTY, 2, (20.0, 10.0, 29.0, 19.0), (24.0, 12.0, 33.0, 21.0)),
            WorstCase("cup 4 has no picture"),
        ),
        notes=("Objects below 25 % are left out.",),
    )


def make_report(*results: ProtocolResult, **changes: Any) -> Report:
    """A report of these results, or of one protocol."""
    values: dict[str, Any] = {
        "evaluator": VERSION,
        "run": {"map": "tabletop", "source": "sample:tabletop", "frames in common": 9, "detector": None},
        "truth": "sample:tabletop",
        "classes": ("cup", "bowl"),
        "alignment": {"method": "SE(3) by poses", "up error, degrees": 0.5},
        "config": asdict(EvaluationConfig()) | {"path_lengths": [3, 7, 10, 12], "explicit_lengths": [2, 3, 4, 5, 6]},
        "results": results or (make_protocol(),),
        "skipped": {"lai": "the truth has no labelled points"},
        "notes": ("1 thing left out.",),
    }
    return Report(**(values | changes))
