"""Numbers of how boxes are checked against labelled points."""

from __future__ import annotations

from dataclasses import dataclass

from ...datasets.errors import UserError


@dataclass(frozen=True, slots=True)
class ValidationConfig:
    """How a box is checked.

    Attributes:
        central: share of a box's width and height that is its central region: a quarter of its area, which lies on the
            object also where that is round.
        tolerance: metres that a point may be off the depth measured where it appears: one behind is hidden, one in
            front is not there any more. Two voxels, the noise of a Kinect at 2 m, and slant.
        share: of the points in the whole box, from which on its own label keeps it too: what stands before an object
            hides its middle. (The paper's rule is the middle alone.) On two training tables with simulated boxes that
            lost 8 and 12 points of recall, and with this 0 and 2; false boxes went the same. 0.1 to 0.3 are alike.
        doubt: nats of one look, see `PointLabels`: a point for whose label less speaks may be its second. What is
            found in every third view is labelled away by a little, a wall by 1.2. On seven training tables with HOG
            boxes (most recall 73.0 %) the most recall after was 68.6 % by labels alone, 69.2 with 0.3, 69.6 with 0.6,
            69.9 with 0.9, mean AP 62.2, 62.5, 62.7, 62.8, and precision at 60 % recall 85.9, 85.5, 85.0, 84.6 (73.1
            before). 0: only a point whose label its neighbours have decided.
        least_points: in the central region, below which nobody knows, and the box stays.
        same: intersection over union of a box and the extents of a thing's points, from which on both are of the same
            outline. 0.3 and 0.4 are alike.
        drawn: share of the way from its own place to these extents that such a box is drawn at: both are measured. On
            twelve training tables with HOG boxes mean AP was 80.9 % with 0, 81.7 with 0.5, and 81.9 with 0.7 if points
            at the ends are left out; by labels alone 81.0, and before 81.0.
        least_own: points of a thing in the image, below which they have no extents.

    Raises:
        UserError: for a value out of range.
    """

    central: float = 0.5
    tolerance: float = 0.04
    share: float = 0.2
    doubt: float = 0.6
    least_points: int = 3
    same: float = 0.3
    drawn: float = 0.5
    least_own: int = 8

    def __post_init__(self) -> None:
        positive = self.share > 0.0 and self.tolerance > 0.0 and self.least_points >= 1 and self.least_own >= 1
        shares = 0.0 < self.central <= 1.0 and 0.0 < self.same <= 1.0 and 0.0 <= self.drawn <= 1.0
        if not (shares and positive and self.doubt >= 0.0):
            expected = "central and same in (0, 1], drawn in [0, 1], share and tolerance > 0, doubt >= 0, least_* >= 1"
            raise UserError(f"expected {expected}, but got {self}")
