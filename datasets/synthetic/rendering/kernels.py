"""The per-pixel loops of the renderer (numba).

Every other pixel sends one shadow ray. Within each tile of 6 x 6 pixels the eighteen rays go to nine points of either
lamp; a pixel then takes the share of clear rays among its neighbours on the same surface (interleaved sampling,
Keller and Heidrich, Rendering Techniques 2001). The kernels release the interpreter, so threads render side by side.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .casting import MISS
from .surfaces import LEVELS

f4 = np.float32  # mixing widths would carry the loops out in float64
TILE = 6  # pixels a side of the shadow pattern
LIFT = 1e-3  # metres a shadow ray starts above its surface
SAME_DEPTH = 0.02  # share of its depth by which a neighbour on the same surface may differ


@njit(cache=True, fastmath=True, nogil=True)
def resolve_hits(triangle, directions, eye, pixel_angle, s):
    """Depth, shading normal, cosine of incidence, albedo (linear RGB) and material of every hit."""
    n = triangle.size
    depth = np.zeros(n, np.float32)
    normal = np.zeros((n, 3), np.float32)
    incidence = np.zeros(n, np.float32)
    albedo = np.zeros((n, 3), np.float32)
    material = np.full(n, MISS, np.int32)
    corners, normals, uv, texels, start, size = s.corners, s.normals, s.uv, s.texels, s.level_start, s.level_size
    for k in range(n):
        t = triangle[k]
        if t == MISS:
            continue
        z, b, c, cosine = _intersect(corners, t, eye, directions[k, 0], directions[k, 1], directions[k, 2])
        a = f4(1.0) - b - c
        nx = a * normals[t, 0, 0] + b * normals[t, 1, 0] + c * normals[t, 2, 0]
        ny = a * normals[t, 0, 1] + b * normals[t, 1, 1] + c * normals[t, 2, 1]
        nz = a * normals[t, 0, 2] + b * normals[t, 1, 2] + c * normals[t, 2, 2]
        scale = (f4(-1.0) if cosine > 0.0 else f4(1.0)) / np.sqrt(nx * nx + ny * ny + nz * nz)  # a sheet from behind
        normal[k, 0], normal[k, 1], normal[k, 2] = scale * nx, scale * ny, scale * nz
        depth[k] = z
        incidence[k] = abs(cosine)
        material[k] = s.material[t]
        u = a * uv[t, 0, 0] + b * uv[t, 1, 0] + c * uv[t, 2, 0]
        v = a * uv[t, 0, 1] + b * uv[t, 1, 1] + c * uv[t, 2, 1]
        footprint = s.density[t] * f4(z * pixel_angle) / np.sqrt(max(abs(cosine), f4(0.02)))
        _sample(texels, start, size, material[k], u, v, footprint, albedo, k)
    return depth, normal, incidence, albedo, material


@njit(cache=True, fastmath=True, nogil=True)
def _intersect(corners, t, eye, dx, dy, dz):
    """Ray parameter, two barycentric weights and the cosine to the outward normal (Moeller and Trumbore 1997)."""
    px, py, pz = np.float64(corners[t, 0, 0]), np.float64(corners[t, 0, 1]), np.float64(corners[t, 0, 2])
    ax, ay, az = corners[t, 1, 0] - px, corners[t, 1, 1] - py, corners[t, 1, 2] - pz
    bx, by, bz = corners[t, 2, 0] - px, corners[t, 2, 1] - py, corners[t, 2, 2] - pz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    tx, ty, tz = px - eye[0], py - eye[1], pz - eye[2]
    slope = nx * dx + ny * dy + nz * dz
    cx, cy, cz = dy * tz - dz * ty, dz * tx - dx * tz, dx * ty - dy * tx
    one = 1.0 / slope
    first, second = -(bx * cx + by * cy + bz * cz) * one, (ax * cx + ay * cy + az * cz) * one
    cosine = slope / np.sqrt((nx * nx + ny * ny + nz * nz) * (dx * dx + dy * dy + dz * dz))
    return (nx * tx + ny * ty + nz * tz) * one, f4(first), f4(second), f4(cosine)


@njit(cache=True, fastmath=True, nogil=True)
def _sample(texels, start, size, material, u, v, footprint, out, k):
    """Texture look-up between four texels; `footprint` in texels of the finest level. Writes linear RGB to `out[k]`.

    Of the two nearest levels of the pyramid neighbouring pixels take one or the other, in the proportion a blend
    would have: half the work, and the lens blurs the difference away.
    """
    dither = f4((k * 159 & 255) / 256.0)
    level = np.int32(min(np.log2(max(footprint, f4(1.0))) + dither, f4(LEVELS - 1)))
    height, width = size[material, level, 0], size[material, level, 1]
    x = u * f4(width) - f4(0.5)
    y = (f4(1.0) - v) * f4(height) - f4(0.5)
    column, row = np.floor(x), np.floor(y)
    fx, fy = x - column, y - row
    left, right = np.int32(column) & (width - 1), np.int32(column + 1) & (width - 1)  # sizes are powers of two
    upper = start[material, level] + (np.int32(row) & (height - 1)) * width
    lower = start[material, level] + (np.int32(row + 1) & (height - 1)) * width
    for channel in range(3):
        top = texels[upper + left, channel] * (f4(1.0) - fx) + texels[upper + right, channel] * fx
        bottom = texels[lower + left, channel] * (f4(1.0) - fx) + texels[lower + right, channel] * fx
        value = (top + fy * (bottom - top)) / f4(255.0)
        out[k, channel] = value * value


@njit(cache=True, fastmath=True, nogil=True)
def room_of(x, walls):
    """Number of the room at world x; `walls` ascend, a point on one belongs to the room before it."""
    room = 0
    for wall in walls:
        if x > wall:
            room += 1
    return room


@njit(cache=True, fastmath=True, nogil=True)
def shadow_rays(directions, eye, depth, normal, lamps, walls, width):
    """A ray to a lamp from every other pixel, as on a chess board, row by row.

    Args:
        lamps: (2 R, P, 3) points on the lamps, a pair a room.
        walls: (R - 1,) world x between the rooms.

    Returns:
        Origins, directions to the lamp, reach (0 where the surface looks away), which lamp of its room (0 or 1).
    """
    n = depth.size // 2
    origins = np.zeros((n, 3), np.float32)
    to_lamp = np.ones((n, 3), np.float32)
    reach = np.zeros(n, np.float32)
    asked = np.zeros(n, np.uint8)
    for j in range(n):
        y = j // (width // 2)
        x = 2 * (j % (width // 2)) + (y & 1)
        k = y * width + x
        place = (y % TILE) * (TILE // 2) + (x % TILE) // 2
        lamp, point = place & 1, place >> 1
        asked[j] = lamp
        lit_by = 2 * room_of(eye[0] + depth[k] * directions[k, 0], walls) + lamp
        facing = f4(0.0)
        for axis in range(3):
            origins[j, axis] = eye[axis] + depth[k] * directions[k, axis] + LIFT * normal[k, axis]
            to_lamp[j, axis] = lamps[lit_by, point, axis] - origins[j, axis]
            facing += to_lamp[j, axis] * normal[k, axis]
        if facing > 0.0 and depth[k] > 0.0:
            reach[j] = 0.999
    return origins, to_lamp, reach, asked


@njit(cache=True, fastmath=True, nogil=True)
def light_pixels(
    material, directions, eye, depth, normal, albedo, asked, clear, open_near, lamps, powers, walls, sky, ambient, shine
):
    """Linear RGB that every pixel sends to the eye.

    Args:
        asked: (H, W / 2) uint8, which lamp of its room each shadow ray goes to.
        clear: (H, W / 2) bool, the ray reached it.
        open_near: (H, W / 2) uint8, 1 where all rays in the neighbourhood are clear.
        lamps, powers: (2 R, P, 3) and (2 R, 3), a pair a room; `walls` (R - 1,) world x between the rooms.
        ambient: (2,) float32, its share on an upright surface, and how much more it is on a level one.
    """
    n = material.size
    width = 2 * clear.shape[1]
    eye = eye.astype(np.float32)
    level, slope = ambient
    out = np.zeros((n, 3), np.float32)
    for k in range(n):
        if material[k] == MISS:
            continue
        from_above = level + slope * normal[k, 2]
        for channel in range(3):
            out[k, channel] = albedo[k, channel] * sky[channel] * from_above
        gloss, sharpness = shine[material[k], 0], shine[material[k], 1]
        shares = (f4(1.0), f4(1.0))
        if not open_near[k // width, k % width // 2]:
            shares = _lit_shares(k % width, k // width, material, depth, normal, asked, clear)
        pair = 2 * room_of(eye[0] + depth[k] * directions[k, 0], walls)
        for side in range(2):
            lamp = pair + side
            x, y, z = lamps[lamp, 0, 0], lamps[lamp, 0, 1], lamps[lamp, 0, 2]
            diffuse, highlight = _lamp_terms(k, directions, eye, depth[k], normal, x, y, z, gloss, sharpness)
            for channel in range(3):
                arriving = shares[side] * powers[lamp, channel]
                out[k, channel] += arriving * (albedo[k, channel] * diffuse + highlight)
    return out


@njit(cache=True, fastmath=True, nogil=True)
def _lit_shares(x, y, material, depth, normal, asked, clear):
    """Share of clear shadow rays to either lamp among the neighbours on the same surface."""
    height, half = clear.shape
    k = y * 2 * half + x
    near = SAME_DEPTH * depth[k]
    nx, ny, nz = normal[k, 0], normal[k, 1], normal[k, 2]
    count0 = count1 = clear0 = clear1 = 0
    for row in range(max(y - TILE // 2, 0), min(y + TILE // 2, height)):
        left = max(x - TILE // 2, 0)
        for column in range(left + (left + row) % 2, min(x + TILE // 2, 2 * half), 2):
            j = row * 2 * half + column
            if material[j] != material[k] or abs(depth[j] - depth[k]) > near:
                continue
            if normal[j, 0] * nx + normal[j, 1] * ny + normal[j, 2] * nz < 0.8:
                continue
            if asked[row, column // 2]:
                count1 += 1
                clear1 += clear[row, column // 2]
            else:
                count0 += 1
                clear0 += clear[row, column // 2]
    both = f4(clear0 + clear1) / f4(max(count0 + count1, 1))  # where no neighbour asked this lamp
    first = f4(clear0) / f4(count0) if count0 else both
    second = f4(clear1) / f4(count1) if count1 else both
    return first, second


@njit(cache=True, fastmath=True, nogil=True)
def _lamp_terms(k, directions, eye, z, normal, x, y, height, gloss, sharpness):
    """Diffuse and highlight (Blinn-Phong) light from a downward disc at (x, y, height), for unit power."""
    dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
    nx, ny, nz = normal[k, 0], normal[k, 1], normal[k, 2]
    lx, ly, lz = x - eye[0] - z * dx, y - eye[1] - z * dy, height - eye[2] - z * dz
    facing = nx * lx + ny * ly + nz * lz
    if facing <= 0.0 or lz <= 0.0:
        return f4(0.0), f4(0.0)
    near = f4(1.0) / np.sqrt(lx * lx + ly * ly + lz * lz)
    arriving = lz * near * near * near
    highlight = f4(0.0)
    if gloss > 0.0:
        away = f4(1.0) / np.sqrt(dx * dx + dy * dy + dz * dz)
        hx, hy, hz = near * lx - away * dx, near * ly - away * dy, near * lz - away * dz
        mirror = (nx * hx + ny * hy + nz * hz) / np.sqrt(hx * hx + hy * hy + hz * hz)
        if mirror > 0.75:  # below, the power is too small to see
            highlight = gloss * arriving * mirror**sharpness
    return arriving * facing * near, highlight
