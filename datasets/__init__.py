"""What turns files into frames; the synthetic world."""

from .errors import InputError, UserError
from .frame import BrokenFrame, Frame, FrameProblem, Intrinsics
from .open import DATASETS, open_sequence
from .sequence import Sequence
from .views import subset, usable_frames

__all__ = [
    "DATASETS",
    "BrokenFrame",
    "Frame",
    "FrameProblem",
    "InputError",
    "Intrinsics",
    "Sequence",
    "UserError",
    "open_sequence",
    "subset",
    "usable_frames",
]
