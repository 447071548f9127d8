"""One mapping job of the command line: run, keep what came of it, tell the user."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import typer

from .interrupt import stop_on_interrupt
from .progress import FrameProgress
from .sources import missing_line, skipped_line
from .tables import print_things

if TYPE_CHECKING:
    from ...datasets.sequence import Sequence
    from ...detectors.detector import Detector
    from ..map.object_map import ObjectMap
    from ..map.store import OutputFolder
    from ..runner import Mapper, Progress, SequenceRun
    from ..view.live import LiveView


@dataclass(slots=True)
class MappingJob:
    """Everything that `thingmap run` needs once the options are understood.

    Attributes:
        sequence: what to map.
        mapper: fresh.
        detector: the one that the mapper calls.
        spec: its name, for messages.
        folder: where to write.
        config: YAML of the configuration in use.
        command: the options, for the report.
        include_doubtful: write things whose existence is below 0.5 too.
        snapshots: after how many mapped frames to write the map besides.
        live: opens the view of whoever watches; None by default.
    """

    sequence: Sequence
    mapper: Mapper
    detector: Detector
    spec: str
    folder: OutputFolder
    config: str
    command: dict[str, Any]
    include_doubtful: bool
    snapshots: tuple[int, ...] = ()
    live: AbstractContextManager[LiveView | None] = field(default_factory=nullcontext)
    _run: SequenceRun = field(init=False)

    def execute(self) -> None:
        """Map, save and print; what was mapped before a failure or Ctrl-C is saved too.

        Raises:
            typer.Exit: with 130 after Ctrl-C.
            UserError: nothing could be mapped, or a mistake of the user came to light on the way.
            Exception: whatever else ended the run.
        """
        with self.live as live:
            self._execute(live)

    def _execute(self, live: LiveView | None) -> None:
        from ..runner import SequenceRun
        from ..snapshots import SnapshotWriter

        write_snapshot = SnapshotWriter(self.folder, self.mapper, self.snapshots)
        with stop_on_interrupt() as should_stop:
            with FrameProgress("mapping", len(self.sequence)) as progress:
                told = [write_snapshot] if live is None else [write_snapshot, live]
                self._run = SequenceRun(self.sequence, self.mapper, _shower(progress, told), should_stop)
                try:
                    self._run.execute()
                except Exception as error:
                    self._rescue(error)
                    raise
            missing = missing_line(self.spec, self.detector, self._run.report)
            object_map = self._save() if self._run.report.frames_used else None
            if live is not None and object_map is not None:
                live.finish(object_map)
        self._tell(object_map, missing)

    def _save(self) -> ObjectMap:
        from ..saving import save_run

        report, folder = self._run.report, self.folder
        details = {"config": self.config, "command": self.command, "include_doubtful": self.include_doubtful}
        return save_run(folder, self.mapper, report, **details)

    def _rescue(self, error: Exception) -> None:
        """Keep what was mapped before a failure; a failure of saving must not hide the first one."""
        from ...datasets.errors import UserError

        if not self._run.report.frames_used:
            return
        try:
            self._save()
            outcome = f"what was mapped before is in {self.folder.path}"
        except Exception as second:
            outcome = f"what was mapped before could not be saved ({second})"
        if isinstance(error, UserError):
            raise UserError(f"{error}; {outcome}") from error
        typer.echo(f"{self._run.report.stopped}; {outcome}", err=True)

    def _tell(self, object_map: ObjectMap | None, missing: str | None) -> None:
        report, path = self._run.report, self.folder.path
        for line in (skipped_line(report.skipped), missing):
            if line is not None:
                typer.echo(line, err=True)
        if object_map is None:
            typer.echo(f"{report.stopped}, before anything was mapped; nothing is written", err=True)
            raise typer.Exit(130)
        edited = self.folder.read_map() if self.folder.journal_file.exists() else object_map
        print_things(edited.things)
        pace = f"{report.frames_used} frames in {report.seconds:.1f} s, {report.frames_per_second:.1f} frames/s"
        typer.echo(f"{len(edited)} things from {pace}, {report.keyframes} keyframes; the map is in {path}")
        if edited.edits.changed:
            typer.echo(f"they are as people have edited them: `thingmap edit {path} log`")
        for pending in edited.edits.pending:
            typer.echo(str(pending), err=True)
        statistics = self.mapper.statistics()
        if "batch" in statistics:
            typer.echo(_batch_line(statistics["batch"]))
        if "tracks" in statistics:
            typer.echo(_tracks_line(statistics["tracks"]))
        if report.stopped:
            typer.echo(f"{report.stopped}; what was mapped before is in {path}", err=True)
            raise typer.Exit(130)


def _tracks_line(tracks: dict[str, Any]) -> str:
    """What linking detections did, of `TrackMapper.statistics`."""
    return (
        f"{tracks['observations']} detections in {tracks['views']} views became {tracks['tracks']} tracks: "
        f"{tracks['kept']} kept, {tracks['background']} likeliest background, {tracks['dropped']} seen too seldom"
    )


def _batch_line(batch: dict[str, Any]) -> str:
    """What batch inference did, of `BatchMapper.statistics`."""
    if "samples" not in batch:
        return "batch inference: no view"
    return (
        f"batch inference over {batch['views']} views: {batch['samples']} samples and {batch['sliding_volumes']} "
        f"sliding volumes became {batch['before_suppression']} different ones, {batch['after_suppression']} after "
        f"suppression, {batch['with_own_detections']} with detections of their own; "
        f"{batch['iterations_median']:g} iterations (median), {batch['iterations_most']} at most"
        + (f", {batch['not_settled']} volumes not settled by then" if batch["not_settled"] else "")
    )


def _shower(progress: FrameProgress, told: Iterable[Callable[[Progress], None]]) -> Callable[[Progress], None]:
    def show(now: Progress) -> None:
        for tell in told:
            tell(now)
        if now.done == now.skipped:
            return  # nothing is mapped yet, and perhaps nothing can be
        skipped = f", {now.skipped} skipped" if now.skipped else ""
        progress.show(now.done, f"{now.things} things{skipped}")

    return show
