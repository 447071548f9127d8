"""The live view: what a mapper knows after each frame, drawn by rerun; in its window, in a browser or into a file."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from threading import Thread
from typing import Any

import numpy as np

from ...datasets.frame import Frame
from ..config import CloudConfig
from ..glimpse import Glimpse, Watchable
from ..map.object_map import ObjectMap
from ..runner import Progress
from .moved_poses import MovedPoses
from .rerun_cloud import GrowingCloud
from .rerun_frame import FrameDrawer
from .rerun_layout import FRAME_TIMELINE, SENSOR_TIMELINE, send_live_layout
from .rerun_package import import_rerun
from .rerun_path import PathDrawer
from .rerun_series import SeriesDrawer
from .rerun_things import ThingDrawer
from .shown_things import ShownThings, shown_landmarks, shown_map

CLOSING_SECONDS = 5.0  # that the end of a run waits for a slow viewer
CLOCK_OF_1970 = 1e8  # s: stamps above it count from 1970, those below from some start


class LiveView:
    """Draws a run; give it to `SequenceRun` as `on_update`.

    It only reads, so the map is the same with and without it; and whatever happens to it, mapping goes on: the first
    failure is told once and ends the view.

    Args:
        mapper: what is mapping.
        recording: a `rerun.RecordingStream` with its sinks (`LiveTargets.open`).
        cloud: resolution and range of the cloud.
        warn: told of a failure, in one line.
    """

    def __init__(self, mapper: Watchable, recording: Any, cloud: CloudConfig, warn: Callable[[str], None]) -> None:
        self._mapper, self._recording, self._warn = mapper, recording, warn
        self._frames, self._series = FrameDrawer(recording), SeriesDrawer(recording)
        self._things, self._path = ThingDrawer(recording), PathDrawer(recording)
        self._cloud = GrowingCloud(recording, cloud)
        self._poses = MovedPoses()
        self._shown: ShownThings | None = None  # as of the newest keyframe
        self._failed = False

    def __call__(self, now: Progress) -> None:
        """To be told of every frame."""
        if now.update is not None and now.frame is not None:
            frame, update = now.frame, now.update
            self._try(lambda: self._draw(frame, update.T_world_camera, bool(update.is_keyframe)))

    def finish(self, object_map: ObjectMap) -> None:
        """Draws the map as it was saved: settled, and with what is only found at the end."""
        self._try(lambda: self._draw_end(object_map))

    def close(self) -> None:
        """Sends what is on its way, and ends; a viewer that does not take it in time is left behind."""
        try:
            self._recording.flush(timeout_sec=CLOSING_SECONDS)
        except Exception as error:  # closed, or hung
            if not self._failed:
                self._warn(f"the live view was not shown to its end ({error}); the map is not touched by that")
        leave(self._recording)

    def _draw(self, frame: Frame, T_world_camera: np.ndarray, is_keyframe: bool) -> None:
        now = self._mapper.glimpse()
        if now is None:
            return
        self._set_time(frame)
        if self._shown is None:
            send_live_layout(self._recording, T_world_camera, now.R_world_upright[:, 2])
            self._frames.start(frame.intrinsics)
        if is_keyframe or self._shown is None:
            self._draw_keyframe(frame, now)
        assert self._shown is not None
        self._frames.draw(frame, T_world_camera)
        self._frames.draw_things(self._shown, frame, T_world_camera)
        asked = is_keyframe and now.detected is not None and now.detected[0] == frame.index
        self._frames.draw_detections(now.detected[1] if asked and now.detected is not None else None)

    def _draw_keyframe(self, frame: Frame, now: Glimpse) -> None:
        newest = len(now.T_world_keyframe) - 1
        things = shown_landmarks(now.landmarks, now.classes, now.R_world_upright, newest)
        self._draw_poses(now)
        self._cloud.add(frame, newest, now.T_world_keyframe[newest])
        self._things.draw(things)
        self._series.draw_things(things)
        self._series.draw_numbers(now, things)
        self._frames.draw_depth(frame)
        self._shown = things

    def _draw_poses(self, now: Glimpse) -> None:
        moved = self._poses.moved(now.T_world_keyframe)
        self._cloud.follow(moved, now.T_world_keyframe)
        self._path.draw(moved, now.T_world_keyframe, now.loops)

    def _draw_end(self, object_map: ObjectMap) -> None:
        now = self._mapper.glimpse()
        if now is not None:
            self._draw_poses(now)
            self._things.draw(shown_map(object_map))

    def _set_time(self, frame: Frame) -> None:
        self._recording.set_time(FRAME_TIMELINE, sequence=frame.index)
        kind = "timestamp" if frame.stamp > CLOCK_OF_1970 else "duration"
        self._recording.set_time(SENSOR_TIMELINE, **{kind: frame.stamp})

    def _try(self, action: Callable[[], None]) -> None:
        if self._failed:
            return
        try:
            action()
        except Exception as error:  # whatever it is, a run of hours must not end for a picture
            self._failed = True
            self._warn(f"the live view has ended ({type(error).__name__}: {error}); mapping goes on without it")


def leave(recording: Any, seconds: float = CLOSING_SECONDS) -> None:
    """Disconnects a recording; from a viewer that hangs, after so long, without waiting for it.

    rerun would wait for ever, here and at the end of the program.
    """

    def disconnect() -> None:
        with suppress(Exception):  # what a viewer did not take has been told
            recording.disconnect()

    thread = Thread(target=disconnect, name="leave live view", daemon=True)
    thread.start()
    thread.join(seconds)
    if thread.is_alive():
        import_rerun().unregister_shutdown()
