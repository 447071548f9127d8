"""From a keyframe's image to measurements of things, and which thing each is of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class UpConfig:
    """The up direction of the world, a variable of the graph."""

    prior_sigma: float = 0.6  # rad, a hand-held camera is roughly upright
    plane_sigma: float = 0.2  # rad; a room's normals are off by 1-4 degrees together, so each must say little
    accelerometer_sigma: float = 0.08  # rad, hand accelerations of about 0.8 m/s^2
    gravity_sigma: float = 0.01  # rad, a gravity file
    scanner_sigma: float = 0.1  # rad, a LiDAR stands upright on what carries it
    max_tilt: float = 0.8  # rad, planes further than this from the current up are not supports (walls)
    min_plane_share: float = 0.06  # of the valid pixels
    every: int = 2  # keyframes between plane searches (9 ms each)
    upright_tolerance: float = 0.026  # rad (1.5 degrees): volumes are turned when up has moved further


@dataclass(frozen=True, slots=True)
class LiftingConfig:
    """From a 2D box and the depth map to a 3D measurement."""

    min_confidence: float = 0.08  # boxes below it are noise; low, because misses are counted as evidence too
    central_share: float = 0.5  # of width and height: the part of the box whose depth is read
    min_readings: int = 12  # pixels with depth
    max_range: float = 6.0  # m, beyond it Kinect depth is worse than 10 cm
    surface_offset: float = 0.7  # of the half depth, from that surface to the centre: 1 for a box, 0 for a flat thing
    border: int = 3  # px: a box side this close to the image border is cut off by it
    sigma_px: float = 2.5  # px, floor of a box side's noise
    sigma_relative: float = 0.06  # of the box's side lengths: noise of a box side grows with the box
    sigma_tangential: float = 0.3  # of the half extents: a box's centre is this close to the object's
    sigma_range: float = 1.5  # of the object's assumed half depth; views share the error, so each must say little
    noise_floor: float = 0.0  # m, the sensor's at any range: a LiDAR's 0.02
    sensor_noise: float = 0.0028  # m at 1 m, growing with z^2 (Khoshelham and Elberink 2012: 1.425 mm/m^2 a reading)


@dataclass(frozen=True, slots=True)
class AssociationConfig:
    """Which detection shows which landmark: box overlap, depth position, class as evidence and never as a gate."""

    gate: float = 16.27  # chi-square, 3 degrees of freedom, 99.9 %
    centre_variance: float = 0.25  # of the box scale squared (Meger et al., Clutter, footnote 2)
    scale_variance: float = 0.1  # of log scale; 0.5 in the same place, for a detector with coarser boxes
    min_visible: float = 0.1  # landmarks seen less than this are not associated
    new_cost: float = 14.0  # nats-like cost at which a detection is rather something new
    class_weight: float = 0.5  # views share errors, so a view's class evidence counts half
    duplicate_overlap: float = 0.55  # share of a box inside an explained one at the same place: the same object again
    duplicate_scale: float = 0.35  # of the projected box's side: smaller boxes are other things or parts
    position_floor: float = 0.03  # m, pose error between a view and the landmarks of older views


@dataclass(frozen=True, slots=True)
class TrackConfig:
    """Candidates, followed by a Kalman filter until they earn a landmark."""

    min_existence: float = 0.3  # probability that it is an object, from which it is a landmark however few its views
    min_hits: int = 3  # keyframes that make it a landmark however doubtful
    min_hit_rate: float = 0.3  # hits / keyframes in which it should have been seen
    max_misses: int = 6  # keyframes in a row where it should have been seen
    process_sigma: float = 0.01  # m per keyframe, odometry drift against the map
