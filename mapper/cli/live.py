"""The live view of a run: what the options ask for, and how long it lasts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from ..config import CloudConfig
    from ..glimpse import Watchable
    from ..view.live import LiveView
    from ..view.live_targets import LiveTargets


def live_targets(window: bool, port: int | None, file: Path | None, overwrite: bool) -> LiveTargets | None:
    """What the user wants to watch with; None for nothing, and then no viewer is imported.

    Raises:
        UserError: that cannot be done here.
    """
    if not window and port is None and file is None:
        return None
    from ..view.live_targets import LiveTargets

    targets = LiveTargets(window, port, file, overwrite)
    targets.check()
    return targets


@contextmanager
def watching(targets: LiveTargets, mapper: Watchable, cloud: CloudConfig, source: str) -> Iterator[LiveView]:
    """A live view for as long as the block lasts; `source` is the name of what is mapped.

    Raises:
        UserError: it cannot be opened.
    """
    from ..view.live import LiveView

    view = LiveView(mapper, targets.open(source), cloud, lambda line: typer.echo(line, err=True))
    if targets.address is not None:
        typer.echo(f"live view, as long as this runs: {targets.address}", err=True)
    try:
        yield view
    finally:
        view.close()
    if targets.file is not None:
        typer.echo(f"the live view is in {targets.file}; open it with `rerun {targets.file}`")
