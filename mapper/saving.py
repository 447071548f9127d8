"""What a run leaves behind in its output folder."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from .map.atomic import replacing
from .map.object_map import PROBABLE, ObjectMap
from .map.store import OutputFolder
from .run_report import RunReport
from .runner import Mapper


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
    with replacing(folder.ledger_file) as temporary:
        mapper.save_ledger(temporary)
    folder.write_report({**report.to_dict(), "command": command or {}, "mapper": mapper.statistics()})
    folder.write_map(object_map, include_doubtful)
    return object_map
