"""Everything that is rendered, as flat tables a kernel can index by triangle."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from ..things.objects import Part

LEVELS = 11  # of a texture pyramid: 1024 texels down to one


class Surfaces(NamedTuple):
    """T triangles of M materials; a tuple of arrays, because numba takes it as it is.

    Attributes:
        corners: (T, 3, 3) float32 metres, world.
        normals: (T, 3, 3) float32, unit, at the corners.
        uv: (T, 3, 2) float32.
        density: (T,) float32 texels a metre on the surface.
        material: (T,) int32.
        owner: (T,) int32 number of the thing a triangle belongs to, -1 for the room.
        texels: (P, 3) uint8, all textures with their pyramids.
        level_start: (M, LEVELS) int64 first texel of a pyramid level.
        level_size: (M, LEVELS, 2) int32 height and width of it.
        shine: (M, 2) float32 gloss and sharpness.
    """

    corners: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    density: np.ndarray
    material: np.ndarray
    owner: np.ndarray
    texels: np.ndarray
    level_start: np.ndarray
    level_size: np.ndarray
    shine: np.ndarray


def assemble(parts: list[tuple[Part, int]]) -> Surfaces:
    """Tables of parts, each with the number of its owner."""
    meshes = [part.mesh for part, _ in parts]
    counts = [len(mesh.triangles) for mesh in meshes]
    corners = np.concatenate([m.vertices[m.triangles] for m in meshes]).astype(np.float32)
    normals = np.concatenate([m.normals[m.triangles] for m in meshes]).astype(np.float32)
    uv = np.concatenate([m.uv[m.triangles] for m in meshes]).astype(np.float32)
    material = np.repeat(np.arange(len(parts), dtype=np.int32), counts)
    owner = np.repeat(np.array([owner for _, owner in parts], dtype=np.int32), counts)
    texels, start, size = _pyramids([part.texture for part, _ in parts])
    shine = np.array([(part.gloss, part.sharpness) for part, _ in parts], dtype=np.float32)
    density = _density(corners, uv, size[material, 0])
    return Surfaces(corners, normals, uv, density, material, owner, texels, start, size, shine)


def _density(corners: np.ndarray, uv: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(T,) texels a metre: the root of the ratio of a triangle's areas on the texture and in the world."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.linalg.norm(np.cross(a, b), axis=1)
    p, q = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area_uv = np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) * size[:, 0] * size[:, 1]
    return np.sqrt(area_uv / np.maximum(area, 1e-12)).astype(np.float32)


def _pyramids(pictures: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All levels of all textures one after another; a picture used twice is stored once."""
    start = np.zeros((len(pictures), LEVELS), np.int64)
    size = np.ones((len(pictures), LEVELS, 2), np.int32)
    known: dict[int, int] = {}
    levels: list[np.ndarray] = []
    total = 0
    for k, picture in enumerate(pictures):
        if id(picture) in known:
            start[k], size[k] = start[known[id(picture)]], size[known[id(picture)]]
            continue
        known[id(picture)] = k
        level = picture
        for n in range(LEVELS):
            if n:
                half = (max(level.shape[1] // 2, 1), max(level.shape[0] // 2, 1))
                level = cv2.resize(level, half, interpolation=cv2.INTER_AREA)
            start[k, n], size[k, n] = total, level.shape[:2]
            levels.append(level.reshape(-1, 3))
            total += len(levels[-1])
    return np.concatenate(levels), start, size
