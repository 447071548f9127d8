"""A scene filmed on its way: frames rendered when they are asked for, with everything that is true about them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame import Frame, Intrinsics
from ..truth import FrameTruth, PointTruth, TrueObject
from .config import SyntheticConfig
from .motion.camera_paths import camera_path
from .rendering.camera import ColorCamera, develop, drifting_gains, exposure_poses
from .rendering.labelled_cloud import labelled_cloud
from .rendering.render import Cast, Renderer, Rendering
from .rendering.sensor import DepthSensor, measure
from .rendering.silhouettes import Silhouettes
from .scene import Scene, build_scene
from .synth import synth_line

KEPT_CASTS = 8  # of about 5 MB; the truth of a frame that was read some frames ahead then costs no second cast


class RenderedSequence:
    """A scene seen by a depth camera. See `Sequence`, `HasTruth`, `HasClutter`, `HasInstances`, `HasPointTruth`.

    A frame is rendered when it is asked for and depends on what the sequence was made of and its index only, so that
    several threads may ask at once. World axes: z up, floor at z = 0. `poses` are ground truth; `gravity` is None, so
    that up has to be estimated. Subclasses say how they are pickled: ray casters cannot be sent to another process.

    Args:
        name: for people.
        scene: what is seen.
        width: pixels, divisible by 4; images are 4:3 with the field of view of f = 525 at 640 x 480.
        stamps: (M,) seconds.
        poses: (M, 4, 4) `T_world_camera`.
        frames: how many of them are frames; those after tell where the camera goes on moving.
        seed: of all noise and drift.
        sensor: the depth sensor.
        camera: the colour camera.
        blur: renderings that are averaged over the exposure for motion blur; 0 or 1 for none. Depth has none.

    Attributes:
        scene: what is seen.
        objects: things of `classes`.
        clutter: things of no class, numbered on from the objects; they are not in `objects`.
    """

    def __init__(
        self,
        *,
        name: str,
        scene: Scene,
        width: int,
        stamps: np.ndarray,
        poses: np.ndarray,
        frames: int,
        seed: int,
        sensor: DepthSensor,
        camera: ColorCamera,
        blur: int = 0,
    ) -> None:
        self.name, self.scene = name, scene
        self.intrinsics = kinect_camera(width)
        self.stamps, self.poses = stamps[:frames], poses[:frames]
        self.names = tuple(f"frame-{index:06d}" for index in range(frames))
        self.gravity = None
        self.objects: tuple[TrueObject, ...] = scene.objects
        self.clutter: tuple[TrueObject, ...] = scene.clutter
        self.classes: tuple[str, ...] = scene.classes
        self._path = stamps, poses
        self._seed, self._sensor, self._camera, self._blur = seed, sensor, camera, blur
        self._renderer = Renderer(scene.surfaces, scene.lights)
        self._silhouettes = Silhouettes(scene.objects, scene.surfaces)
        self._gains = drifting_gains(camera, self.stamps, seed)
        self._casts: dict[int, Cast] = {}
        self._point_truth: PointTruth | None = None

    def __len__(self) -> int:
        return len(self.stamps)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        index = self._checked(index)
        still = self._render(index)
        color_noise, depth_noise = (np.random.default_rng([self._seed, key, index]) for key in (3, 4))
        return Frame(
            index=index,
            name=self.names[index],
            stamp=float(self.stamps[index]),
            color=develop(self._exposed(index, still), self._gains[index], self._camera, color_noise),
            depth=measure(still.depth, still.incidence, self.intrinsics, self._sensor, depth_noise),
            intrinsics=self.intrinsics,
            T_world_camera=self.poses[index].copy(),
        )

    def truth(self, index: int) -> FrameTruth:
        """What can be seen of every object; exact for the rendered geometry."""
        index = self._checked(index)
        return self._silhouettes.measure(self.intrinsics, self.poses[index], self._cast(index))

    def instances(self, index: int) -> np.ndarray:
        """(H, W) int32: `id` of the object or clutter that every pixel shows, `NO_OBJECT` for the room."""
        seen = self._silhouettes.instances(self._cast(self._checked(index)))
        return seen.reshape(self.intrinsics.height, self.intrinsics.width)

    def true_depth(self, index: int) -> np.ndarray:
        """(H, W) float32 metres along z without the sensor's effects."""
        return self._render(self._checked(index)).depth

    def point_truth(self) -> PointTruth:
        """The surfaces that come within the sensor's range, in voxels of a centimetre; see `labelled_cloud`."""
        if self._point_truth is None:
            reach = (self._sensor.near, self._sensor.far) if self._sensor.range_limits else (0.0, np.inf)
            self._point_truth = labelled_cloud(
                self._renderer, self.scene.surfaces, self.intrinsics, self.poses, self.objects, self.classes, reach
            )
        return self._point_truth

    def _exposed(self, index: int, still: Rendering) -> np.ndarray:
        """(H, W, 3) radiance, the mean over the exposure."""
        if self._blur <= 1:
            return still.radiance
        total = np.zeros_like(still.radiance)
        for pose in exposure_poses(*self._path, index, self._camera.shutter, self._blur):
            if np.array_equal(pose, self.poses[index]):
                total += still.radiance
            else:
                cast = self._renderer.cast(self.intrinsics, pose)
                total += self._renderer.render(self.intrinsics, pose, cast).radiance
        return total / np.float32(self._blur)

    def _render(self, index: int) -> Rendering:
        return self._renderer.render(self.intrinsics, self.poses[index], self._cast(index))

    def _checked(self, index: int) -> int:
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.name} has {len(self)} frames, asked for {index}")
        return index % len(self)

    def _cast(self, index: int) -> Cast:
        cast = self._casts.get(index)
        if cast is None:
            cast = self._casts[index] = self._renderer.cast(self.intrinsics, self.poses[index])
            for old in list(self._casts)[:-KEPT_CASTS]:
                self._casts.pop(old, None)
        return cast


class SyntheticSequence(RenderedSequence):
    """The sequence that a configuration describes; its name is the line that `synth.open_synth` reads.

    Raises:
        UserError: the scene cannot be built: too many things for its places, or unusable meshes.
    """

    def __init__(self, config: SyntheticConfig) -> None:
        self.config = config
        stamps, poses = camera_path(config.preset, config.frame_count + 1, config.seed, config.pace)
        super().__init__(
            name=synth_line(config),
            scene=build_scene(config),
            width=config.width,
            stamps=stamps,
            poses=poses,
            frames=config.frame_count,
            seed=config.seed,
            sensor=config.sensor,
            camera=config.camera,
            blur=config.blur,
        )

    def __reduce__(self):
        """Pickle the recipe."""
        return SyntheticSequence, (self.config,)


def kinect_camera(width: int) -> Intrinsics:
    """A 4:3 image with the field of view of f = 525 at 640 x 480."""
    scale = width / 640.0
    focal = 525.0 * scale
    return Intrinsics(width, width * 3 // 4, focal, focal, 320.0 * scale - 0.5, 240.0 * scale - 0.5)
