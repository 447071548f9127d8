"""A room in numbers for timing the back end: objects, phantoms, a camera going to and fro, and what a detector says.

Nothing is rendered. What a keyframe sees is drawn from the true volumes, so that association is known and only the
back end is measured. Errors that repeat do so here too: what hides an object depends on the direction of view, and
every thing has its own detection rate and its own class that it is mistaken for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Intrinsics
from thingmap.factors.size_prior import ClassSizePriors, load_size_priors
from thingmap.factors.solid import project_solids
from thingmap.mapper.config import LiftingConfig

CLASSES = (
    *("backpack", "ball", "banana", "book", "bottle", "bowl", "calculator", "cap", "cell phone", "cereal box"),
    *("chair", "clock", "coffee mug", "flashlight", "food box", "food can", "food jar", "handbag", "kettle"),
    *("keyboard", "lamp", "laptop", "microwave", "monitor", "mouse", "orange", "pitcher", "plate", "potted plant"),
    *("printer", "remote", "scissors", "shoe", "soda can", "stapler", "stool", "suitcase", "teddy bear", "toaster"),
    "vase",
)  # 40 of the built-in size table, none so large that it fills the image; with "not an object" 41
KINECT = Intrinsics(640, 480, 585.0, 585.0, 320.0, 240.0)
ARC = np.radians(170.0)  # of the room's walls along which things stand
RING = 1.2  # m, radius of the camera's way
DISTANCE = (1.0, 3.6)  # m, of things from the ring, outwards
RANGE = (0.6, 5.0)  # m, along z, in which things are detected
THINNEST = 0.006  # m, half-axis; the tails of the size priors hold telephones 1 mm thick
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """N things: objects first, then phantoms, which a detector sees now and then where there is no object.

    Attributes:
        priors: class sizes, from which the true sizes are drawn.
        objects: number of objects.
        label: (N,) class of an object; of no meaning for a phantom.
        looks_like: (N,) class that the detector gives where it errs, and mostly to a phantom.
        positions: (N, 3) metres, z up.
        log_sizes: (N, 3) log half-axes.
        rate: (N,) share of the good views in which a thing is detected.
        free: (N,) share of the volume's pixels that the camera looks through.
        hidden: (N, 3) share hidden at most, cycles of it per radian of the camera's way, and its phase.
    """

    priors: ClassSizePriors
    objects: int
    label: np.ndarray
    looks_like: np.ndarray
    positions: np.ndarray
    log_sizes: np.ndarray
    rate: np.ndarray
    free: np.ndarray
    hidden: np.ndarray

    def __len__(self) -> int:
        return len(self.label)

    def occlusion(self, T_world_camera: np.ndarray) -> np.ndarray:
        """(N,) hidden share; it depends on where along its way the camera is."""
        most, times, phase = self.hidden.T
        return most * (0.5 + 0.5 * np.sin(times * np.arctan2(T_world_camera[1, 3], T_world_camera[0, 3]) + phase))

    def view(self, T_world_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 4) boxes of the whole things, pixels, and the (N,) share of each box that is in the image."""
        xyxy, in_front = project_solids(T_world_camera, np.eye(3), self.positions, self.log_sizes, KINECT)
        z = (self.positions - T_world_camera[:3, 3]) @ T_world_camera[:3, 2]
        near = in_front & (z > RANGE[0]) & (z < RANGE[1])
        xyxy[~near] = 0.0
        sides, inside = xyxy[:, 2:] - xyxy[:, :2], clip(xyxy)
        area = np.maximum(sides.prod(axis=1), 1e-9)
        return xyxy, (inside[:, 2:] - inside[:, :2]).prod(axis=1) / area


def clip(xyxy: np.ndarray) -> np.ndarray:
    """(N, 4) boxes cut to the image."""
    return np.clip(xyxy, 0.0, np.array([KINECT.width, KINECT.height] * 2) - 1.0)


def make_world(objects: int, phantoms: int, rng: np.random.Generator) -> World:
    """Things of random classes along the walls, none inside another.

    Raises:
        UserError: there is no room for so many.
    """
    n, priors = objects + phantoms, load_size_priors(CLASSES)
    label = rng.integers(0, len(CLASSES), n)
    roots = np.linalg.cholesky(priors.covariance[label + 1])
    log_sizes = priors.mean[label + 1] + np.einsum("nij,nj->ni", roots, rng.normal(size=(n, 3)))
    log_sizes = np.maximum(log_sizes, np.log(THINNEST))
    is_phantom = np.arange(n) >= objects
    log_sizes[is_phantom] = rng.normal(-2.2, 0.7, (phantoms, 3))
    on_surface = rng.random(n) < 0.5  # the other half of the phantoms hang in the air
    return World(
        priors=priors,
        objects=objects,
        label=label,
        looks_like=rng.integers(0, len(CLASSES), n),
        positions=_place(np.exp(log_sizes), rng),
        log_sizes=log_sizes,
        rate=np.where(is_phantom, rng.uniform(0.15, 0.45, n), rng.beta(9.0, 1.5, n)),
        free=np.where(is_phantom & ~on_surface, rng.uniform(0.3, 0.6, n), np.abs(rng.normal(0.0, 0.08, n))),
        hidden=np.stack([rng.uniform(0.0, 0.9, n), rng.integers(4, 20, n), rng.uniform(0.0, 2 * np.pi, n)], axis=1),
    )


def _place(half_axes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(N, 3) centres, drawn again where a volume would touch one that is already placed."""
    placed: list[np.ndarray] = []
    for half in half_axes:
        for _ in range(10_000):
            bearing, distance = rng.uniform(-0.5, 0.5) * ARC, rng.uniform(*DISTANCE)
            height = rng.uniform(-0.35, 0.35) * distance  # within the camera's view
            radius = RING + distance
            centre = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
            reach = half + half_axes[: len(placed)]
            if not (np.abs(centre - np.reshape(placed, (-1, 3))) < reach).all(axis=1).any():
                placed.append(centre)
                break
        else:
            raise UserError(f"there is no room for {len(half_axes)} things; take fewer")
    return np.array(placed)


def camera_poses(keyframes: int, laps: float) -> np.ndarray:
    """(T, 4, 4) `T_world_camera` along the walls and back, `laps` times, swaying as a hand-held camera does."""
    way = np.linspace(0.0, 1.0, keyframes, endpoint=False)
    place = ARC / 2.0 * np.sin(2.0 * np.pi * laps * way)
    sway = 2.0 * np.pi * laps * way * np.array([[4.7], [3.1], [5.3]])
    heading = place + 0.35 * np.sin(sway[0])
    forward = np.stack([np.cos(heading), np.sin(heading), np.zeros(keyframes)], axis=1)
    radius, height = RING + 0.25 * np.sin(sway[1]), 0.15 * np.sin(sway[2])
    T = np.tile(np.eye(4), (keyframes, 1, 1))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = np.cross(forward, UP), -UP, forward
    T[:, :3, 3] = np.stack([radius * np.cos(place), radius * np.sin(place), height], axis=1)
    return T


def score_vector(world: World, thing: int, occlusion: float, rng: np.random.Generator) -> np.ndarray:
    """(K,) scores as a detector of 40 classes with sigmoid outputs gives them."""
    scores = np.minimum(rng.exponential(0.02, len(CLASSES)), 1.0)
    own, other = int(world.label[thing]), int(world.looks_like[thing])
    if thing < world.objects:
        named = own if rng.random() > 0.12 else other
        height = rng.normal(0.58 - 0.35 * occlusion, 0.18)
    else:
        named = other if rng.random() < 0.7 else int(rng.integers(0, len(CLASSES)))
        height = rng.normal(0.18, 0.10)
    scores[named] = np.clip(height, LiftingConfig().min_confidence, 0.99)
    return scores
