"""The newest frame: the camera in space, its image with what was found and what was expected, its depth."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...datasets.frame import Frame, Intrinsics
from ...detectors.detections import Detections
from ...factors.solid import project_solids
from ..queries.answer import PROBABLE
from .rerun_package import import_rerun
from .shown_things import Seen, ShownThings

CAMERA = "world/camera"
IMAGE, DEPTH = f"{CAMERA}/image", f"{CAMERA}/depth"
EXPECTED, DETECTED = f"{IMAGE}/things", f"{IMAGE}/detections"
MAX_WIDTH, MAX_DEPTH_WIDTH = 640, 320  # pixels; larger images are sent smaller
JPEG_QUALITY = 75
MILLIMETRES = 1000.0  # of depth images, per metre
FAR = 5.0  # m, the end of the depth image's colours
FRUSTUM = 0.15  # m, distance of the image from the camera in the 3D view
# Okabe and Ito's colours, which all can tell apart
SEEN_COLORS = {
    Seen.SUPPORTED: (0, 158, 115),
    Seen.OCCLUDED: (86, 180, 233),
    Seen.CONTRADICTED: (213, 94, 0),
}
DETECTION_COLOR = (240, 228, 66)
OUTLINE, THIN_OUTLINE = 1.5, 0.7  # pixels of the image


class FrameDrawer:
    """Draws frames of one camera; where frames have no image, only where the camera is."""

    def __init__(self, recording: Any) -> None:
        self._rr, self._recording = import_rerun(), recording
        self._drawn: set[str] = set()  # entities under the image that are not empty
        self._step = 1  # pixels of the camera for one of the image that is sent

    def start(self, intrinsics: Intrinsics) -> None:
        """To be called once, with the camera of all frames."""
        if intrinsics.width == 0:
            return
        self._step = _step(intrinsics, MAX_WIDTH)
        for entity, step in ((IMAGE, self._step), (DEPTH, _step(intrinsics, MAX_DEPTH_WIDTH))):
            self._recording.log(entity, self._pinhole(intrinsics, step), static=True)

    def draw(self, frame: Frame, T_world_camera: np.ndarray) -> None:
        """The (4, 4) posed camera with its colour image."""
        pose = self._rr.Transform3D(translation=T_world_camera[:3, 3], mat3x3=T_world_camera[:3, :3])
        self._recording.log(CAMERA, pose)
        if not frame.has_image:
            return
        image = cv2.cvtColor(frame.color, cv2.COLOR_RGB2BGR)
        if self._step > 1:
            image = cv2.resize(image, _size(frame.intrinsics, self._step), interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        self._recording.log(IMAGE, self._rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))

    def draw_depth(self, frame: Frame) -> None:
        """Its depth, every few pixels."""
        if not frame.has_image:
            return
        step = _step(frame.intrinsics, MAX_DEPTH_WIDTH)
        width, height = _size(frame.intrinsics, step)
        depth = frame.depth[step // 2 :: step, step // 2 :: step][:height, :width]
        image = np.minimum(depth * MILLIMETRES, np.iinfo(np.uint16).max).astype(np.uint16)
        shown = self._rr.DepthImage(image, meter=MILLIMETRES, depth_range=(0.0, FAR * MILLIMETRES))
        self._recording.log(DEPTH, shown)

    def draw_things(self, things: ShownThings, frame: Frame, T_world_camera: np.ndarray) -> None:
        """The image boxes of probable things that the newest keyframe said something of, coloured by what it said."""
        if not frame.has_image:
            return
        told = things.select((things.existence >= PROBABLE) & (things.seen != Seen.OUT_OF_VIEW))
        xyxy = _outlines(told, T_world_camera, frame.intrinsics)
        in_image = _areas(xyxy) > 0.0
        told, xyxy = told.select(in_image), xyxy[in_image]
        seen = [Seen(value) for value in told.seen]
        colors = np.array([SEEN_COLORS[s] for s in seen], dtype=np.uint8).reshape(-1, 3)
        self._log_boxes(EXPECTED, xyxy, colors, told.names, OUTLINE)

    def draw_detections(self, detections: Detections | None) -> None:
        """What the detector found in this frame; None where it was not asked."""
        if detections is None:
            return self._clear(DETECTED)
        names = [detections.classes[k] for k in detections.class_id]
        labels = [f"{name} {score:.2f}" for name, score in zip(names, detections.confidence, strict=True)]
        self._log_boxes(DETECTED, detections.xyxy, np.array(DETECTION_COLOR, dtype=np.uint8), labels, THIN_OUTLINE)

    def _pinhole(self, intrinsics: Intrinsics, step: int) -> Any:
        k, (width, height) = intrinsics, _size(intrinsics, step)
        return self._rr.Pinhole(
            focal_length=(k.fx / step, k.fy / step),
            principal_point=((k.cx + 0.5) / step, (k.cy + 0.5) / step),  # the viewer counts from the image's corner
            width=width,
            height=height,
            camera_xyz=self._rr.ViewCoordinates.RDF,
            image_plane_distance=FRUSTUM,
        )

    def _log_boxes(self, entity: str, xyxy: np.ndarray, colors: np.ndarray, labels: list[str], line: float) -> None:
        """Boxes (N, 4) in pixels of the camera, from the image's corner."""
        if not len(xyxy):
            return self._clear(entity)
        layout = self._rr.Box2DFormat.XYXY
        boxes = self._rr.Boxes2D(
            array=xyxy / self._step, array_format=layout, colors=colors, labels=labels, radii=line, show_labels=True
        )
        self._recording.log(entity, boxes)
        self._drawn.add(entity)

    def _clear(self, entity: str) -> None:
        if entity in self._drawn:
            self._recording.log(entity, self._rr.Clear(recursive=False))
            self._drawn.remove(entity)


def _outlines(things: ShownThings, T_world_camera: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """(N, 4) image boxes of the volumes, clipped, in pixels from the image's corner; NaN for what is not in front."""
    if not len(things):
        return np.empty((0, 4))
    camera = T_world_camera, things.R_world_box[0]  # a mapper's boxes are all along the axes of its upright frame
    xyxy, _ = project_solids(*camera, things.position, np.log(things.size / 2.0), intrinsics)
    return np.clip(xyxy + 0.5, 0.0, np.tile([intrinsics.width, intrinsics.height], 2))


def _areas(xyxy: np.ndarray) -> np.ndarray:
    """(N,) px^2; 0 where there is no box."""
    return np.nan_to_num(np.prod(xyxy[:, 2:] - xyxy[:, :2], axis=1))


def _step(intrinsics: Intrinsics, max_width: int) -> int:
    return -(-intrinsics.width // max_width)


def _size(intrinsics: Intrinsics, step: int) -> tuple[int, int]:
    return intrinsics.width // step, intrinsics.height // step
