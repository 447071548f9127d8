"""The table of formats: what they are called, what is in them, what they need and which options they know.

It imports nothing, so that the command line can list it at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from ..map.store import OutputFolder


class Exporter(Protocol):
    """Writes a file from a run's output folder; returns how many of `ExportFormat.counts` are in it."""

    def __call__(self, folder: OutputFolder, file: Path, **options: Any) -> int: ...


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format.

    Attributes:
        name: what `--format` takes.
        endings: of files that can be nothing else; none where several formats share theirs.
        help: one line.
        function: "module:function" that writes it; modules below this package, or below the mapper with "..".
        options: keyword arguments of that function.
        counts: what it returns the number of.
        extra: of thingmap that has to be installed, where it needs one.
        needs: what it reads besides OUT.
    """

    name: str
    endings: tuple[str, ...]
    help: str
    function: str
    options: tuple[str, ...] = ("min_existence",)
    counts: str = "things"
    extra: str | None = None
    needs: str | None = None

    def load(self) -> Exporter:
        """The function that writes it."""
        module, name = self.function.split(":")
        function: Callable[..., int] = getattr(import_module(module, __package__), name)
        return function


_SCENE = ("points", "min_existence")
FORMATS = (
    ExportFormat("json", (".json",), "the map with the corners of its boxes", ".json_file:export_json"),
    ExportFormat("csv", (".csv",), "a row a thing, for spreadsheets", ".csv_file:export_csv"),
    ExportFormat("ply", (".ply",), "the cloud and the boxes, coloured and labelled by class", ".ply_file:export_ply"),
    ExportFormat("glb", (".glb",), "boxes, cloud and path as one binary glTF", ".gltf_file:export_glb", _SCENE),
    ExportFormat("gltf", (".gltf",), "the same as glTF in JSON", ".gltf_file:export_gltf", _SCENE),
    ExportFormat(
        "usd",
        (".usd", ".usda", ".usdc"),
        "boxes, cloud and path as a USD stage",
        ".usd_file:export_usd",
        _SCENE,
        extra="usd",
    ),
    ExportFormat(
        "geojson",
        (".geojson",),
        "floor plan: footprints, 95 % ellipses and the path",
        ".geojson_file:export_geojson",
        ("origin", "min_existence"),
    ),
    ExportFormat("dsg", (".dsg.json",), "scene graph as spark_dsg and Hydra read it", ".dsg_file:export_dsg"),
    ExportFormat(
        "coco",
        (".coco.json",),
        "things as boxes in the images of the sequence, with visibility",
        ".coco_file:export_coco",
        ("every", "sequence", "dataset", "min_visibility", "min_existence", "say"),
        counts="boxes",
        needs="the sequence, else OUT's cloud",
    ),
    ExportFormat(
        "tum",
        (".tum",),
        "camera poses, `stamp tx ty tz qx qy qz qw`",
        ".trajectory_files:export_tum",
        ("keyframes",),
        counts="poses",
    ),
    ExportFormat(
        "kitti",
        (".kitti",),
        "camera poses, 3 x 4 matrices a line",
        ".trajectory_files:export_kitti",
        ("keyframes",),
        counts="poses",
    ),
    ExportFormat(
        "parquet",
        (".parquet",),
        "tables of things, views or poses, for data frames and DuckDB",
        ".parquet_file:export_parquet",
        ("table", "min_existence"),
        counts="rows",
        extra="parquet",
    ),
    ExportFormat(
        "rrd", (".rrd",), "a recording for the rerun viewer", "..view.rerun_file:export_rrd", (), extra="view"
    ),
    ExportFormat(
        "html",
        (".html", ".htm"),
        "one page that shows the map offline",
        "..view.page.write:export_html",
        ("points", "sequence"),
    ),
)


def export_format(name: str) -> ExportFormat:
    """The format of that name; raises `ValueError` where there is none."""
    found = next((one for one in FORMATS if one.name == name), None)
    if found is None:
        raise ValueError(f"no export format {name!r}; there are {', '.join(one.name for one in FORMATS)}")
    return found


def format_of(file: Path) -> ExportFormat | None:
    """The format that a file's ending stands for, the longest ending first; None where none or several do."""
    name = file.name.casefold()
    endings = [(ending, one) for one in FORMATS for ending in one.endings if name.endswith(ending)]
    return max(endings, key=lambda pair: len(pair[0]))[1] if endings else None
