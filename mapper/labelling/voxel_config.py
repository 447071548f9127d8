"""The numbers of the voxels in which evidence is gathered."""

from __future__ import annotations

from dataclasses import dataclass

from ...datasets.errors import UserError


@dataclass(frozen=True, slots=True)
class VoxelConfig:
    """How fine voxels are, how many classes each keeps apart, how long a submap goes on, and what memory may hold.

    Attributes:
        voxel_size: metres, the edge; 0.01 as in Lai et al., IV.
        pixel_step: every so many pixels of every so many rows are looked at: at 3, a voxel 1 m from a Kinect has three
            of each frame, one 2 m away has one. 2 takes 2.2 times as long and labels three training tables no better
            (macro F .863 and .858).
        kept_classes: classes that a voxel keeps apart; with no more in all nothing is lost, see `class_slots`. Eight
            hold the few that detectors confuse with each other.
        submap_radius: metres from its anchor, beyond which a camera's frames begin a new submap: half the range.
        submap_keyframes: after which a new submap begins. 20 of 6 cm or 5 degrees are a metre or a quarter turn, over
            which odometry drifts by less than a voxel.
        submap_voxels: from which on a new submap begins: the bound on the memory of the one that grows.
        memory: bytes of finished submaps; beyond, the oldest go to the disk.

    Raises:
        UserError: for a value out of range.
    """

    voxel_size: float = 0.01
    pixel_step: int = 3
    kept_classes: int = 8
    submap_radius: float = 1.5
    submap_keyframes: int = 20
    submap_voxels: int = 500_000
    memory: int = 256_000_000

    def __post_init__(self) -> None:
        if not (0.0 < self.voxel_size < float("inf") and self.submap_radius >= 0.0):
            raise UserError(f"expected a finite voxel_size > 0 and a submap_radius >= 0, but got {self}")
        if min(self.pixel_step, self.kept_classes, self.submap_keyframes, self.submap_voxels) < 1 or self.memory < 0:
            raise UserError(f"expected whole numbers of at least 1, and memory of at least 0, but got {self}")
        if self.kept_classes > 127:
            raise UserError(f"expected kept_classes of at most 127, but got {self.kept_classes}")
