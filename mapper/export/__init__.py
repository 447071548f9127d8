"""Files for other tools, a module a format; each reads nothing but the output folder of a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..map.store import OutputFolder

Exporter = Callable[[OutputFolder, Path], int]


def exporter(name: str) -> Exporter:
    """The function that writes the format "json", "csv" or "ply"; it returns the number of things written."""
    if name == "json":
        from .json_file import export_json

        return export_json
    if name == "csv":
        from .csv_file import export_csv

        return export_csv
    if name == "ply":
        from .ply_file import export_ply

        return export_ply
    raise ValueError(f"no export format {name!r}; there are json, csv and ply")
