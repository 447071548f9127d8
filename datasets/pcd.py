"""Points of a PCD file, the format of the Point Cloud Library (version 0.7): ascii, binary or binary_compressed.

A header of text rows says which FIELDS a point has, of what SIZE (bytes), TYPE (F, I, U) and COUNT. `binary` holds the
points one after the other; `binary_compressed` two uint32, the compressed and the plain size, and then all values of
the first field, all of the second and so on, compressed by LZF. That is a row of literal runs (a byte c < 32, then
c + 1 bytes) and copies of what was written before (a byte of 3 bits length - 2 and 5 bits distance - 1; where the 3
bits are all set a byte to be added to the length follows; then the low byte of the distance).

VIEWPOINT says from where the points were taken and is not applied: points are as stored.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit

_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_MAX_BYTES = 1 << 30  # of one scan; a damaged header must not fill the memory


class BadPcd(ValueError):
    """The file is no PCD file, or is damaged; the message says how."""


def read_pcd(path: Path) -> dict[str, np.ndarray]:
    """Field name to (N,) values, or (N, COUNT) where a field has several; padding (`_`) is left out.

    Raises:
        BadPcd: the content is not as the header says, or the header not as the format wants it.
        OSError: the file cannot be read.
    """
    header, body = _split(path.read_bytes())
    names, dtype = _layout(header)
    number = header["POINTS"] if "POINTS" in header else [str(_int(header, "WIDTH") * _int(header, "HEIGHT"))]
    count = _int({"POINTS": number}, "POINTS")
    if count < 0 or count * dtype.itemsize > _MAX_BYTES:
        raise BadPcd(f"{count} points of {dtype.itemsize} bytes are said to be in it")
    kind = header["DATA"][0] if header.get("DATA") else ""
    if kind == "ascii":
        columns = _ascii(body, count, dtype)
    elif kind == "binary":
        if len(body) < count * dtype.itemsize:
            raise BadPcd(f"{len(body)} bytes of points, {count * dtype.itemsize} expected")
        table = np.frombuffer(body, dtype=dtype, count=count)
        columns = [table[name] for name in dtype.names or ()]
    elif kind == "binary_compressed":
        columns = _columns(_decompress(body, count * dtype.itemsize), count, dtype)
    else:
        raise BadPcd(f"DATA is {kind!r}, not ascii, binary or binary_compressed")
    return {name: column for name, column in zip(names, columns, strict=True) if name != "_"}


def _split(data: bytes) -> tuple[dict[str, list[str]], bytes]:
    """Header rows by their first word, and what follows the row DATA."""
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = data.find(b"\n", start)
        if end < 0:
            raise BadPcd("the header has no row DATA")
        words = data[start:end].decode("ascii", errors="replace").split()
        start = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _KEYS:
            raise BadPcd(f"{words[0][:20]!r} in the header, which is no keyword of PCD")
        header[words[0]] = words[1:]
    return header, data[start:]


def _layout(header: dict[str, list[str]]) -> tuple[list[str], np.dtype]:
    """Names as in the file, and the memory of a point; fields are numbered there, as padding may share a name."""
    names, sizes, types = (header.get(key, []) for key in ("FIELDS", "SIZE", "TYPE"))
    counts = header.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(types) == len(counts):
        raise BadPcd("FIELDS, SIZE, TYPE and COUNT do not have one entry a field")
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for i, (size, kind, count) in enumerate(zip(sizes, types, counts, strict=True)):
        if not (size.isdecimal() and count.isdecimal() and int(count) > 0 and int(size) in _SIZES.get(kind, ())):
            raise BadPcd(f"field {names[i]} has SIZE {size}, TYPE {kind}, COUNT {count}")
        fields.append((str(i), f"<{_KINDS[kind]}{size}", () if count == "1" else (int(count),)))
    return names, np.dtype(fields)


def _int(header: dict[str, list[str]], key: str) -> int:
    words = header.get(key, [])
    if len(words) != 1 or not words[0].isdecimal():
        raise BadPcd(f"{key} is {' '.join(words) or 'missing'}, not a number of points")
    return int(words[0])


def _ascii(body: bytes, count: int, dtype: np.dtype) -> list[np.ndarray]:
    fields = [dtype[name] for name in dtype.names or ()]
    widths = [int(np.prod(field.shape, dtype=int)) for field in fields]
    try:
        values = np.array(body.split(), dtype=np.float64)
    except ValueError as error:
        raise BadPcd(str(error)) from None
    if len(values) != count * sum(widths):
        raise BadPcd(f"{len(values)} numbers, {count * sum(widths)} expected")
    blocks = np.split(values.reshape(count, sum(widths)), np.cumsum(widths)[:-1], axis=1)
    return [block.reshape(count, *field.shape).astype(field.base) for block, field in zip(blocks, fields, strict=True)]


def _columns(plain: np.ndarray, count: int, dtype: np.dtype) -> list[np.ndarray]:
    columns, start = [], 0
    for name in dtype.names or ():
        field = dtype[name]
        end = start + count * field.itemsize
        columns.append(plain[start:end].view(field.base).reshape(count, *field.shape))
        start = end
    return columns


def _decompress(body: bytes, expected: int) -> np.ndarray:
    """(expected,) uint8."""
    packed, plain = (int(size) for size in np.frombuffer(body[:8].ljust(8, b"\0"), dtype="<u4"))
    if plain != expected or len(body) - 8 < packed:
        raise BadPcd(f"{len(body) - 8} of {packed} compressed bytes for {plain}, {expected} expected")
    result = np.zeros(expected, dtype=np.uint8)
    if _unpack(np.frombuffer(body, dtype=np.uint8, count=packed, offset=8), result) != expected:
        raise BadPcd("the compressed points are damaged")
    return result


@njit(cache=True)
def _unpack(source, target):
    """LZF: the number of bytes written, or -1 where the source says what cannot be."""
    i, o, n, room = 0, 0, len(source), len(target)
    while i < n:
        control = int(source[i])
        i += 1
        if control < 32:
            length = control + 1
            if i + length > n or o + length > room:
                return -1
            for _ in range(length):
                target[o] = source[i]
                i += 1
                o += 1
            continue
        length = (control >> 5) + 2
        if length == 9:
            if i >= n:
                return -1
            length += int(source[i])
            i += 1
        if i >= n:
            return -1
        start = o - (((control & 31) << 8) | int(source[i])) - 1
        i += 1
        if start < 0 or o + length > room:
            return -1
        for k in range(length):  # byte by byte: a copy may run into what it writes
            target[o + k] = target[start + k]
        o += length
    return o
