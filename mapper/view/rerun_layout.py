"""How the viewers' windows are arranged: the map, what the camera sees, and what changes with time."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import rerun_frame, rerun_series
from .rerun_package import import_rerun

FRAME_TIMELINE, SENSOR_TIMELINE = "frame", "sensor time"
LEGEND = "legend"
BACK, ABOVE, AHEAD = 0.9, 0.9, 1.2  # m: where the eye is from the first camera, and how far before that it looks
DARK = (18, 20, 24)
SLOW = 200.0  # ms, the top of the stages' plot: the first frames, which load compiled kernels, are above it
LEGEND_TEXT = f"""\
**Image** — boxes of things where the map expects them: green, this keyframe found it; blue, it is hidden or not to be
told; orange, it should have been seen and was not, or the camera looked through it. Yellow: what the detector found.

**Map** — boxes in the colours of their classes, labelled with number and P(it exists and is that); the ellipsoid inside
holds its centre with 95 %; thin grey boxes are doubtful. Blue: path through the keyframes; magenta: loop closures.

**Series** — of at most {rerun_series.MAX_THINGS} things at a time, at most {rerun_series.MAX_CLASSES} classes each.
"""


def send_live_layout(recording: Any, T_world_camera: np.ndarray, up: np.ndarray) -> None:
    """The arrangement of a live view; the eye is behind and above the first camera, (4, 4), with (3,) `up`."""
    rr = import_rerun()
    rrb = rr.blueprint
    image = rrb.Spatial2DView(origin=rerun_frame.IMAGE, name="Image")
    depth = rrb.Spatial2DView(origin=rerun_frame.DEPTH, name="Depth")
    legend = rrb.TextDocumentView(origin=LEGEND, name="Legend")
    upper = rrb.Horizontal(
        _map_view(rrb, T_world_camera, up),
        rrb.Vertical(image, rrb.Tabs(depth, legend), row_shares=[3, 2]),
        column_shares=[3, 2],
    )
    lower = rrb.Horizontal(
        _series_view(rrb, rerun_series.EXISTENCE, "Existence", 1.05),
        _series_view(rrb, rerun_series.CLASSES, "Class, if it exists", 1.05),
        rrb.Tabs(
            _series_view(rrb, rerun_series.TIMES, "Stages [ms]", SLOW), _series_view(rrb, rerun_series.COUNTS, "Counts")
        ),
    )
    panel = rrb.TimePanel(timeline=FRAME_TIMELINE, play_state="following", state="collapsed")
    _send(recording, rrb.Vertical(upper, lower, row_shares=[5, 2]), panel)
    recording.log(LEGEND, rr.TextDocument(LEGEND_TEXT, media_type="text/markdown"), static=True)


def send_map_layout(recording: Any, eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> None:
    """The arrangement of a finished map: (3,) where the eye is, what it looks at, and `up`."""
    rrb = import_rerun().blueprint
    eye_controls = rrb.EyeControls3D(position=eye, look_target=target, eye_up=up)
    view = rrb.Spatial3DView(origin="world", name="Map", eye_controls=eye_controls, background=DARK, line_grid=False)
    _send(recording, view, rrb.TimePanel(state="hidden"))


def _send(recording: Any, root: Any, time_panel: Any) -> None:
    rrb = import_rerun().blueprint
    side_panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    recording.send_blueprint(rrb.Blueprint(root, *side_panels, time_panel, auto_views=False))


def _map_view(rrb: Any, T_world_camera: np.ndarray, up: np.ndarray) -> Any:
    forward = T_world_camera[:3, 2] - (T_world_camera[:3, 2] @ up) * up
    length = float(np.linalg.norm(forward))
    forward = forward / length if length > 1e-6 else T_world_camera[:3, 1]  # it looks straight down
    place = T_world_camera[:3, 3]
    eye = rrb.EyeControls3D(
        position=place - BACK * forward + ABOVE * up, look_target=place + AHEAD * forward - 0.3 * up, eye_up=up
    )
    return rrb.Spatial3DView(
        origin="world",
        contents=[
            "$origin/**",
            f"- /{rerun_frame.DEPTH}/**",
            f"- /{rerun_frame.EXPECTED}",
            f"- /{rerun_frame.DETECTED}",
        ],
        name="Map",
        eye_controls=eye,
        background=DARK,
        line_grid=False,
    )


def _series_view(rrb: Any, origin: str, name: str, top: float | None = None) -> Any:
    axis = rrb.ScalarAxis(range=(0.0, top)) if top is not None else None
    return rrb.TimeSeriesView(
        origin=origin, name=name, axis_y=axis, plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftBottom)
    )
