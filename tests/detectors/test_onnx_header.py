"""What is read from the ONNX file itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.datasets.errors import InputError
from thingmap.detectors.onnx.header import read_header

OUTPUT = np.zeros((1, 6, 84))


def test_fixed_input(write_onnx):
    header = read_header(write_onnx(OUTPUT, input_shape=(1, 3, 64, 96)))
    assert header.shape == (1, 3, 64, 96) and header.dtype is np.float32 and header.classes is None


def test_open_input_and_half_precision(write_onnx):
    header = read_header(write_onnx(OUTPUT, input_shape=("batch", 3, "height", 0), dtype="float16"))
    assert header.shape == (None, 3, None, None) and header.dtype is np.float16


@pytest.mark.parametrize(
    ("text", "classes"),
    [
        ("{0: 'cup', 1: 'wine glass'}", ("cup", "wine glass")),
        ("{1: 'cup', 2: 'wine glass'}", None),
        ("{0: 'cup', 1: 'cup'}", None),
        ("__import__('os')", None),
        ("{0:", None),
    ],
)
def test_names_stored_by_the_exporter(write_onnx, text: str, classes: tuple | None):
    assert read_header(write_onnx(OUTPUT, metadata={"task": "detect", "names": text})).classes == classes


def test_an_input_that_is_no_image(write_onnx):
    with pytest.raises(InputError, match=r"float input of shape \(1, 3, height, width\), found inputs \[1, 80\]"):
        read_header(write_onnx(OUTPUT, input_shape=(1, 80)))


@pytest.mark.parametrize("content", [b"", b"hello world", b"\x89PNG\r\n\x1a\n" + bytes(50), b"\xff" * 100, b"\x08\x08"])
def test_files_that_are_no_onnx(tmp_path: Path, content: bytes):
    path = tmp_path / "a.onnx"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"expected an ONNX model, found a file of {len(content)} bytes"):
        read_header(path)


def test_no_file(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_header(tmp_path / "a.onnx")
    with pytest.raises(InputError, match="a folder"):
        read_header(tmp_path)


@given(st.binary(max_size=200))
def test_whatever_the_bytes_there_is_no_other_error(tmp_path_factory, content: bytes):
    path = tmp_path_factory.mktemp("bytes") / "a.onnx"
    path.write_bytes(content)
    with pytest.raises(InputError):
        read_header(path)


def test_a_cut_off_file(write_onnx):
    path = write_onnx(OUTPUT)
    whole = path.read_bytes()
    for length in range(0, len(whole) - 10, 37):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError):
            read_header(path)
