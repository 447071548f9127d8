"""Textures of scans: found, decoded, brought to the form of `textures.py`."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import cv2
import numpy as np

from ...errors import InputError

LARGEST_TEXTURE = 1024  # texels a side, as large as a pyramid of `surfaces` can be
NOT_WHOLE = "the file is damaged or incomplete; export it again"


def palette(colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One colour a triangle (T, 3): a texture with a texel for each that occurs, and (3 T, 2) coordinates."""
    different, number = np.unique(colours, axis=0, return_inverse=True)
    width = 1 << min(int(np.ceil(np.log2(len(different)))), 9)
    height = 1 << int(np.ceil(np.log2(np.ceil(len(different) / width))))
    texture = np.zeros((height * width, 3), np.uint8)
    texture[: len(different)] = different
    row, column = np.divmod(number.ravel(), width)
    uv = np.stack([(column + 0.5) / width, 1.0 - (row + 0.5) / height], axis=1)
    return texture.reshape(height, width, 3), np.repeat(uv, 3, axis=0)


def fitted(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 with sides brought to the nearest powers of two, at most `LARGEST_TEXTURE`."""
    height, width = (min(1 << max(round(np.log2(side)), 0), LARGEST_TEXTURE) for side in picture.shape[:2])
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


def decoded(data: bytes, path: Path, name: str) -> np.ndarray:
    """(H, W, 3) uint8 RGB of a compressed image."""
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    if picture is None:
        raise InputError(path, f"a readable texture in {name}", "something that is no image", NOT_WHOLE)
    return cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)


def named_textures(path: Path) -> dict[str, Path]:
    """Material name to texture file, as the material files of an OBJ tell."""
    named: dict[str, Path] = {}
    libraries = [value for key, value in map(_statement, _lines(path)) if key == "mtllib"]
    for library in libraries:
        file, material = path.parent / library, ""
        if not file.is_file():
            raise InputError(path, f"its material file {library} beside it", "none", "copy it there")
        for line in _lines(file):
            key, value = _statement(line)
            if key == "newmtl":
                material = value
            elif key == "map_kd":
                words = value.split()
                texture = file.parent / (words[-1] if words and words[0].startswith("-") else value)
                if not texture.is_file():
                    raise InputError(file, f"the texture {texture.name} beside it", "none", "copy it there")
                named[material] = texture
    return named


def _lines(file: Path) -> list[str]:
    return file.read_text(encoding="utf-8", errors="replace").splitlines()


def _statement(line: str) -> tuple[str, str]:
    """Keyword, in lower case, and the rest of the line; blanks or tabs part them."""
    key, *rest = line.split(None, 1) or [""]
    return key.lower(), rest[0].strip() if rest else ""


def check_images(path: Path) -> None:
    """Refuse a GLB with an image inside that cannot be read: the mesh reader would leave it out without a word."""
    data = path.read_bytes()
    try:
        length = struct.unpack_from("<I", data, 12)[0]
        header = json.loads(data[20 : 20 + length])
        start = 20 + length + 8  # of the binary chunk
        for image in header.get("images", []):
            if "bufferView" in image:
                view = header["bufferViews"][image["bufferView"]]
                first = start + view.get("byteOffset", 0)
                decoded(data[first : first + view["byteLength"]], path, image.get("name", "its image"))
    except (struct.error, ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise InputError(path, "a binary glTF file", f"something else ({error})", NOT_WHOLE) from None
