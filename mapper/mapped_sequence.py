"""The sequence that a run has mapped, opened again for its images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..datasets.errors import UserError
from ..datasets.open import open_sequence
from ..datasets.sequence import Sequence
from .map.store import OutputFolder


def mapped_command(folder: OutputFolder) -> Mapping[str, Any]:
    """What `thingmap run` was asked for, by the names of its options, as far as the report says; else empty.

    Raises:
        InputError: the report is damaged.
    """
    if not folder.report_file.is_file():
        return {}
    report = folder.read_report()
    command = report.get("command") if isinstance(report, dict) else None
    return command if isinstance(command, dict) else {}


def open_mapped_sequence(folder: OutputFolder, sequence: str | None = None, dataset: str | None = None) -> Sequence:
    """The frames that were mapped: every so many of them, and as many, as the run was asked for.

    Args:
        folder: of the run.
        sequence: where it is now, or its name; by default what the run's report names.
        dataset: its format; by default the report's for the report's sequence, else found out.

    Raises:
        UserError: nobody says which it is, or it is not there.
    """
    asked = mapped_command(folder)
    name, kind = (
        (sequence, dataset) if sequence is not None else (asked.get("sequence"), dataset or asked.get("dataset"))
    )
    if name is None:
        raise UserError(f"{folder.report_file}: it does not say what was mapped; give that with --sequence")
    try:
        return open_sequence(name, kind, asked.get("stride") or 1, asked.get("max_frames"))
    except UserError as error:
        if sequence is not None:
            raise
        raise UserError(f"{folder.path}: what it was made of: {error}; or say where it is with --sequence") from None
