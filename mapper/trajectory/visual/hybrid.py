"""The motion between two RGB-D images from all their pixels at once, for scenes whose geometry leaves a direction open.

Open3D's hybrid odometry aligns brightness and depth together (Park, Zhou and Koltun 2017; Steinbruecker et al. 2011):
before a bare wall the depth holds three directions, and what is painted on it the others. It weighs residuals of
brightness (black to white is 1) and of depth (metres) alike, whatever their noise. So its answer has the covariance

    H^-1 (sigma_I^2 n_I / N_I H_I + sigma_D^2 n_D / N_D H_D) H^-1,     H = H_I + H_D

with the Hessians of both (`image_information`, `point_to_plane_covariance`), their residuals' deviations, and the n
pixels of which only N count as independent: edges are blurred, and a depth camera errs alike over a whole wall.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from ....factors.plane_information import point_to_plane_covariance
from ...config import HybridConfig
from ..rgbd_view import RgbdView
from ..rigid import inverse, nearest_rigid, pose_covariance, rotation_angle
from .feature_motion import RelativePose
from .image_information import ImageInformation, image_information

DIGITS = 6  # of an answer's matrix; the optimisation is in single precision
WHITE = 255.0  # grey levels that Open3D takes for 1
TINY = 1e-12  # of the noise's trace: directions without any can be divided by
DEFAULTS = HybridConfig()
PACKAGES = "libusb-1.0-0 libegl1 libgl1 libx11-6 libudev1 libidn2-0 libgomp1"  # that Open3D needs


class HybridUnavailable(Exception):
    """Open3D cannot be loaded here, or cannot be held to one thread; the message says why and what to do."""


def hybrid_motion(
    a: RgbdView, b: RgbdView, T_guess: np.ndarray, config: HybridConfig = DEFAULTS
) -> RelativePose | None:
    """Pose of view b in view a, and its covariance; `inliers` are pixels.

    Args:
        a, b: of one camera.
        T_guess: (4, 4) `T_a_b` to start at, and that the answer must be near.

    Returns:
        None where too few pixels agree in depth, or all of them do not in brightness (bare walls look alike), or the
        motion is too far from the guess. Where neither depth nor brightness holds a direction there is an answer, whose
        covariance says so.

    Raises:
        HybridUnavailable: whatever the views.
    """
    o3d = _open3d()
    readings = int(np.count_nonzero((b.depth > 0.0) & (b.depth < config.depth_range[1])))
    if readings < config.min_inliers:
        return None
    with _one_thread(o3d):
        try:
            result = _align(o3d, a, b, nearest_rigid(T_guess), config)
        except RuntimeError:  # Open3D's for equations without a solution: nothing overlaps, or nothing is to be seen
            return None
    T, inliers = result.transformation.numpy(), round(result.fitness * b.depth.size)
    if not np.isfinite(T).all() or inliers < max(config.min_share * readings, config.min_inliers):
        return None
    T = nearest_rigid(np.round(T, DIGITS))
    correction = inverse(T_guess) @ T
    turned, moved = rotation_angle(correction[:3, :3]), float(np.linalg.norm(correction[:3, 3]))
    if turned > config.max_correction[0] or moved > config.max_correction[1]:
        return None
    image = image_information(a, b, T, config)
    if image.shift > config.max_shift:
        return None
    return RelativePose(T, _covariance(a, b, T, image, config), inliers)


def _align(o3d: ModuleType, a: RgbdView, b: RgbdView, T_guess: np.ndarray, config: HybridConfig) -> Any:
    """Open3D's result. Its "source to target" takes points of the source to the target: T_target_source."""
    odometry, Tensor = o3d.t.pipelines.odometry, o3d.core.Tensor
    return odometry.rgbd_odometry_multi_scale(
        source=_images(o3d, b),
        target=_images(o3d, a),
        intrinsics=Tensor(a.intrinsics.matrix),
        init_source_to_target=Tensor(T_guess),
        depth_scale=1.0,
        depth_max=config.depth_range[1],
        criteria_list=[odometry.OdometryConvergenceCriteria(n) for n in config.iterations],
        method=odometry.Method.Hybrid,
        params=odometry.OdometryLossParams(depth_outlier_trunc=config.max_distance),
    )


def _images(o3d: ModuleType, view: RgbdView) -> Any:
    color, depth = (np.ascontiguousarray(image) for image in (view.color, view.depth.astype(np.float32, copy=False)))
    image, Tensor = o3d.t.geometry.Image, o3d.core.Tensor
    return o3d.t.geometry.RGBDImage(image(Tensor(color)), image(Tensor(depth)))


def _covariance(
    a: RgbdView, b: RgbdView, T_a_b: np.ndarray, image: ImageInformation, config: HybridConfig
) -> np.ndarray:
    """(6, 6) in the right tangent of `T_a_b` (the module's equation); an open direction is as uncertain as a guess."""
    (_, points_a), (_, points_b) = (view.points(config.pixel_step, config.depth_range) for view in (a, b))
    H, noise = np.zeros((6, 6)), np.zeros((6, 6))
    if image.pixels:
        H_image = image.hessian / WHITE**2
        H += H_image
        noise += (image.sigma / WHITE) ** 2 * max(image.pixels / config.samples[0], 1.0) * H_image
    planes = point_to_plane_covariance(points_b, T_a_b, points_a)
    if planes.pairs:
        H_depth = planes.information * planes.residual_sigma_m**2 * len(points_b) / planes.pairs
        H += H_depth
        noise += planes.residual_sigma_m**2 * max(len(points_b) / config.samples[1], 1.0) * H_depth
    guess = np.linalg.inv(pose_covariance(config.guess_sigma))
    some_noise = noise + (TINY * np.trace(noise) + TINY) * np.eye(6)
    covariance = np.linalg.inv(H @ np.linalg.solve(some_noise, H) + guess)
    return covariance + pose_covariance(config.covariance_floor)


def _open3d() -> ModuleType:
    try:
        import open3d
    except (ImportError, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise HybridUnavailable(f"Open3D cannot be loaded ({reason}); on Debian: apt install {PACKAGES}") from None
    if not hasattr(open3d.utility, "set_max_threads"):
        raise HybridUnavailable(f"Open3D {open3d.__version__} cannot be held to one thread; install 0.20 or newer")
    return open3d


@contextmanager
def _one_thread(o3d: ModuleType) -> Iterator[None]:
    """One thread, and no warnings: threads add in different orders, and runs then differed by up to 0.2 mm."""
    threads = o3d.utility.get_max_threads()
    o3d.utility.set_max_threads(1)
    try:
        with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
            yield
    finally:
        o3d.utility.set_max_threads(threads)
