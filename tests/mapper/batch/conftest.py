"""Cameras around a table, and what a detector that makes no mistake would say of volumes on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from thingmap.datasets.frame import Frame, Intrinsics
from thingmap.detectors.detections import Part
from thingmap.detectors.parts import part_box, whole_box
from thingmap.factors.evidence_model import EvidenceModel, generic_evidence_model
from thingmap.factors.size_prior import ClassSizePriors, load_size_priors
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import MapperConfig
from thingmap.mapper.estimation.lifting import LiftedDetection
from thingmap.mapper.estimation.view import View
from thingmap.mapper.proposals.views import PackedViews, StoredView, pack

KINECT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
CLASSES = ("coffee mug", "bowl", "cereal box")
UPRIGHT = np.eye(3)


def look_at(position: Sequence[float], target: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) `T_world_camera` of an upright camera; the world's z is up."""
    forward = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = position
    return T


def around(count: int, radius: float = 1.5, height: float = 0.5, degrees: float = 120.0) -> list[np.ndarray]:
    """Cameras on an arc that look at the origin."""
    angles = np.deg2rad(np.linspace(0.0, degrees, count))
    return [look_at((radius * np.cos(a), radius * np.sin(a), height)) for a in angles]


class Table:
    """Ellipsoids seen by cameras: exact boxes, centres and depth maps.

    Attributes:
        cameras: (4, 4) each.
        volumes: (3,) centre, (3,) log half-axes and class of each.
        detections: of each camera; empty until `detect`.
    """

    def __init__(self, cameras: Sequence[np.ndarray], *volumes: tuple[Sequence[float], Sequence[float], int]) -> None:
        self.cameras = list(cameras)
        self.volumes = [(np.array(c, dtype=float), np.log(a), k) for c, a, k in volumes]
        self.detections: list[list[LiftedDetection]] = [[] for _ in self.cameras]

    def detect(self, volume: int, camera: int, part: int = Part.WHOLE, shift: float | np.ndarray = 0.0) -> None:
        """Adds the exact detection of a volume, its sides moved by `shift` pixels."""
        T, (centre, log_size, k) = self.cameras[camera], self.volumes[volume]
        box = project_solids(T, UPRIGHT, centre[None], log_size[None], KINECT)[0][0]
        xyxy = part_box(box, part) + shift
        scores = np.full(len(CLASSES), 0.02)
        scores[k] = 0.7
        half = np.exp(log_size)
        detection = LiftedDetection(
            scores=scores,
            xyxy=xyxy,
            sides_seen=np.ones(4, dtype=bool),
            sigma_px=2.5,
            centre=T[:3, :3].T @ (centre - T[:3, 3]),
            sigma_tangential=0.3 * float(half.mean()),
            sigma_range=float(half.mean()),
            half_extents=half[[0, 1, 2]],
            part=part,
            whole_xyxy=whole_box(xyxy, part),
        )
        self.detections[camera].append(detection)

    def detect_all(self) -> Table:
        for volume in range(len(self.volumes)):
            for camera in range(len(self.cameras)):
                self.detect(volume, camera)
        return self

    def depth(self, camera: int, floor: float = -0.5) -> np.ndarray:
        """(H, W) float32 of the ellipsoids over a horizontal floor; 0 above the horizon."""
        T = self.cameras[camera]
        v, u = np.mgrid[0 : KINECT.height, 0 : KINECT.width]
        rays = np.stack([(u - KINECT.cx) / KINECT.fx, (v - KINECT.cy) / KINECT.fy, np.ones(u.shape)], -1) @ T[:3, :3].T
        with np.errstate(divide="ignore"):
            z = (floor - T[2, 3]) / rays[..., 2]
        depth = np.where(z > 0.0, z, np.inf)
        for centre, log_size, _ in self.volumes:
            d, o = rays / np.exp(log_size), (T[:3, 3] - centre) / np.exp(log_size)
            a, b, c = (d * d).sum(-1), d @ o, o @ o - 1.0
            root = b * b - a * c
            depth = np.where(root > 0.0, np.minimum(depth, (-b - np.sqrt(np.maximum(root, 0.0))) / a), depth)
        return np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)

    def views(self) -> list[View]:
        views = []
        for t, T in enumerate(self.cameras):
            color = np.zeros((KINECT.height, KINECT.width, 3), np.uint8)
            frame = Frame(t, f"frame-{t:06d}", float(t), color, self.depth(t), KINECT)
            views.append(StoredView.of(frame, t, self.detections[t]).at(T, UPRIGHT))
        return views

    def packed(self, config: MapperConfig | None = None) -> PackedViews:
        found = [d for view in self.detections for d in view]
        own = [MODEL.scores.evidence(d.scores, 0.0, d.part).own for d in found]
        association = (config or MapperConfig()).association
        return pack(self.cameras, self.detections, own, UPRIGHT, KINECT, association)


MODEL: EvidenceModel = generic_evidence_model().bind(CLASSES)
PRIORS: ClassSizePriors = load_size_priors(CLASSES)


class Tools:
    """What the tests share; a class, so that it needs no import."""

    kinect, classes, upright, model, priors = KINECT, CLASSES, UPRIGHT, MODEL, PRIORS
    Table = Table
    look_at = staticmethod(look_at)
    around = staticmethod(around)


@pytest.fixture(scope="session")
def tools() -> type[Tools]:
    """`Table`, `around` and the like."""
    return Tools
