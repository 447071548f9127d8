"""Labels of points against recorded label maps, with masks as evidence.

uv run python benchmarks/labelling_fusion.py ../shared/data/label_fusion/labels ../shared/data/label_fusion/masks

Each folder holds views of a shelf from known poses with a label map each (see label_fusion.py). Masks of every second
view are evidence; the points are labelled with each smoothness term, and judged by the maps of the views between: a
point that such a view sees has the label of its pixel there. Besides, masks are shrunk or grown, as those of a
segmentation model are wrong at borders, and some are left out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from label_fusion import LabelledView, read_label_fusion
from labelling_report import NAMES
from results import show_section, table

from thingmap.datasets.errors import InputError, UserError
from thingmap.detectors.detections import Detections
from thingmap.mapper.evaluation.points.label_scores import LabelScores, mean_f, score_labels
from thingmap.mapper.labelling.labelling import label_voxels
from thingmap.mapper.labelling.labelling_config import LabellingConfig
from thingmap.mapper.labelling.sources import evidence_of
from thingmap.mapper.labelling.surface import surface_of
from thingmap.mapper.labelling.validation import project_points
from thingmap.mapper.labelling.validation_config import ValidationConfig
from thingmap.mapper.labelling.voxels import VoxelEvidence, Voxels

TITLE = "Labelled points of recorded views"
EVERY = 2  # views from one that gives evidence to the next
SURE = 0.8  # probability of the masks' labels
GROWN = (0, 6, -6)  # pixels by which masks are grown
MISSING = 3  # every such view's masks are left out, in the last rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Label, judge, show; 2 for a user's mistake."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="views with label maps")
    parser.add_argument("--write", action="store_true", help="put the table into RESULTS.md")
    options = parser.parse_args(arguments)
    try:
        lines = [line for folder in options.folders for line in judge_folder(folder)]
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    head = "views", "with depth", "masks", *NAMES.values(), "by thing (last)"
    text = (
        "Macro F of points by label maps of views that gave no evidence. Where hardly a pixel of a thing has a depth, "
        f"the points are those of what is behind it.\n\n{table(head, lines)}"
    )
    show_section(TITLE, text, options.write)
    return 0


def judge_folder(folder: Path) -> list[tuple[str, ...]]:
    """A line for every way to spoil the masks.

    Raises:
        InputError: a view has no pose, or the folder no views.
    """
    views = read_label_fusion(folder)
    if lacking := [view.frame.name for view in views if view.frame.T_world_camera is None]:
        raise InputError(folder / f"{lacking[0]}.pose.txt", "the pose of a view", "nothing", "give views with poses")
    lines = []
    for missing in (False, True):
        for grown in GROWN if not missing else (0,):
            scores = [judge(views, term_config, grown, missing) for term_config in _configs()]
            name = f"grown by {grown} px" if grown else "as they are"
            name += f", none in every {MISSING}rd view" if missing else ""
            last = ", ".join(f"{one.name} {_number(one.f_score)}" for one in scores[-1].objects)
            depth = f"{share_with_depth(views):.0%}"
            lines.append((folder.name, depth, name, *(_number(mean_f(one.objects)) for one in scores), last))
    return lines


def judge(views: Sequence[LabelledView], config: LabellingConfig, grown: int, missing: bool) -> LabelScores:
    """Of all points that the views between see, each view by itself."""
    classes = classes_of(views)
    voxels = gather(views[::EVERY], classes, config, grown, missing)
    label = label_voxels(voxels, config.mrf).label
    found, true = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for number, view in enumerate(views):
        if number % EVERY:
            assert view.frame.T_world_camera is not None
            pose, tolerance = view.frame.T_world_camera, ValidationConfig().tolerance
            rows, uv, is_seen = project_points(voxels.points, view.frame, pose, tolerance)
            column, row = np.floor(uv[is_seen] + 0.5).astype(np.intp).T
            found.append(label[rows[is_seen]])
            true.append(view.instances[row, column])
    return score_labels(np.concatenate(found), np.concatenate(true), classes)


def gather(
    views: Sequence[LabelledView], classes: tuple[str, ...], config: LabellingConfig, grown: int, missing: bool
) -> Voxels:
    """What the masks of these views say, grown by so many pixels, with some left out where `missing`."""
    evidence = VoxelEvidence(classes, config.voxels)
    for number, view in enumerate(views):
        frame, none = view.frame, missing and number % MISSING == MISSING - 1
        detections = Detections.empty(classes) if none else masks_of(view, classes, grown)
        said = evidence_of(frame, detections, None, config.voxels.pixel_step, config.sources)
        surface = surface_of(frame, said.uv)
        assert frame.T_world_camera is not None
        arrays = surface.points, surface.normals, surface.colours, said.log_p
        evidence.add(0, frame.T_world_camera, *arrays, np.eye(4)[None])
    return evidence.assemble(np.eye(4)[None])


def masks_of(view: LabelledView, classes: tuple[str, ...], grown: int) -> Detections:
    """The label map's things as detections with masks, grown by so many pixels."""
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * abs(grown) + 1,) * 2)
    change, boxes, masks, class_id = (cv2.dilate if grown > 0 else cv2.erode), [], [], []
    for k in range(len(classes)):
        mask = change((view.instances == k).astype(np.uint8), shape).astype(bool)
        rows, columns = np.nonzero(mask)
        if len(rows):
            boxes.append((columns.min(), rows.min(), columns.max() + 1, rows.max() + 1))
            masks.append(mask)
            class_id.append(k)
    if not boxes:
        return Detections.empty(classes)
    found = Detections.from_best_class(classes, boxes, class_id, np.full(len(boxes), SURE))
    return replace(found, mask=np.stack(masks))


def share_with_depth(views: Sequence[LabelledView]) -> float:
    """Of the things' pixels, how many have a depth: what the sensor does not see has no points to be labelled."""
    own = [view.frame.depth[view.instances >= 0] > 0.0 for view in views]
    return float(np.mean(np.concatenate([np.zeros(0, bool), *own])))


def classes_of(views: Sequence[LabelledView]) -> tuple[str, ...]:
    """A name for each thing of the label maps."""
    count = max(int(view.instances.max()) for view in views) + 1
    return tuple(f"thing {k + 1}" for k in range(count))


def _configs() -> list[LabellingConfig]:
    whole = LabellingConfig()
    return [replace(whole, mrf=replace(whole.mrf, smoothness=term)) for term in NAMES]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


if __name__ == "__main__":
    sys.exit(main())
