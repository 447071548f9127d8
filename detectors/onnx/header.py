"""What an ONNX file says about its input, read from the file itself.

OpenCV does not tell a network's input shape, and both back ends report a broken file in their own way. The few
fields needed are found by walking the protobuf wire format (field numbers of onnx.proto: ModelProto, GraphProto,
ValueInfoProto, TypeProto, TensorShapeProto); weights are stepped over, not read.
"""

from __future__ import annotations

import ast
import mmap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...datasets.errors import InputError
from ..checks import checked_classes
from ..class_names import in_order

_ELEMENT_TYPES = {1: np.float32, 10: np.float16}
_REMEDY = "give a detector exported to ONNX"


@dataclass(frozen=True, slots=True)
class Header:
    """The image input of a network.

    Attributes:
        shape: (batch, channels, height, width); None where the model leaves a side open.
        dtype: what the input takes, float32 or float16.
        classes: names that the exporter stored in the model (Ultralytics does), or None.
    """

    shape: tuple[int | None, ...]
    dtype: type[np.floating]
    classes: tuple[str, ...] | None


def read_header(path: Path) -> Header:
    """The input of an ONNX file.

    Raises:
        InputError: for a missing file, one that is no ONNX, or one without an image input (N, 3, H, W).
    """
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file"
        raise InputError(path, "an ONNX model", found, "check the path")
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            model = list(_fields(content, 0, len(content)))
            graph = next((span for number, span in model if number == 7 and isinstance(span, tuple)), None)
            if graph is None:
                raise ValueError("no graph")
            inputs = [_value_info(content, span) for span in _all(content, graph, 11)]
            metadata = dict(_entry(content, span) for number, span in model if number == 14)
    except (ValueError, IndexError, TypeError) as error:
        found = f"a file of {path.stat().st_size} bytes that is not one ({error})"
        raise InputError(path, "an ONNX model", found, _REMEDY) from None
    for shape, element_type in inputs:
        if len(shape) == 4 and shape[1] in (3, None) and element_type in _ELEMENT_TYPES:
            return Header(shape, _ELEMENT_TYPES[element_type], _stored_classes(metadata.get("names")))
    found = ", ".join(str(list(shape)) for shape, _ in inputs) or "none"
    raise InputError(path, "a float input of shape (1, 3, height, width)", f"inputs {found}", _REMEDY)


Span = tuple[int, int]


def _fields(data: mmap.mmap, start: int, end: int) -> Iterator[tuple[int, Span | int]]:
    """(field number, varint value or (start, end) of the content) of one message."""
    while start < end:
        key, start = _varint(data, start)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, start = _varint(data, start)
            yield number, value
            continue
        if wire == 2:
            length, start = _varint(data, start)
        elif wire in (1, 5):
            length = 8 if wire == 1 else 4
        else:
            raise ValueError(f"wire type {wire}")
        if number == 0 or start + length > end:
            raise ValueError("a field runs past its message")
        yield number, (start, start + length)
        start += length


def _varint(data: mmap.mmap, start: int) -> tuple[int, int]:
    value = 0
    for i in range(10):
        byte = data[start + i]
        value |= (byte & 0x7F) << (7 * i)
        if byte < 0x80:
            return value, start + i + 1
    raise ValueError("a number of more than 10 bytes")


def _all(data: mmap.mmap, span: Span, number: int) -> list[Span]:
    return [value for found, value in _fields(data, *span) if found == number and isinstance(value, tuple)]


def _value_info(data: mmap.mmap, span: Span) -> tuple[tuple[int | None, ...], int]:
    """(shape, element type) of one input: ValueInfoProto.type (2) . tensor_type (1) . elem_type (1), shape (2)."""
    element_type, shape = 0, ()
    for type_span in _all(data, span, 2):
        for tensor in _all(data, type_span, 1):
            element_type = next((v for n, v in _fields(data, *tensor) if n == 1 and isinstance(v, int)), 0)
            dims = [dim for shape_span in _all(data, tensor, 2) for dim in _all(data, shape_span, 1)]
            shape = tuple(_dimension(data, dim) for dim in dims)
    return shape, element_type


def _dimension(data: mmap.mmap, span: Span) -> int | None:
    """A fixed side; None for a named, missing or negative (64-bit two's complement) one."""
    value = next((v for n, v in _fields(data, *span) if n == 1 and isinstance(v, int)), 0)
    return value if 0 < value < 1 << 31 else None


def _entry(data: mmap.mmap, span: Span | int) -> tuple[str, str]:
    """Key (1) and value (2) of a StringStringEntryProto."""
    if isinstance(span, int):
        raise ValueError("metadata is not text")
    texts = {n: data[slice(*v)].decode() for n, v in _fields(data, *span) if isinstance(v, tuple)}
    return texts.get(1, ""), texts.get(2, "")


def _stored_classes(names: str | None) -> tuple[str, ...] | None:
    """Ultralytics stores the text of a Python dict; anything else is taken as no names."""
    try:
        return checked_classes(in_order(ast.literal_eval(names or "")))
    except (ValueError, SyntaxError, TypeError):
        return None
