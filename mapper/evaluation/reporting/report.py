"""The report of an evaluation: `report.json`, and the folder that holds it with its page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....datasets.errors import InputError, UserError
from ...map.atomic import make_folder, write_atomic
from ..result import ProtocolResult
from .report_values import REMEDY, build, format_json, read_json

if TYPE_CHECKING:
    from ..evaluate import Evaluation

SCHEMA = "thingmap-report/1"
JSON_FILE = "report.json"
PAGE_FILE = "report.html"

Facts = dict[str, Any]  # name -> text, number, None or a list of texts, in the order in which people should read them


@dataclass(frozen=True, slots=True)
class Report:
    """What was evaluated, how, and what came out; equal after writing and reading.

    Attributes:
        evaluator: version of the protocols; numbers of different versions cannot be compared.
        run: facts about the map: its folder's name ("map"), source, frames, classes.
        truth: name of what it was judged by.
        classes: of the truth, that were judged.
        alignment: facts about how the map's axes were put over the truth's.
        config: every number of the evaluator.
        results: of the protocols, in order.
        skipped: protocol -> why it could not be evaluated.
        notes: what a reader of all numbers must know.
    """

    evaluator: str
    run: Facts
    truth: str
    classes: tuple[str, ...]
    alignment: Facts
    config: Facts
    results: tuple[ProtocolResult, ...]
    skipped: dict[str, str]
    notes: tuple[str, ...] = ()

    def result(self, protocol: str) -> ProtocolResult | None:
        """The answer of one protocol; None where it was skipped."""
        return next((result for result in self.results if result.protocol == protocol), None)

    def to_document(self) -> dict[str, Any]:
        """`report.json` as plain values."""
        return {
            "schema": SCHEMA,
            "evaluator": self.evaluator,
            "run": self.run,
            "truth": self.truth,
            "classes": list(self.classes),
            "alignment": self.alignment,
            "config": self.config,
            "notes": list(self.notes),
            "skipped": self.skipped,
            "results": [result.to_dict() for result in self.results],
        }


def to_report(evaluation: Evaluation) -> Report:
    """The evaluation as plain values, without the folders of the machine that it ran on."""
    run = dict(evaluation.run)
    values = {
        "evaluator": evaluation.version,
        "notes": run.pop("notes", ()),
        "run": run,
        "truth": evaluation.truth,
        "classes": evaluation.case.truth.classes,
        "alignment": evaluation.alignment,
        "config": asdict(evaluation.case.config),
        "results": [result.to_dict() for result in evaluation.results.values()],
        "skipped": evaluation.skipped,
    }
    return build(Report, _plain(values), Path(JSON_FILE))


def write_report(report: Report, page: str | None, folder: Path) -> tuple[Path, Path]:
    """Write `report.json` and `report.html`, whole or not at all, into a folder, made where absent; gives their paths.

    Without a `page` there is no new `report.html`.

    Raises:
        UserError: it cannot be written.
    """
    make_folder(folder)
    json_file, page_file = folder / JSON_FILE, folder / PAGE_FILE
    if page is not None:
        write_atomic(page_file, page.encode())
    write_atomic(json_file, f"{format_json(report.to_document())}\n".encode())
    return json_file, page_file


def read_report(path: str | Path) -> Report:
    """Read a report from its folder or from its `report.json`.

    Raises:
        InputError: there is none, or it is not a "thingmap-report/1" document with all its values.
    """
    path = Path(path)
    file = path / JSON_FILE if path.is_dir() else path
    document = read_json(file)
    if document.get("schema") != SCHEMA:
        raise InputError(file, f'the report of an evaluation (schema "{SCHEMA}")', _kind(document), REMEDY)
    return build(Report, document, file)


def check_folder(folder: Path, run: Path, overwrite: bool) -> None:
    """Raise `UserError` where a report must not be written; nothing is made.

    A folder that is not empty needs `overwrite`, which replaces the files of an earlier report and leaves the others.
    The output of a run has a `report.json` of its own and is never written into.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "a folder to write to", "a file", "choose another folder")
    if folder.resolve().is_relative_to(run.resolve()):
        raise InputError(folder, "a folder for the report", "the output of the run", "choose one outside of it")
    if folder.is_dir() and any(folder.iterdir()):
        if not overwrite:
            raise UserError(
                f"{folder}: the folder is not empty; choose another one, or replace its report with --overwrite"
            )
        file = folder / JSON_FILE
        if file.exists() and (document := read_json(file)).get("schema") != SCHEMA:
            raise InputError(file, "an earlier report of an evaluation", _kind(document), "choose another folder")


_FOLDERS = re.compile(
    r"""(?<![^\s:'"(=,])/(?:[^/\s:?'"]+/)*(?=[^/\s])"""  # of an absolute path
    r"""|(?<!\w)[A-Za-z]:[\\/](?:[^\\/:?*'"<>|]+[\\/])*"""  # and of one with a drive
)


def without_folders(text: str) -> str:
    """Any text with absolute paths in it cut to their last part: "recorded:/data/a.json" is "recorded:a.json"."""
    return _FOLDERS.sub("", text)


def _kind(document: Mapping[str, Any]) -> str:
    if "schema" in document:
        return f"schema {document['schema']!r}"
    return "the report of a run" if "frames_used" in document else "JSON without a schema"


def _plain(value: Any) -> Any:
    """As JSON holds it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return without_folders(value) if isinstance(value, str) else value
