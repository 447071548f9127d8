"""Procedural things: sizes, closed and outward surfaces, variation within a class."""

from __future__ import annotations

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.synthetic.things.models import BUILDERS, CLASSES, CLUTTER, build_clutter, build_model
from thingmap.datasets.synthetic.things.objects import Model

SEEDS = range(10)
EXTENTS = {  # metres, smallest and largest of anything that is sold as such: longer side, height
    "bowl": ((0.12, 0.20), (0.04, 0.09)),
    "cap": ((0.21, 0.28), (0.09, 0.14)),
    "cereal box": ((0.15, 0.23), (0.21, 0.33)),
    "coffee mug": ((0.09, 0.15), (0.06, 0.115)),
    "soda can": ((0.055, 0.068), (0.11, 0.15)),
    "flashlight": ((0.035, 0.23), (0.03, 0.23)),
    "bottle": ((0.058, 0.09), (0.17, 0.32)),
}


@pytest.fixture(scope="module")
def models() -> dict[str, list[Model]]:
    return {label: [build_model(label, np.random.default_rng([5, k])) for k in SEEDS] for label in CLASSES}


def all_kinds() -> list[Model]:
    """A few of every class and of every clutter builder."""
    builders = [*BUILDERS.values(), *(builder for _, builder, _ in CLUTTER)]
    return [build(np.random.default_rng([6, k])) for build in builders for k in range(4)]


def corners(model: Model) -> np.ndarray:
    return np.concatenate([part.mesh.vertices for part in model.parts])


def test_every_thing_stands_centred_on_the_ground_with_textures_that_tile():
    for model in all_kinds():
        points = corners(model)
        np.testing.assert_allclose(np.ptp(points, axis=0), model.size, atol=1e-12)
        np.testing.assert_allclose((points.max(axis=0) + points.min(axis=0))[:2], 0.0, atol=1e-12)
        assert points[:, 2].min() == pytest.approx(0.0, abs=1e-12)
        assert model.size.min() > 0.01 and model.size.max() < 0.35
        for part in model.parts:
            sides = np.array(part.texture.shape[:2])
            assert part.texture.dtype == np.uint8 and part.texture.shape[2] == 3
            assert np.all(sides & (sides - 1) == 0) and sides.max() <= 1024
            assert part.mesh.triangles.max() < len(part.mesh.vertices)


def test_normals_are_unit_and_look_the_way_their_triangles_do():
    for model in all_kinds():
        for part in model.parts:
            mesh = part.mesh
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
            a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
            area = np.cross(b - a, c - a)
            solid = np.linalg.norm(area, axis=1) > 1e-10
            along = np.sum(area * mesh.normals[mesh.triangles].mean(axis=1), axis=1)[solid]
            assert np.mean(along > 0.0) > 0.99, (model.label, part.texture.shape)


def test_round_things_enclose_their_volume():
    """Outward triangles enclose a positive volume of about the body's (divergence theorem)."""
    for label, fill in (("soda can", (0.85, 1.0)), ("bottle", (0.4, 0.95)), ("cereal box", (0.999, 1.001))):
        for k in SEEDS:
            model = build_model(label, np.random.default_rng(k))
            volume = 0.0
            for part in model.parts:
                a, b, c = (part.mesh.vertices[part.mesh.triangles[:, i]] for i in range(3))
                volume += float(np.sum(a * np.cross(b, c)) / 6.0)
            cylinder = np.prod(model.size) * (1.0 if label == "cereal box" else np.pi / 4.0)
            assert fill[0] < volume / cylinder < fill[1], (label, k)


@pytest.mark.parametrize("label", CLASSES)
def test_sizes_are_those_of_the_class(label, models):
    (short, long), (low, high) = EXTENTS[label]
    for model in models[label]:
        assert model.label == label
        assert short < model.size[:2].max() < long and low < model.size[2] < high


@pytest.mark.parametrize("label", CLASSES)
def test_things_of_one_class_differ_in_size_and_look(label, models):
    sizes = np.array([model.size for model in models[label]])
    assert len(np.unique(np.round(sizes, 5), axis=0)) == len(SEEDS)
    looks = np.array([model.parts[0].texture.mean(axis=(0, 1)) for model in models[label]])
    apart = np.linalg.norm(looks[:, None] - looks[None], axis=2)[np.triu_indices(len(SEEDS), 1)]
    assert np.median(apart) > 30.0, "grey levels between the mean colours of two of a kind"


def test_the_same_chance_builds_the_same_thing():
    for label in CLASSES:
        one, two = (build_model(label, np.random.default_rng(3)) for _ in range(2))
        for a, b in zip(one.parts, two.parts, strict=True):
            np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
            np.testing.assert_array_equal(a.texture, b.texture)


def test_flashlights_lie_with_head_and_tail_on_the_ground_or_stand():
    standing = 0
    for k in range(30):
        model = build_model("flashlight", np.random.default_rng(k))
        if model.size[2] > model.size[0]:
            standing += 1
            continue
        points = corners(model)
        tail, head = points[points[:, 0] < 0.0], points[points[:, 0] > 0.0]
        assert tail[:, 2].min() < 5e-4 and head[:, 2].min() < 5e-4
        assert abs(np.ptp(head[:, 1]) - model.size[1]) < 1e-3, "the head is the wide end, towards +x"
    assert 3 <= standing <= 17


def test_clutter_is_of_no_class_and_of_every_kind():
    labels = [build_clutter(np.random.default_rng(k)).label for k in range(120)]
    assert set(labels) == {label for label, _, _ in CLUTTER}
    assert not set(labels) & set(CLASSES)
    assert labels.count("book") > labels.count("candle")


def test_labels_that_became_classes_are_no_clutter():
    labels = {build_clutter(np.random.default_rng(k), ["book", "box"]).label for k in range(60)}
    assert labels and not labels & {"book", "box"}
    with pytest.raises(UserError, match="leave something to be clutter"):
        build_clutter(np.random.default_rng(0), {label for label, _, _ in CLUTTER})


def test_labels_of_the_builders_are_the_registered_ones():
    for label, builder, _ in CLUTTER:
        assert builder(np.random.default_rng(0)).label == label
    assert sum(share for _, _, share in CLUTTER) == pytest.approx(1.0)
