"""The sequence that a run has mapped, opened again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...datasets.errors import UserError
from ...datasets.open import open_sequence
from ...datasets.sequence import Sequence
from ..map.store import OutputFolder


def mapped_command(folder: OutputFolder) -> Mapping[str, Any]:
    """What `thingmap run` was asked for, as far as the report says; empty where it does not."""
    if not folder.report_file.is_file():
        return {}
    report = folder.read_report()
    command = report.get("command") if isinstance(report, dict) else None
    return command if isinstance(command, dict) else {}


def open_mapped_sequence(folder: OutputFolder, sequence: str | None, dataset: str | None) -> Sequence:
    """The sequence named, or the one that the run's report names, as many frames of it as were asked for.

    Raises:
        UserError: nobody says which it is, or it is not there any more.
    """
    asked = mapped_command(folder)
    name = sequence or asked.get("sequence")
    if name is None:
        raise UserError(f"{folder.report_file}: it does not say what was mapped; give that with --sequence")
    if sequence is not None:
        return open_sequence(sequence, dataset, asked.get("stride") or 1, asked.get("max_frames"))
    try:
        return open_sequence(name, dataset or asked.get("dataset"), asked.get("stride") or 1, asked.get("max_frames"))
    except UserError as error:
        raise UserError(f"{folder.path}: what it was made of: {error}; or say where it is with --sequence") from None
