"""The container of a glTF 2.0 file: arrays become accessors of one buffer, and both become a `.glb` or a `.gltf`."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np

COMPONENTS = {"f4": 5126, "u2": 5123, "u4": 5125}  # glTF 2.0, section 3.6.2.2
SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
ALIGNMENT = 4  # bytes
GLB_MAGIC, GLB_VERSION = 0x46546C67, 2
CHUNK_JSON, CHUNK_BINARY = 0x4E4F534A, 0x004E4942


class GltfBuffers:
    """The one buffer of a file, filled array by array."""

    def __init__(self) -> None:
        self._content = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def add(self, values: np.ndarray, *, normalized: bool = False, bounds: bool = False) -> int:
        """The number of the accessor of a float32, uint16 or uint32 array, (N,), (N, 3) or (N, 4).

        Args:
            values: at least one row.
            normalized: integers stand for numbers in [0, 1].
            bounds: say the least and the largest values, as positions need.
        """
        little = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        self._views.append({"buffer": 0, "byteOffset": len(self._content), "byteLength": little.nbytes})
        self._content += little.tobytes()
        self._content += bytes(-len(self._content) % ALIGNMENT)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": COMPONENTS[values.dtype.str[1:]],
            "count": len(values),
            "type": SHAPES[1 if values.ndim == 1 else values.shape[1]],
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": little.min(axis=0).tolist(), "max": little.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def to_glb(self, document: dict[str, Any]) -> bytes:
        """The document and the buffer in one binary file."""
        text = _json(self._complete(document, {}))
        chunks = [(CHUNK_JSON, text + b" " * (-len(text) % ALIGNMENT))]
        if self._content:
            chunks.append((CHUNK_BINARY, bytes(self._content)))
        body = b"".join(struct.pack("<II", len(content), kind) + content for kind, content in chunks)
        return struct.pack("<III", GLB_MAGIC, GLB_VERSION, 12 + len(body)) + body

    def to_gltf(self, document: dict[str, Any]) -> bytes:
        """The document as JSON with the buffer in it."""
        data = base64.b64encode(self._content).decode()
        return _json(self._complete(document, {"uri": f"data:application/octet-stream;base64,{data}"}))

    def _complete(self, document: dict[str, Any], where: dict[str, str]) -> dict[str, Any]:
        if not self._content:  # glTF allows no empty lists
            return document
        buffer = {**where, "byteLength": len(self._content)}
        return {**document, "accessors": self._accessors, "bufferViews": self._views, "buffers": [buffer]}


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
