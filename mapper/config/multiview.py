"""The multi-view mode of Georgakis et al.: tracks by 3D centroids."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MultiViewConfig:
    """Proposals linked over views (`run --inference tracks`; Georgakis et al., sections III-B and IV).

    Only `min_share` and the uniform start of Bayes' rule are the paper's; it names no other number.

    Raises:
        ValueError: a value is out of its range.
    """

    # m, from a track's centroid to that of a detection of the same thing. Centroids are of what is seen, and move as
    # the camera goes round. With masks, best F1 on nine rendered tables was .66, .69 and .70 at 0.06, 0.14 and 0.2;
    # boxes without masks want 0.06: their detections of neighbours lie closer.
    max_distance: float = 0.14
    min_share: float = 0.6  # of the views in which a track could be seen; the paper's is of all frames of a scene
    min_views: int = 1  # in which a track was seen; the paper asks for the share only
    least_probability: float = 1e-3  # of any class in any view, the background among them
    far: float = 4.0  # m along z, as ProposalConfig.far: readings beyond are not taken, nor is anything expected there
    margin: float = 0.05  # of width and height: a centroid this close to the border need not be seen
    hidden: float = 0.08  # m that something must be nearer than a centroid to hide it: half a bowl is its own surface
    window: int = 3  # stored pixels, odd: side of the square whose median depth says what is before a centroid
    pixel_step: int = 4  # every 4th row and column of a view is kept: 77 kB a view of 640 x 480
    points: int = 200  # kept of a detection, at most, for place and size
    extent: tuple[float, float] = (2.0, 98.0)  # percentiles of a track's points along an axis, where its box ends
    same_surface: float = 0.03  # m between a point of the cloud and a view's depth at which the view sees the point

    def __post_init__(self) -> None:
        def check(name: str, valid: bool, expected: str) -> None:
            if not valid:
                raise ValueError(f"{name} must be {expected}, but got {getattr(self, name)}")

        for name in ("max_distance", "far"):
            check(name, getattr(self, name) > 0.0, "positive")
        for name in ("hidden", "same_surface"):
            check(name, getattr(self, name) >= 0.0, "at least 0")
        for name in ("min_views", "pixel_step", "points"):
            check(name, getattr(self, name) >= 1, "at least 1")
        check("min_share", 0.0 <= self.min_share <= 1.0, "in [0, 1]")
        check("least_probability", 0.0 < self.least_probability < 0.1, "above 0 and below 0.1")
        check("margin", 0.0 <= self.margin < 0.5, "at least 0 and below 0.5")
        check("window", self.window >= 1 and self.window % 2 == 1, "an odd number")
        check("extent", 0.0 <= self.extent[0] < self.extent[1] <= 100.0, "two growing percentiles")
