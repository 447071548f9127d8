"""Which frames become keyframes, and how two of them are matched."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class KeyframeConfig:
    """A frame becomes a keyframe when the camera has moved this far from the last one."""

    translation: float = 0.06  # m; about 3 degrees of parallax at 1.2 m
    rotation: float = 0.09  # rad (5 degrees)
    max_gap: int = 15  # frames (0.5 s at 30 Hz): a still camera still contributes
    lost_gap: int = 5  # frames while LOST: the motion is a guess, and images a few frames apart may bridge it


@dataclass(frozen=True, slots=True)
class VisualConfig:
    """ORB features with depth between neighbouring keyframes, beside KISS-ICP."""

    enabled: bool = True
    features: int = 1000
    fast_threshold: int = 10  # grey levels
    few_features: int = 600  # below which faint ones are looked for; a kitchen's frames have 670 to 960, before a plain
    # cabinet in an empty hall 50 to 660: with faint ones 55 of 57 steps of 0.2 m were measured there, else 33
    faint_features: int = 2000
    faint_threshold: int = 4  # grey levels
    neighbours: int = 1  # keyframes back that a new one is measured against; wider baselines match worse points
    ratio: float = 0.85  # of Lowe's test
    inlier_distance: float = 0.03  # m at 1 m and nearer, growing with z: three times a Kinect's depth noise at 2 m
    min_inliers: int = 30
    depth_range: tuple[float, float] = (0.3, 4.0)  # m
    gate: float = 22.46  # chi-square, 6 degrees of freedom, 99.9 %: odometry that contradicts features is doubted
    covariance_floor: tuple[float, float] = (0.003, 0.004)  # rad, m: colour is only roughly registered to depth


@dataclass(frozen=True, slots=True)
class SparseConfig:
    """Frames far apart in time, such as keyframes that another system chose; measured on 58 of TUM's fr3_cabinet."""

    interval: float = 0.2  # s between frames, in the median of the last `intervals`, from which they are far apart
    intervals: int = 5
    memory: int = 60  # values: a comparison gives up to three
    limit: tuple[float, float] = (0.03, 0.03)  # rad, m: deviation claimed along a direction, above which it is open
    prior: tuple[float, float] = (0.015, 0.02)  # rad, m: what links lack before anything is compared
    step_factor: float = 4.0  # of what links lack, in steps: there up to 0.15 rad and 0.16 m
    doubtful: float = 0.006  # rad that links lack, below which they are believed: rendered ones up to 0.004
    neighbours: int = 6  # keyframes back that features are matched with if not, instead of `visual.neighbours`
    # and instead of what `LoopConfig` says of links by depth: what one link lacks, many average out. ATE of the cabinet
    # 4.1 cm (small-gicp 3.1) with `LoopConfig`'s, 3.4 (2.4) by these ages and this reach, 2.8 (2.0) with `known` too
    link_ages: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 40)
    link_skip: int = 1
    link_reach: tuple[float, float] = (1.0, 1.0)  # rad, m
    link_known: tuple[float, float] = (0.06, 0.1)  # rad, m; depth is matched from guesses up to 0.08 m off


@dataclass(frozen=True, slots=True)
class ScanConfig:
    """Matching the depth of two keyframes by GICP; measured on rendered hand-held sequences and redkitchen."""

    spacing: float = 0.03  # m between points: 1.4 mm median error; 0.04: 1.9, 0.025: 1.2 at twice the time
    neighbours: int = 20  # points that a point's plane is fitted to; with 10 a table-top's noise lets it slip
    reaches: tuple[float, ...] = (0.08, 0.04)  # m, partners are looked for within, first and last
    max_iterations: int = 20  # each
    min_share: float = 0.4  # of the smaller scan's points that must have a partner
    degenerate_ratio: float = 0.02  # of the translation's eigenvalues, as GicpConfig.degenerate_ratio
    open_sigma: float = 0.2  # m, along what planes leave open: before one side of a cabinet matches slid 0.1-0.4 m
    inflation: float = 0.35  # of the point-to-plane covariance: all points were matched, not its sample
    covariance_floor: tuple[float, float] = (0.0003, 0.0005)  # rad, m


@dataclass(frozen=True, slots=True)
class HybridConfig:
    """Open3D's hybrid RGB-D odometry between keyframes; measured on rendered hand-held pairs and redkitchen."""

    enabled: bool = True  # of use where geometry is degenerate only
    iterations: tuple[int, ...] = (20, 10, 5, 2)  # coarsest to full resolution; with three levels 20 px are too far
    max_distance: float = 0.07  # m between two depths of one pixel, beyond which one hides the other
    depth_range: tuple[float, float] = (0.3, 4.5)  # m
    min_share: float = 0.5  # of b's depth readings that must agree
    max_shift: float = 1.5  # px between edges of equal brightness: right motions at most 0.3 (rendered), wrong ones 2-9
    min_inliers: int = 1000  # pixels
    max_correction: tuple[float, float] = (0.3, 0.3)  # rad, m: an answer this far from the guess is a wrong one
    pixel_step: int = 4  # px between the points that the covariance is computed from
    blur: float = 1.5  # px, before brightness gradients are taken
    min_gradient: float = 1.0  # grey levels a pixel, what noise leaves after that blur
    # pixels of brightness, of depth, that count as independent: NEES per dof 0.95 on rendered pairs of a wall, 1.7 on
    # redkitchen (its poses taken as known to 4 mrad, 5 mm), where colour lies beside depth; 0.1 on a rendered table-top
    samples: tuple[int, int] = (30, 4)
    covariance_floor: tuple[float, float] = (0.0002, 0.0002)  # rad, m
    guess_sigma: tuple[float, float] = (0.1, 0.2)  # rad, m, where nothing is to be seen
