"""Imported meshes: files written here with known shapes, colours and mistakes."""

from __future__ import annotations

import builtins
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from thingmap.datasets.errors import InputError, UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.synthetic.motion.orbit import look_at
from thingmap.datasets.synthetic.rendering.render import Renderer
from thingmap.datasets.synthetic.rendering.surfaces import assemble
from thingmap.datasets.synthetic.things.models import CLASSES
from thingmap.datasets.synthetic.things.objects import Model, Part
from thingmap.datasets.synthetic.things.scan_files import read_scan
from thingmap.datasets.synthetic.things.scan_normals import corner_normals
from thingmap.datasets.synthetic.things.scan_textures import palette
from thingmap.datasets.synthetic.things.scans import ALIASES, load_scans
from thingmap.factors.size_prior import BUILT_IN
from thingmap.factors.size_table import read_size_table

RED, GREEN, BLUE, WHITE = (250, 10, 10), (10, 250, 10), (10, 10, 250), (250, 250, 250)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])  # texture coordinates, counter-clockwise


def picture(size: tuple[int, int] = (32, 32)) -> np.ndarray:
    """RGB quarters: red and green above, blue and white below."""
    height, width = size
    image = np.empty((height, width, 3), np.uint8)
    image[: height // 2, : width // 2], image[: height // 2, width // 2 :] = RED, GREEN
    image[height // 2 :, : width // 2], image[height // 2 :, width // 2 :] = BLUE, WHITE
    return image


def upright_sheet(width: float = 0.2, height: float = 0.1) -> np.ndarray:
    """Corners of a sheet that looks towards -y, z up, off the origin."""
    return SQUARE[:, [0, 0, 1]] * (width, 0.0, height) + (3.0, 2.0, 1.0)


def write_obj(file: Path, points: np.ndarray | None = None, image: np.ndarray | None = None) -> Path:
    """A textured sheet with its material file and picture beside it."""
    points = upright_sheet() if points is None else points
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file.with_suffix(".png")), (picture() if image is None else image)[..., ::-1])
    file.with_suffix(".mtl").write_text(f"newmtl skin\nKd 0.1 0.1 0.1\nmap_Kd {file.stem}.png\n")
    lines = [f"mtllib {file.stem}.mtl", *(f"v {x} {y} {z}" for x, y, z in points)]
    lines += [*(f"vt {u} {v}" for u, v in SQUARE), "usemtl skin", "f 1/1 2/2 3/3", "f 1/1 3/3 4/4"]
    file.write_text("\n".join(lines) + "\n")
    return file


def write_glb(file: Path, factor: tuple[float, float, float, float] | None = None) -> Path:
    """The same sheet as a GLB, which is y up, placed by a node."""
    points = upright_sheet() - (3.0, 2.0, 1.0)
    y_up = points[:, [0, 2, 1]] * (1.0, 1.0, -1.0)
    material = PBRMaterial(name="skin", baseColorTexture=Image.fromarray(picture()), baseColorFactor=factor)
    visual = TextureVisuals(uv=SQUARE, material=material)
    mesh = trimesh.Trimesh(y_up, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix((5.0, 6.0, 7.0)))
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(scene.export(file_type="glb"))
    return file


def seen(model: Model) -> np.ndarray:
    """(2, 2, 3) mean radiance of the quarters of the sheet, seen from the front."""
    camera = Intrinsics(160, 120, 200.0, 200.0, 79.5, 59.5)
    pose = look_at(np.array([[0.0, -0.25, 0.05]]), np.array([[0.0, 0.0, 0.05]]), np.zeros(1))[0]
    renderer = Renderer(assemble([(part, 0) for part in model.parts]))
    cast = renderer.cast(camera, pose)
    light = renderer.render(camera, pose, cast).radiance
    rows, columns = (slice(30, 50), slice(70, 90)), (slice(20, 60), slice(100, 140))
    return np.array([[light[row, column].mean(axis=(0, 1)) for column in columns] for row in rows])


@pytest.mark.parametrize("write", [write_obj, write_glb])
def test_a_sheet_stands_centred_with_its_picture_upright(tmp_path, write):
    write(tmp_path / f"sheet.{'obj' if write is write_obj else 'glb'}")
    (model,) = load_scans(tmp_path)
    np.testing.assert_allclose(model.size, (0.2, 0.0, 0.1), atol=1e-6)
    points = np.concatenate([part.mesh.vertices for part in model.parts])
    np.testing.assert_allclose(points.min(axis=0), (-0.1, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(model.parts[0].mesh.normals, np.tile((0.0, -1.0, 0.0), (6, 1)), atol=1e-6)
    light = seen(model)
    assert np.argmax(light[0, 0]) == 0 and np.argmax(light[0, 1]) == 1 and np.argmax(light[1, 0]) == 2
    assert light[1, 1].min() > 0.8 * light[1, 1].max() > 0.0


def test_names_become_classes(tmp_path):
    for name in ("025_mug/google_16k/textured", "065-a_tea_box/textured", "soup", "cups/flask1", "cups/flask2"):
        write_obj(tmp_path / f"{name}.obj")
    labels = [model.label for model in load_scans(tmp_path)]
    assert labels == ["coffee mug", "tea box", "flask1", "flask2", "soup"]
    (tmp_path / "labels.json").write_text(json.dumps({"025_mug": "cup", "flask2": "bottle"}))
    assert [model.label for model in load_scans(tmp_path)] == ["cup", "tea box", "flask1", "bottle", "soup"]


def test_aliases_are_those_of_the_size_table():
    table = read_size_table(BUILT_IN)
    for alias, label in ALIASES.items():
        assert label in CLASSES and alias in table[label].aliases


def test_textures_get_sides_that_are_powers_of_two(tmp_path):
    write_obj(tmp_path / "big.obj", image=picture((1500, 3000)))
    write_obj(tmp_path / "odd.obj", image=picture((100, 70)))
    shapes = [model.parts[0].texture.shape for model in load_scans(tmp_path)]
    assert shapes == [(1024, 1024, 3), (128, 64, 3)]


def test_tabs_part_the_words_of_material_files(tmp_path):
    file = write_obj(tmp_path / "cup.obj")
    file.write_text(file.read_text().replace("mtllib ", "mtllib\t"))
    file.with_suffix(".mtl").write_text("newmtl\tskin\n\tKd\t0.1 0.1 0.1\n\tmap_Kd\tcup.png\n")
    (model,) = load_scans(tmp_path)
    assert model.parts[0].texture.shape == (32, 32, 3) and model.parts[0].texture[0, 0].tolist() == list(RED)


def test_a_gltf_factor_darkens_its_texture(tmp_path):
    write_glb(tmp_path / "plain.glb")
    write_glb(tmp_path / "tinted.glb", factor=(0.25, 1.0, 1.0, 1.0))
    plain, tinted = (model.parts[0].texture for model in load_scans(tmp_path))
    assert abs(int(plain[0, 0, 0]) - 250) <= 1
    assert abs(int(tinted[0, 0, 0]) - 125) <= 2, "a quarter of the light is half the display value"
    assert tinted[-1, 0, 2] == plain[-1, 0, 2]


def test_vertex_and_material_colours_stand_in_where_there_is_no_texture(tmp_path):
    points = upright_sheet()
    lines = [f"v {x} {y} {z} 1 0 0" for x, y, z in points] + ["f 1 2 3", "f 1 3 4"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    (tmp_path / "b.mtl").write_text("newmtl paint\nKd 0 0 1\n")
    lines = ["mtllib b.mtl", *(f"v {x} {y} {z}" for x, y, z in points), "usemtl paint", "f 1 2 3", "f 1 3 4"]
    (tmp_path / "b.obj").write_text("\n".join(lines))
    red, blue = load_scans(tmp_path)
    assert red.parts[0].texture.reshape(-1, 3).tolist() == [[255, 0, 0]]
    assert blue.parts[0].texture.reshape(-1, 3).tolist() == [[0, 0, 255]]


def test_a_palette_gives_every_triangle_its_colour():
    colours = np.random.default_rng(0).integers(0, 256, (1300, 3), dtype=np.uint8)
    texture, uv = palette(colours)
    height, width = texture.shape[:2]
    assert height & (height - 1) == 0 and width & (width - 1) == 0
    column, row = np.floor(uv[::3, 0] * width).astype(int), np.floor((1.0 - uv[::3, 1]) * height).astype(int)
    np.testing.assert_array_equal(texture[row, column], colours)


def test_normals_are_smooth_over_doubled_vertices_and_keep_creases():
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)  # its last point doubles the first, as at a seam
    points = np.concatenate([np.insert(ring, 2, z, axis=1) for z in (0.0, 1.0)] + [[[0.0, 0.0, 1.0]]])
    k = np.arange(32)
    wall = np.concatenate([np.stack([k, k + 1, k + 34], axis=1), np.stack([k, k + 34, k + 33], axis=1)])
    lid = np.stack([k + 33, k + 34, np.full(32, 66)], axis=1)
    normals = corner_normals(points, np.concatenate([wall, lid])).reshape(-1, 3, 3)
    outward = points[wall] * (1.0, 1.0, 0.0)
    assert np.sum(normals[:64] * outward, axis=2).min() > np.cos(np.radians(6.0)), "no seam, no pull from the lid"
    np.testing.assert_allclose(normals[64:], np.broadcast_to((0.0, 0.0, 1.0), (32, 3, 3)), atol=1e-9)


def test_millimetres_are_read_only_where_they_are_stated(tmp_path):
    write_obj(tmp_path / "cup.obj", points=1000.0 * upright_sheet())
    with pytest.raises(InputError, match=r"found one of 200; if the files are in millimetres"):
        load_scans(tmp_path)
    (tmp_path / "labels.json").write_text('{"unit": "mm"}')
    np.testing.assert_allclose(load_scans(tmp_path)[0].size, (0.2, 0.0, 0.1), atol=1e-6)


def break_texture(file: Path) -> None:
    file.with_suffix(".png").write_bytes(b"no picture")


def lose_texture(file: Path) -> None:
    file.with_suffix(".png").unlink()


def lose_material(file: Path) -> None:
    file.with_suffix(".mtl").unlink()


def keep_points_only(file: Path) -> None:
    file.write_text("v 0 0 0\nv 1 0 0\n")


def write_nan(file: Path) -> None:
    file.write_text(file.read_text().replace("v 3.0 ", "v nan ", 1))


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (break_texture, "a readable texture in cup.png"),
        (lose_texture, "the texture cup.png beside it"),
        (lose_material, "its material file cup.mtl beside it"),
        (keep_points_only, "a mesh with triangles"),
        (write_nan, "finite"),
    ],
)
def test_damaged_objects_are_told(tmp_path, harm, message):
    harm(write_obj(tmp_path / "cup.obj"))
    with pytest.raises(InputError, match=message):
        load_scans(tmp_path)


def test_damaged_binaries_are_told(tmp_path):
    whole = write_glb(tmp_path / "cup.glb").read_bytes()
    start = whole.index(b"\x89PNG")
    for broken in (whole[:start] + b"noPNG" + whole[start + 5 :], whole[:200], b"glTF", b""):
        (tmp_path / "cup.glb").write_bytes(broken)
        with pytest.raises(InputError, match=r"cup\.glb"):
            load_scans(tmp_path)


def test_folders_and_labels_that_do_not_fit_are_told(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        load_scans(tmp_path / "absent")
    with pytest.raises(InputError, match="OBJ or GLB meshes in it, found none"):
        load_scans(tmp_path)
    write_obj(tmp_path / "cup.obj")
    for text, message in (
        ("{", "JSON"),
        ("[]", "names and classes"),
        ('{"cup": 3}', "names and classes"),
        ('{"mug": "cup"}', r"names of scans \(cup\), found mug"),
        ('{"unit": "inch"}', "a unit of"),
    ):
        (tmp_path / "labels.json").write_text(text)
        with pytest.raises(InputError, match=message):
            load_scans(tmp_path)


def test_two_scans_of_one_name_are_told(tmp_path):
    for place in ("a/x", "b/x"):
        for kind in ("fine", "coarse"):
            write_obj(tmp_path / place / kind / "textured.obj")
    with pytest.raises(InputError, match=r"one mesh per object, found a/x/coarse.* and b/x/coarse.*, both 'coarse'"):
        load_scans(tmp_path)


def test_many_triangles_are_told_and_kept(tmp_path, caplog):
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=0.1)
    (tmp_path / "ball.glb").write_bytes(mesh.export(file_type="glb"))
    (model,) = load_scans(tmp_path)
    assert sum(len(part.mesh.triangles) for part in model.parts) == len(mesh.faces) == 81920
    assert "81920 triangles" in caplog.text


def test_a_missing_package_is_told_with_the_extra_that_brings_it(tmp_path, monkeypatch):
    write_obj(tmp_path / "cup.obj")
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "trimesh":
            raise ImportError("No module named 'trimesh'")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UserError, match=r"\[meshes\]"):
        load_scans(tmp_path)


def test_the_recorded_scans_have_their_published_sizes(real_data):
    models = {model.label: model for model in load_scans(real_data / "ycb")}
    assert {"coffee mug", "bowl", "cracker box", "mustard bottle"} <= set(models)
    np.testing.assert_allclose(models["coffee mug"].size, (0.117, 0.093, 0.081), atol=1e-3)
    np.testing.assert_allclose(models["cracker box"].size, (0.072, 0.164, 0.213), atol=1e-3)
    parts: tuple[Part, ...] = models["mustard bottle"].parts
    red, green, blue = parts[0].texture.reshape(-1, 3).mean(axis=0)
    assert min(red, green) > 2 * blue, "it is yellow"
    assert len(read_scan(next((real_data / "ycb" / "025_mug").rglob("*.obj")))) == 1
