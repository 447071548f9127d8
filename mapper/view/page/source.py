"""The sequence that a run has mapped, opened once more for its images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....datasets.errors import UserError
from ....datasets.frame import BrokenFrame, Frame
from ....datasets.sequence import Sequence
from ....datasets.stamps import nearest
from ...map.store import OutputFolder
from ...mapped_sequence import mapped_command, open_mapped_sequence
from .cameras import SAME


@dataclass(frozen=True, slots=True, eq=False)
class Images:
    """The images of a run, or why there are none.

    Attributes:
        sequence: None where there is none.
        why_not: one sentence; empty where there is one.
    """

    sequence: Sequence | None
    why_not: str = ""

    def frame(self, stamp: float) -> Frame | None:
        """The frame of a stamp; None where it cannot be used."""
        if self.sequence is None:
            return None
        stamps = np.asarray(self.sequence.stamps)
        order = np.argsort(stamps, kind="stable")
        place = int(nearest(np.array([stamp]), stamps[order], SAME)[0])
        if place < 0:
            return None
        try:
            return self.sequence[int(order[place])]
        except BrokenFrame:
            return None


def images_of(folder: OutputFolder, sequence: Sequence | str | None, run_stamps: np.ndarray) -> Images:
    """The images of a run.

    Args:
        folder: of the run.
        sequence: as it was mapped, or its folder or name; None to open what the run's report names.
        run_stamps: (N,) seconds of the frames that were mapped.

    Raises:
        UserError: a sequence was given and cannot be opened, or is another one. One that only the report names may be
            gone: then the page says so.
    """
    if sequence is None and mapped_command(folder).get("sequence") is None:
        return Images(None, "The run's report does not say what was mapped; give it with --sequence.")
    try:
        opened = sequence
        if opened is None or isinstance(opened, str):
            opened = open_mapped_sequence(folder, opened)
        if problem := _unfit(opened, run_stamps):
            raise UserError(f"{folder.path}: {problem}; give the sequence that was mapped")
    except UserError as error:
        if sequence is not None:
            raise
        return Images(None, f"No images: what was mapped could not be opened ({error}). Say where it is: --sequence.")
    return Images(opened)


def _unfit(sequence: Sequence, run_stamps: np.ndarray) -> str:
    if sequence.intrinsics.width == 0:
        return f"{sequence.name} has no images"
    found = nearest(run_stamps, np.sort(np.asarray(sequence.stamps)), SAME)
    missing = int(np.sum(found < 0))
    return f"{missing} of its {len(found)} mapped frames are not in {sequence.name}, by their stamps" if missing else ""
