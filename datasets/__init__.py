"""What turns files into frames; the synthetic world."""

from typing import TYPE_CHECKING

from .on_demand import on_demand

if TYPE_CHECKING:
    from .errors import InputError as InputError
    from .errors import UserError as UserError
    from .frame import BrokenFrame as BrokenFrame
    from .frame import Frame as Frame
    from .frame import FrameProblem as FrameProblem
    from .frame import Intrinsics as Intrinsics
    from .open import DATASETS as DATASETS
    from .open import open_sequence as open_sequence
    from .sequence import Sequence as Sequence
    from .views import subset as subset
    from .views import usable_frames as usable_frames

_PLACES = {
    "DATASETS": "open",
    "BrokenFrame": "frame",
    "Frame": "frame",
    "FrameProblem": "frame",
    "InputError": "errors",
    "Intrinsics": "frame",
    "Sequence": "sequence",
    "UserError": "errors",
    "open_sequence": "open",
    "subset": "views",
    "usable_frames": "views",
}
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

__getattr__ = on_demand(__name__, _PLACES)  # the loaders bring compiled kernels: half a second
