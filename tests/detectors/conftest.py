"""Frames without a camera, and ONNX files written by hand: the `onnx` package is not needed to make a small one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Detections


@pytest.fixture
def make_frame() -> Callable[..., Frame]:
    """A frame of one colour."""

    def make(name: str = "frame-000000", index: int = 0, size: tuple[int, int] = (64, 48), rgb=(0, 0, 0)) -> Frame:
        width, height = size
        color = np.full((height, width, 3), rgb, dtype=np.uint8)
        intrinsics = Intrinsics(width, height, 50.0, 50.0, width / 2, height / 2)
        return Frame(index, name, float(index), color, np.zeros((height, width), np.float32), intrinsics)

    return make


@pytest.fixture(scope="session")
def assert_same() -> Callable[[Detections, Detections], None]:
    """Every array equal to the bit, NaN included."""

    def check(a: Detections, b: Detections) -> None:
        assert a.classes == b.classes
        for name in ("xyxy", "scores", "part", "mask", "embedding"):
            x, y = getattr(a, name), getattr(b, name)
            assert (x is None) == (y is None), name
            if x is not None:
                assert x.dtype == y.dtype and x.shape == y.shape, name
                np.testing.assert_array_equal(x, y, err_msg=name)

    return check


_ELEMENT_TYPES = {"float32": 1, "int64": 7, "float16": 10}


def _varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _message(*fields: tuple[int, int | str | bytes]) -> bytes:
    """A protobuf message of (field number, value)."""
    out = b""
    for number, value in fields:
        if isinstance(value, int):
            out += _varint(number << 3) + _varint(value)
        else:
            content = value.encode() if isinstance(value, str) else value
            out += _varint(number << 3 | 2) + _varint(len(content)) + content
    return out


def _tensor(name: str, array: np.ndarray) -> bytes:
    kind = _ELEMENT_TYPES[array.dtype.name]
    return _message(*((1, n) for n in array.shape), (2, kind), (8, name), (9, array.tobytes()))


def _value_info(name: str, shape: tuple[int | str, ...], dtype: str) -> bytes:
    dims = [(1, _message((1, side) if isinstance(side, int) else (2, side))) for side in shape]
    return _message((1, name), (2, _message((1, _message((1, _ELEMENT_TYPES[dtype]), (2, _message(*dims)))))))


def _node(kind: str, inputs: list[str], output: str) -> bytes:
    return _message(*((1, name) for name in inputs), (2, output), (3, output), (4, kind))


def tiny_onnx(
    constant: np.ndarray,
    by_color: np.ndarray | None = None,
    input_shape: tuple[int | str, ...] = (1, 3, 64, 64),
    metadata: dict[str, str] | None = None,
    dtype: str = "float32",
) -> bytes:
    """A network whose output is `constant`, plus, where `by_color` is given, its product with the mean colour.

    Args:
        constant: (1, a, b) float32, the output for a black input.
        by_color: (a, 3) if the rows are the features, or (b, 3) if the columns are, what each of the three input
            channels' means adds to a feature.
    """
    rows, columns = constant.shape[1:]
    by_color = np.zeros((rows, 3)) if by_color is None else by_color
    along_rows = len(by_color) == rows
    broadcast = (1, rows, 1) if along_rows else (1, 1, columns)
    weights = by_color.astype(dtype).reshape(-1, 3, 1, 1)
    graph = _message(
        (1, _node("GlobalAveragePool", ["images"], "mean")),
        (1, _node("Conv", ["mean", "weights"], "features")),
        (1, _node("Reshape", ["features", "broadcast"], "column")),
        (1, _node("Add", ["column", "constant"], "output")),
        (2, "tiny"),
        (5, _tensor("weights", weights)),
        (5, _tensor("broadcast", np.array(broadcast, dtype=np.int64))),
        (5, _tensor("constant", constant.astype(dtype))),
        (11, _value_info("images", input_shape, dtype)),
        (12, _value_info("output", constant.shape, dtype)),
    )
    entries = [(14, _message((1, key), (2, value))) for key, value in (metadata or {}).items()]
    return _message((1, 8), (7, graph), (8, _message((1, ""), (2, 13))), *entries)


@pytest.fixture
def write_onnx(tmp_path: Path) -> Callable[..., Path]:
    """`tiny_onnx` as a file."""

    def write(*args, name: str = "tiny.onnx", **kwargs) -> Path:
        path = tmp_path / name
        path.write_bytes(tiny_onnx(*args, **kwargs))
        return path

    return write
