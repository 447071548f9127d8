"""What a run leaves behind in its output folder."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from .map.atomic import replacing
from .map.labels_file import PointLabels, write_labels
from .map.object_map import ObjectMap
from .map.store import OutputFolder
from .queries.answer import PROBABLE
from .run_report import RunReport
from .runner import Mapper


@runtime_checkable
class LabelsPoints(Protocol):
    """A mapper that says what each point of its cloud is, such as `TrackMapper`.

    `point_labels` gives (M,) indices into the map's classes for the points of `cloud()`, `NO_OBJECT` for none, or None
    where it cannot tell.
    """

    def point_labels(self) -> np.ndarray | None: ...


def save_run(
    folder: OutputFolder,
    mapper: Mapper,
    report: RunReport,
    *,
    config: str,
    command: dict[str, Any] | None = None,
    include_doubtful: bool = False,
) -> ObjectMap:
    """Write everything that a run leaves behind, the map last, so that a new folder with a map is complete.

    Args:
        folder: where to.
        mapper: what was mapped, be it a whole sequence or a part of it.
        report: of the run; the mapper's own statistics are written with it.
        config: YAML of the configuration as it was used.
        command: what the user asked for, for the report.
        include_doubtful: write things whose existence is below 0.5 too.

    Returns:
        The map.
    """
    object_map = mapper.object_map(include_doubtful)
    # a mapper that waits for all views has found nothing before it is asked
    report = replace(report, things=sum(thing.existence >= PROBABLE for thing in object_map.things))
    folder.write_config(config)
    folder.write_trajectory(*mapper.trajectory())
    folder.write_keyframes(*mapper.keyframes())
    folder.write_cloud(*mapper.cloud())
    _save_labels(folder, mapper, object_map)
    with replacing(folder.ledger_file) as temporary:
        mapper.save_ledger(temporary)
    folder.write_report({**report.to_dict(), "command": command or {}, "mapper": mapper.statistics()})
    folder.write_map(object_map, include_doubtful)
    return object_map


def _save_labels(folder: OutputFolder, mapper: Mapper, object_map: ObjectMap) -> None:
    """The labels of the cloud's points; where the mapper gives none, none of an earlier run may pass for its own."""
    labels = mapper.point_labels() if isinstance(mapper, LabelsPoints) else None
    if labels is None:
        folder.set_labels_aside()
    else:
        write_labels(folder.labels_file, *mapper.cloud(), PointLabels(labels), object_map.classes)
