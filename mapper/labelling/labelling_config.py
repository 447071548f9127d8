"""The numbers of labelling every point."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...datasets.errors import UserError
from ...detectors.hog.maps import MapConfig
from ...detectors.probability_maps import ALPHA
from .box_config import BoxConfig
from .instance_config import InstanceConfig
from .mrf_config import MrfConfig
from .voxel_config import VoxelConfig


@dataclass(frozen=True, slots=True)
class SourceConfig:
    """How detections become probabilities of pixels, and things those of voxels.

    Attributes:
        near: metres along z, of the readings that are looked at: no depth camera measures nearer.
        far: metres along z; at 4 m a Kinect's depth is off by 2 cm.
        alpha: of the background's probability (Lai et al., eq. 5), as in the paper.
        gamma: 1/m^2, of eq. (12), as for HOG's maps.
        refined_from: probability from which a detection is believed to show where its object is, as for HOG's maps.
        least: probability of a class that nothing speaks for, and of anything else than one that all speaks for: a
            detector that misses an object in a few views must not outvote those in which it found it. Macro F of three
            training tables, simulated boxes without / with volumes: .922 / .931 with 0.01, .915 / .931 with 0.02,
            .912 / .913 with 0.03, .871 / .902 with 0.06; seldom found objects gain by more, false ones too.
        least_maps: the same where the detector makes maps itself: those of HOG are silent in more views. Four tables:
            .734 / .740 with 0.01, .775 / .777 with 0.03, .797 / .741 with 0.06.
        volumes: how much the volumes of the map's things count, as a share of a detection's count (both in logarithms);
            0 leaves them out. They stem from the same detections, so that together they must not count twice.

    Raises:
        UserError: for a value out of range.
    """

    near: float = 0.2
    far: float = 4.0
    alpha: float = ALPHA
    gamma: float = MapConfig().gamma
    refined_from: float = MapConfig().refined_from
    least: float = 0.02
    least_maps: float = 0.03
    volumes: float = 0.5

    def __post_init__(self) -> None:
        if not (0.0 <= self.near < self.far and self.gamma >= 0.0 and self.volumes >= 0.0):
            raise UserError(f"expected 0 <= near < far, gamma >= 0 and volumes >= 0, but got {self}")
        if not (0.0 < self.alpha <= 1.0 and 0.0 <= self.refined_from <= 1.0):
            raise UserError(f"expected alpha in (0, 1] and refined_from in [0, 1], but got {self}")
        if not (0.0 < self.least < 0.5 and 0.0 < self.least_maps < 0.5):
            raise UserError(f"expected least and least_maps between 0 and 0.5, but got {self}")


@dataclass(frozen=True, slots=True)
class LabellingConfig:
    """Everything that labelling needs to know.

    Attributes:
        stride: every so many of the mapped frames are looked at; 10 as in Lai et al., IV-A.
        sources: of evidence.
        voxels: in which it is gathered.
        mrf: what makes labels of it.
        instances: how labelled voxels become points of things.
        boxes: how boxes are fitted to those.
        moved: metres, and
        turned: radians, by which a frame may have moved against its keyframe without being looked at again: half a
            voxel at 3 m.

    Raises:
        UserError: for a value out of range.
    """

    stride: int = 10
    sources: SourceConfig = field(default_factory=SourceConfig)
    voxels: VoxelConfig = field(default_factory=VoxelConfig)
    mrf: MrfConfig = field(default_factory=MrfConfig)
    instances: InstanceConfig = field(default_factory=InstanceConfig)
    boxes: BoxConfig = field(default_factory=BoxConfig)
    moved: float = 0.003
    turned: float = 0.0015

    def __post_init__(self) -> None:
        if not (self.stride >= 1 and self.moved >= 0.0 and self.turned >= 0.0):
            raise UserError(f"expected a stride of at least 1 and no negative tolerance, but got {self}")
