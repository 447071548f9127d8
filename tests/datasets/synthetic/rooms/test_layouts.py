"""Rooms: what they offer for things to stand on, and that nothing is in the way there."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.synthetic.config import Preset
from thingmap.datasets.synthetic.rendering.casting import MISS, Caster
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.rooms.furniture import Piece, table
from thingmap.datasets.synthetic.rooms.layout import Layout, Support, SupportKind
from thingmap.datasets.synthetic.rooms.layouts import build_layout
from thingmap.datasets.synthetic.rooms.room import room

UP = np.array([0.0, 0.0, 1.0])
TALLEST = 0.55  # metres; nothing that stands about is taller
PITCH = 0.02  # metres between probes


@pytest.fixture(scope="module", params=[(preset, seed) for preset in Preset for seed in (0, 7)], ids=str)
def layout(request) -> Layout:
    preset, seed = request.param
    return build_layout(preset, np.random.default_rng(seed))


def corners_of(layout: Layout) -> np.ndarray:
    return assemble([(part, -1) for part in layout.parts]).corners


def probes(support: Support) -> np.ndarray:
    """(N, 3) points on a support, edges included."""
    x, y = (np.linspace(-extent / 2, extent / 2, int(extent / PITCH) + 2) for extent in support.size)
    flat = support.to_world(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    return np.column_stack([flat, np.full(len(flat), support.height)])


def hits(corners: np.ndarray, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N,) metres to what rays along one direction hit; infinite where they hit nothing."""
    directions = np.broadcast_to(direction, origins.shape).astype(np.float32).copy()
    number = Caster(corners).first_hit(origins.astype(np.float32), directions)
    a, b, c = (corners[number, k].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.sum(normal * (a - origins), axis=1) / (normal @ np.asarray(direction, float))
    return np.where(number == MISS, np.inf, distance)


def test_supports_are_surfaces_with_nothing_on_them(layout):
    corners = corners_of(layout)
    for support in layout.supports:
        above = min(support.headroom, TALLEST) - 0.005
        down = hits(corners, probes(support) + above * UP, -UP)
        np.testing.assert_allclose(down, above, atol=1e-4, err_msg=str(support))


def test_headroom_is_free(layout):
    corners = corners_of(layout)
    for support in layout.supports:
        up = hits(corners, probes(support) + 1e-3 * UP, UP) + 1e-3
        assert up.min() >= min(support.headroom, TALLEST) - 1e-4, support
        if support.kind is SupportKind.SHELF and support.headroom < 1.0:
            assert up.min() < support.headroom + 0.1, f"{support} has more room above than it says"


def test_nothing_upright_crosses_the_space_above_supports(layout):
    """Rays from side to side, which meet thin posts that rays from above pass by."""
    caster = Caster(corners_of(layout))
    for support in layout.supports:
        levels = support.height + np.linspace(0.01, min(support.headroom, TALLEST) - 0.01, 8)
        for axis in (0, 1):
            half, other = np.array(support.size)[[axis, 1 - axis]] / 2
            along = np.zeros((2 * int(other / PITCH) + 3, 2))
            along[:, 1 - axis] = np.linspace(-other, other, len(along))
            along[:, axis] = -half
            start = support.to_world(along)
            along[:, axis] = half
            step = np.column_stack([support.to_world(along) - start, np.zeros(len(start))])
            for level in levels:
                origins = np.column_stack([start, np.full(len(start), level)])
                blocked = caster.blocked(
                    origins.astype(np.float32), step.astype(np.float32), np.ones(len(start), np.float32)
                )
                assert not blocked.any(), f"{support} at {level:.2f} m"


def test_supports_do_not_overlap(layout):
    """No probe of one lies within another at the same height."""
    for k, support in enumerate(layout.supports):
        for other in layout.supports[:k]:
            if abs(other.height - support.height) > TALLEST:
                continue
            c, s = np.cos(other.yaw), np.sin(other.yaw)
            local = (probes(support)[:, :2] - other.centre) @ np.array([[c, -s], [s, c]])
            inside = np.all(np.abs(local) < np.array(other.size) / 2, axis=1)
            apart = abs(other.height - support.height)
            lower = support if support.height < other.height else other
            assert not inside.any() or (apart > 0.0 and lower.headroom <= apart), (support, other)


@pytest.mark.parametrize(
    ("preset", "things"), [(Preset.TABLETOP, 36), (Preset.SURVEY, 36), (Preset.KITCHEN, 72), (Preset.LAPS, 72)]
)
def test_there_is_room_for_the_things_of_a_preset(preset, things):
    """Squares of 0.15 m, each with a clear margin, laid out in rows."""
    supports = build_layout(preset, np.random.default_rng(0)).supports
    assert sum(int(s.size[0] / 0.19) * int(s.size[1] / 0.19) for s in supports) >= things
    assert all(s.headroom > 0.27 for s in supports)


def test_all_kinds_of_supports_occur_and_heights_differ():
    for preset in (Preset.KITCHEN, Preset.LAPS):
        assert {s.kind for s in build_layout(preset, np.random.default_rng(0)).supports} == set(SupportKind)
    for preset in (Preset.TABLETOP, Preset.SURVEY):
        supports = build_layout(preset, np.random.default_rng(0)).supports
        assert supports[0].kind is SupportKind.TABLE
        assert len({round(s.height, 1) for s in supports}) >= 3


def test_layouts_depend_on_the_seed_only():
    for preset in Preset:
        first, again, other = (build_layout(preset, np.random.default_rng(seed)) for seed in (3, 3, 4))
        assert len(first.parts) == len(again.parts)
        for a, b in zip(first.parts, again.parts, strict=True):
            np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
            np.testing.assert_array_equal(a.texture, b.texture)
        assert first.supports == again.supports and first.lights == again.lights
        same = [np.array_equal(a.texture, b.texture) for a, b in zip(first.parts, other.parts, strict=True)]
        assert np.mean(same) < 0.1


def test_nothing_can_stand_before_the_printed_wall():
    assert build_layout(Preset.WALL, np.random.default_rng(0)).supports == ()


def test_textures_can_be_tiled_and_meshes_are_sound(layout):
    for part in layout.parts:
        assert part.texture.dtype == np.uint8
        assert all(side & (side - 1) == 0 for side in part.texture.shape[:2]), "sides are powers of two"
        np.testing.assert_allclose(np.linalg.norm(part.mesh.normals, axis=1), 1.0, atol=1e-6)
        assert np.isfinite(part.mesh.uv).all() and part.mesh.triangles.max() < len(part.mesh.vertices)


def test_the_tabletop_has_the_sample_s_room():
    parts = build_layout(Preset.TABLETOP, np.random.default_rng(2)).parts
    for mine, sample in zip(parts, room(np.random.default_rng(2)), strict=False):
        np.testing.assert_array_equal(mine.mesh.vertices, sample.mesh.vertices)
        np.testing.assert_array_equal(mine.texture, sample.texture)


def test_a_piece_keeps_its_supports_on_its_surfaces():
    grey = np.full((4, 4, 3), 128, np.uint8)
    piece: Piece = table(grey, grey, (1.2, 0.6), 0.7).placed(2.0, -1.0, 0.6, 0.1)
    (support,) = piece.supports
    assert support.height == pytest.approx(0.8)
    corners = assemble([(part, -1) for part in piece.parts]).corners
    np.testing.assert_allclose(hits(corners, probes(support) + UP, -UP), 1.0, atol=1e-5)
    assert piece.under(0.3).supports[0].headroom == 0.3
