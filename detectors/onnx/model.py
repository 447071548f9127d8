"""A loaded network of which everything a detector needs is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from ..class_names import read_class_names
from ..coco import COCO_80
from .header import Header, read_header
from .network import Backend, Network, load_network
from .outputs import STRIDES, OutputFamily, family_of

Size = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A network with its class names, input size (width, height) in pixels, input type and output layout."""

    path: Path
    classes: tuple[str, ...]
    size: Size
    dtype: type[np.floating]
    family: OutputFamily
    network: Network

    def __call__(self, image: np.ndarray) -> np.ndarray:
        """(H, W, 3) uint8 RGB of the input size to the output with the boxes, as `decode` takes it."""
        channels = image.transpose(2, 0, 1)[None].astype(self.dtype)
        if self.family.is_yolox:
            blob = np.ascontiguousarray(channels[:, ::-1])
        else:
            blob = channels / self.dtype(255)
        return next(output for output in self.network(blob) if family_of(output.shape, *self.size))


def load_model(
    path: Path,
    classes: Sequence[str] | str | Path | None,
    backend: Backend,
    input_size: Size | None,
    family: OutputFamily | None,
) -> Model:
    """Load a network and run it once; `OnnxDetector` explains the arguments and the errors."""
    header = read_header(path)
    names = _names(classes, header)
    size = _input_size(path, header, input_size)
    network = load_network(path, backend)
    outputs = network(np.zeros((1, 3, size[1], size[0]), dtype=header.dtype))
    family = _understood(path, [output.shape for output in outputs], size, family, len(names))
    return Model(path, names, size, header.dtype, family, network)


def _names(classes: Sequence[str] | str | Path | None, header: Header) -> tuple[str, ...]:
    if classes is None:
        return header.classes or COCO_80
    return read_class_names(classes) if isinstance(classes, str | Path) else tuple(classes)


def _input_size(path: Path, header: Header, wanted: Size | None) -> Size:
    """The model's own size, else the wanted one, else 640 x 640."""
    height, width = header.shape[2:]
    default = wanted or (640, 640)
    size = (width or default[0], height or default[1])
    if wanted is not None and wanted != size:
        raise InputError(path, f"an input of {_text(wanted)}", _text(size), "leave the input size to the model")
    if any(side < STRIDES[-1] or side % STRIDES[-1] for side in size):
        raise InputError(path, "an input size in multiples of 32", _text(size), "give another input size")
    return size


def _understood(
    path: Path, shapes: list[tuple[int, ...]], size: Size, wanted: OutputFamily | None, names: int
) -> OutputFamily:
    """The family of the first output that has one; its class count must agree with the names."""
    shape, family = next(((s, f) for s in shapes if (f := family_of(s, *size))), (None, None))
    if shape is None or family is None:
        expected = f"an output of YOLOX, YOLOv5 or YOLOv8 for a {_text(size)} input, (1, N, 5+K) or (1, 4+K, N)"
        found = "shapes " + ", ".join(str(tuple(s)) for s in shapes)
        raise InputError(path, expected, found, "export without non-maximum suppression in the graph")
    if wanted is not None and wanted is not family and not (wanted.is_yolox and family.is_yolox):
        found = f"{tuple(shape)}, which is {family.value}'s"
        raise InputError(path, f"an output of {wanted.value}", found, "leave the family to be found")
    count = family.class_count(shape)
    if count != names:
        found = f"{count} in its output {tuple(shape)}"
        raise InputError(path, f"{names} classes, one a name", found, "give the file of this network's class names")
    return wanted or family


def _text(size: Size) -> str:
    return f"{size[0]}x{size[1]}"
