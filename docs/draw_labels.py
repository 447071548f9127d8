"""Draws the labelled points of a run under each smoothness term, side by side, as one JPEG.

    uv run thingmap run SEQUENCE -o OUT && uv run thingmap label OUT
    uv run python docs/draw_labels.py OUT -o docs/labels.jpg

The evidence is that of `OUT/voxels.npz`, by default the detector's alone, as in Lai et al., figure 6. Points of a class
have its colour, the background's are as they were seen, paler.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from drawing.cloud import shaded, spacing_of, splat
from drawing.scene import ELEVATION, FOCAL, PALETTE, Scene, View, choose_view, read_scene

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.datasets.truth import NO_OBJECT
from thingmap.mapper.evaluation.inputs.load_run import load_run
from thingmap.mapper.labelling.label_state import LabelState
from thingmap.mapper.labelling.labelling import label_voxels
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.mrf_config import Smoothness
from thingmap.mapper.labelling.volumes_evidence import weighted_volumes
from thingmap.mapper.labelling.voxels import Voxels
from thingmap.mapper.map.store import OutputFolder

TERMS = {
    Smoothness.NONE: "none (DetOnly)",
    Smoothness.POTTS: "potts (PottsMRF)",
    Smoothness.COLOUR: "colour (ColMRF)",
    Smoothness.NORMALS: "normals (Det3DMRF)",
}
TWICE = 2  # pixels along each side that one of the picture is drawn with
FAR = 2.5  # times the median distance of things from the middle, beyond which one is left out of sight
ABOVE = 0.12  # m around the things' boxes that is drawn: what is before them would hide them
WHITE, QUALITY = (255, 255, 255), 85


def main(arguments: list[str] | None = None) -> int:
    """Returns 0, or 2 after one line about a mistake of the user."""
    given = _parser().parse_args(arguments)
    try:
        picture = draw(given.out, given.width, given.volumes, tuple(given.view_from))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    cv2.imwrite(str(given.output), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    print(f"{given.output} has {given.output.stat().st_size / 1000:.0f} kB")
    return 0


def draw(out: Path, width: int, volumes: bool, view_from: tuple[float, float]) -> np.ndarray:
    """(H, W, 3) uint8 RGB, two terms in a row.

    Args:
        out: of a run that was labelled.
        width: pixels of one term's picture.
        volumes: whether the boxes of the map's things are evidence too.
        view_from: degrees, azimuth and elevation, as `choose_view` takes them.
    """
    run, config = load_run(out), LabellingConfig()
    assert run.keyframes is not None
    voxels = LabelState.load(OutputFolder.open(out).voxels_file).evidence.assemble(run.keyframes.poses)
    more = weighted_volumes(voxels.points, run.object_map, config) if volumes else None
    scene = together(read_scene(out))
    view = close_view(scene, width * TWICE, *view_from)
    pictures = []
    for term, title in TERMS.items():
        label = label_voxels(voxels, replace(config.mrf, smoothness=term), more).label
        pictures.append(_titled(_drawn(scene, view, voxels, painted(voxels, label)), title))
    return np.vstack([np.hstack(pictures[row : row + 2]) for row in range(0, len(pictures), 2)])


def together(scene: Scene) -> Scene:
    """Without things that stand by themselves, farther from the middle one than most."""
    position = np.array([thing.position for thing in scene.things])
    distance = np.linalg.norm(position - np.median(position, axis=0), axis=1)
    near = distance <= FAR * np.median(distance)
    return replace(scene, things=tuple(thing for thing, kept in zip(scene.things, near, strict=True) if kept))


def painted(voxels: Voxels, label: np.ndarray) -> np.ndarray:
    """(N, 3) uint8 RGB: what is labelled in a colour for each class, the background as it was seen, paler."""
    seen = 0.6 * np.nan_to_num(voxels.colours) + 70.0
    table = np.array(PALETTE)[label % len(PALETTE)]
    return np.where((label == NO_OBJECT)[:, None], seen, table).clip(0, 255).astype(np.uint8)


def close_view(scene: Scene, width: int, azimuth: float, elevation: float) -> View:
    """The nearest view of all boxes, in an image of 4:3; the camera's path may lie outside."""
    R = choose_view(scene, width, azimuth, elevation).T_world_view[:3, :3]
    height, f = width * 3 // 4, FOCAL * width
    corners = scene.corners.reshape(-1, 3) @ R
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    half = 0.95 * np.array([width, height]) / (2.0 * f)
    away = corners - middle
    distance = float((np.abs(away[:, :2]) / half - away[:, 2:]).max())
    T_world_view = np.eye(4)
    T_world_view[:3, :3], T_world_view[:3, 3] = R, R @ (middle - np.array([0.0, 0.0, distance]))
    return View(T_world_view, Intrinsics(width, height, f, f, (width - 1) / 2.0, (height - 1) / 2.0))


def _drawn(scene: Scene, view: View, voxels: Voxels, colors: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 of the points about the things."""
    upright = scene.corners.reshape(-1, 3) @ scene.R_world_upright
    points = voxels.points @ scene.R_world_upright
    near = ((points > upright.min(axis=0) - ABOVE) & (points < upright.max(axis=0) + ABOVE)).all(axis=1)
    near &= (voxels.count > 1) & (view.to_view(voxels.points)[:, 2] > 0.05)
    shown = replace(scene, points=voxels.points[near], colors=colors[near])
    spacing = spacing_of(shown.points)
    color, depth = splat(view.to_view(shown.points), shown.colors, view.intrinsics, spacing)
    large = shaded(color, depth, shown, view, spacing)
    k = view.intrinsics
    return cv2.resize(large, (k.width // TWICE, k.height // TWICE), interpolation=cv2.INTER_AREA)


def _titled(picture: np.ndarray, title: str) -> np.ndarray:
    picture = np.ascontiguousarray(picture)
    cv2.putText(picture, title, (14, 30), cv2.FONT_HERSHEY_DUPLEX, 0.75, WHITE, 1, cv2.LINE_AA)
    return picture


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Draw the labelled points of a run under each smoothness term.")
    parser.add_argument("out", metavar="OUT", type=Path, help="folder that `thingmap label` has labelled")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="JPEG to write")
    parser.add_argument(
        "--view-from",
        nargs=2,
        type=float,
        default=(0.0, ELEVATION),
        metavar=("AZIMUTH", "ELEVATION"),
        help=f"degrees: turned from behind the camera, and above the horizontal (default: 0 {ELEVATION:g})",
    )
    parser.add_argument("--volumes", action="store_true", help="take the boxes of the map's things as evidence too")
    parser.add_argument("--width", metavar="PIXELS", type=int, default=640, help="of one picture (default 640)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
