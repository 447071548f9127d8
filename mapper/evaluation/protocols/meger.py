"""Protocol 3: the map of views 1 to N - 1 seen in view N, as the two papers of Meger et al. score it.

Mobile 3D Object Detection in Clutter, section VI: after a path of 3, 7, 10 or 12 views the estimates are projected into
the next view and compared with its boxes; recall against false positives per image as the threshold falls.
Explicit Occlusion Reasoning for 3D Object Detection, section 5.3: the same for 2 to 6 views, as average precision.

A view is a mapped frame. The next one had no pose yet when the map was made: it is the last mapped frame's pose, as
estimated then, times the true motion to the next frame; where the truth has no poses, the motion that the run estimated
in the end. All things of that map are ranked, the doubtful ones too, by belief in the class that the map calls them.
What counts as found is said in `boxes.matching`, how things are drawn in `boxes.projection`; a thing that is on no
object is false whether the map holds it for hidden or not, provided half of its box is in the image.

The papers draw a curve a class. So do the plots and tables here; the headline ranks the boxes of all classes together,
so that its one false positive per image is one of any class.

One sequence gives one image for each number of views, so the curves of one scene are coarse. `pool` makes one result of
several scenes, as the papers do of thirty: the table `OUTCOMES` holds all that it needs, in reports too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..boxes.curves import Scored, average_precision, recall_at, recall_per_false_positives
from ..boxes.image_boxes import check_boxes, frame_boxes
from ..boxes.matching import Matches, match_boxes, scored
from ..boxes.outcomes import ALL, OUTCOMES, Outcomes, read_outcomes, write_outcomes
from ..boxes.projection import projected_boxes
from ..config import EvaluationConfig
from ..inputs.case import Case, Snapshot
from ..inputs.placing import place_things
from ..result import Metric, NotEvaluated, Plot, PlotKind, ProtocolResult, Series, Table

FALSE_PER_IMAGE = 1.0  # at which recall is the headline (Clutter, VI: results are shown at this threshold)


def evaluate(case: Case) -> ProtocolResult:
    """Score the maps on the way, each in the view that follows it.

    Raises:
        NotEvaluated: the truth has no complete boxes, or the run kept no map on the way that a judged view follows.
    """
    check_boxes(case.truth)
    lengths = _lengths(case.config)
    kept = {snapshot.frames: snapshot for snapshot in case.run.snapshots if snapshot.frames in lengths}
    if not kept:
        wanted = ",".join(str(length) for length in lengths)
        raise NotEvaluated(f"the run kept no maps on the way; map with --snapshots {wanted}")
    outcomes: Outcomes = {}
    notes: list[str] = []
    for length in lengths:
        try:
            if length not in kept:
                raise NotEvaluated("the run kept no map of so many")
            for label, ranked in _rank(case, match_next_view(case, kept[length])).items():
                outcomes[length, label] = ranked
        except NotEvaluated as lack:
            notes.append(f"Not evaluated: {length} views: {lack}.")
    if not outcomes:
        raise NotEvaluated("no map that the run kept is followed by a view that can be judged")
    notes.append(f"Objects visible by less than {case.config.min_visibility:.0%} are neither missed nor false.")
    motion = "estimated" if case.truth.poses is None else "true"
    notes.append(f"The next view's pose is that of the last view of the map times the {motion} motion between the two.")
    return _result(outcomes, case.config, notes)


def pool(
    results: Iterable[ProtocolResult | Mapping[str, Any]],
    config: EvaluationConfig = EvaluationConfig(),  # noqa: B008
) -> ProtocolResult:
    """One result of several scenes: their images, objects and ranked outcomes together.

    Args:
        results: of `evaluate` or of `pool`, or what `ProtocolResult.to_dict` made of them, as in `report.json`.
        config: names the numbers of views.

    Raises:
        ValueError: a result is of another protocol.
    """
    several = [read_outcomes(result) for result in results]
    keys = sorted({key for outcomes in several for key in outcomes})
    together = {key: Scored.pooled(outcomes[key] for outcomes in several if key in outcomes) for key in keys}
    return _result(together, config, [f"{len(several)} scenes pooled."])


def match_next_view(case: Case, snapshot: Snapshot) -> Matches:
    """The things of a map on the way, in the view that follows it.

    Raises:
        NotEvaluated: no frame follows, or it is not among the truth's, or it is not annotated.
    """
    frame_of_row = {int(row): int(frame) for row, frame in zip(case.run_index, case.truth_index, strict=True)}
    if snapshot.frames >= len(case.run.stamps):
        raise NotEvaluated("no frame was mapped after them")
    frame = frame_of_row.get(snapshot.frames)  # rows count from 0: this is the one after
    true = None if frame is None else frame_boxes(case, frame)
    if frame is None or true is None:
        raise NotEvaluated("the next frame is not annotated")
    intrinsics = case.truth.intrinsics
    assert intrinsics is not None  # as checked
    things, _ = place_things(snapshot.object_map, case.truth, case.alignment, case.config)
    pose = snapshot.T_world_camera @ next_motion(case, snapshot.frames - 1)
    found = projected_boxes(things, snapshot.object_map, pose, case.truth.classes, intrinsics)
    return match_boxes(found, true, case.config.box_iou, frame)


def next_motion(case: Case, row: int) -> np.ndarray:
    """(4, 4) `T_camera_next` from a row of the run's trajectory to the one after it: true, or else as estimated."""
    true = _true_poses(case, row)
    first, second = case.run.poses[row : row + 2] if true is None else true
    return np.linalg.inv(first) @ second


def _true_poses(case: Case, row: int) -> np.ndarray | None:
    """(2, 4, 4) true poses of a row and the next; None where one is unknown."""
    frames = [case.truth_index[case.run_index == r] for r in (row, row + 1)]
    if case.truth.poses is None or any(len(frame) == 0 for frame in frames):
        return None
    poses = case.truth.poses[[int(frame[0]) for frame in frames]]
    return poses if np.all(np.isfinite(poses)) else None


def _lengths(config: EvaluationConfig) -> list[int]:
    return sorted({*config.path_lengths, *config.explicit_lengths})


def _rank(case: Case, match: Matches) -> dict[str, Scored]:
    """Outcomes by class, and of all."""
    by_class = {label: scored([match], number) for number, label in enumerate(case.truth.classes)}
    return {**by_class, ALL: scored([match])}


def _result(outcomes: Outcomes, config: EvaluationConfig, notes: Iterable[str]) -> ProtocolResult:
    labels = list(dict.fromkeys(label for _, label in outcomes if label != ALL))
    seen = [label for label in labels if any(one.objects for (_, key), one in outcomes.items() if key == label)]
    recall = {key: recall_at(one, FALSE_PER_IMAGE) for key, one in outcomes.items()}
    precision = {key: average_precision(one) for key, one in outcomes.items()}
    return ProtocolResult(
        protocol="meger",
        title="The next view",
        follows="Meger et al., Mobile 3D Object Detection in Clutter, section VI, figure 8; Meger et al., Explicit "
        "Occlusion Reasoning for 3D Object Detection, section 5.3, figure 6",
        metrics=(
            *(Metric(f"recall at 1 FPPI after {n} views", recall.get((n, ALL))) for n in config.path_lengths),
            *(Metric(f"AP after {n} views", precision.get((n, ALL))) for n in config.explicit_lengths),
        ),
        tables=(
            _table("Recall at one false positive per image", recall, config.path_lengths, [*seen, ALL]),
            _table("Average precision", precision, config.explicit_lengths, [*seen, ALL]),
            write_outcomes(outcomes),
        ),
        plots=(
            *(_recall_plot(outcomes, label, config.path_lengths) for label in [ALL, *seen]),
            _precision_plot(precision, [ALL, *seen], config.explicit_lengths),
        ),
        notes=(
            *notes,
            "Doubtful things are ranked too; each counts in the class that the map calls it.",
            "The headline ranks all classes together: one false positive per image is one of any class.",
            f"Scenes are pooled from the table {OUTCOMES!r}: one image a scene and number of views.",
        ),
    )


def _table(
    title: str, values: Mapping[tuple[int, str], float | None], lengths: tuple[int, ...], labels: list[str]
) -> Table:
    columns = ("class", *(f"{length} views" for length in lengths))
    return Table(title, columns, tuple((label, *(values.get((n, label)) for n in lengths)) for label in labels))


def _recall_plot(outcomes: Outcomes, label: str, lengths: tuple[int, ...]) -> Plot:
    """Best recall with at most so many false positives per image; it holds until the border, as nothing more comes."""
    known = [(length, outcomes[length, label]) for length in lengths if (length, label) in outcomes]
    curves = {length: recall_per_false_positives(ranked) for length, ranked in known if ranked.objects}
    most = max([FALSE_PER_IMAGE, *(float(fppi[-1]) for fppi, _ in curves.values() if len(fppi))])
    series = []
    for length, (fppi, recall) in curves.items():
        last = recall[-1:].tolist() or [0.0]
        x, y = (0.0, *fppi.tolist(), most), (0.0, *recall.tolist(), *last)
        series.append(Series(f"{length} views", x, y, PlotKind.STEP))
    name, limits = f"Recall and false positives: {label}", (0.0, most, 0.0, 1.0)
    return Plot(name, "false positives per image", "recall", tuple(series), limits)


def _precision_plot(
    values: Mapping[tuple[int, str], float | None], labels: list[str], lengths: tuple[int, ...]
) -> Plot:
    series = []
    for label in labels:
        known = [(n, values[n, label]) for n in lengths if values.get((n, label)) is not None]
        series.append(Series(label, tuple(float(n) for n, _ in known), tuple(float(v or 0.0) for _, v in known)))
    limits = (float(min(lengths)), float(max(lengths)), 0.0, 1.0)
    return Plot("Average precision by number of views", "views", "average precision", tuple(series), limits)
