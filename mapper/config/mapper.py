"""Everything together."""

from __future__ import annotations

from dataclasses import dataclass, field

from .back_end import CorrectionConfig, LifecycleConfig, SmootherConfig
from .batch import BatchConfig
from .evidence import BeliefConfig, EvidenceConfig
from .keyframes import HybridConfig, KeyframeConfig, ScanConfig, SparseConfig, VisualConfig
from .loops import ConstellationConfig, LoopConfig, PlaceConfig
from .multiview import MultiViewConfig
from .odometry import OdometryConfig
from .views import AssociationConfig, LiftingConfig, TrackConfig, UpConfig


@dataclass(frozen=True, slots=True)
class CloudConfig:
    """The coloured cloud that is written beside the map."""

    voxel_size: float = 0.02  # m
    pixel_step: int = 4
    max_range: float = 4.0  # m


@dataclass(frozen=True, slots=True)
class MapperConfig:
    """Everything together."""

    seed: int = 0
    class_sizes: str = ""  # path of an own YAML of class sizes, added to the shipped one
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    visual: VisualConfig = field(default_factory=VisualConfig)
    scans: ScanConfig = field(default_factory=ScanConfig)
    sparse: SparseConfig = field(default_factory=SparseConfig)
    hybrid: HybridConfig = field(default_factory=HybridConfig)
    keyframes: KeyframeConfig = field(default_factory=KeyframeConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    places: PlaceConfig = field(default_factory=PlaceConfig)
    constellation: ConstellationConfig = field(default_factory=ConstellationConfig)
    up: UpConfig = field(default_factory=UpConfig)
    lifting: LiftingConfig = field(default_factory=LiftingConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    tracks: TrackConfig = field(default_factory=TrackConfig)
    beliefs: BeliefConfig = field(default_factory=BeliefConfig)
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    corrections: CorrectionConfig = field(default_factory=CorrectionConfig)
    batch: BatchConfig = field(default_factory=BatchConfig)
    multiview: MultiViewConfig = field(default_factory=MultiViewConfig)
    cloud: CloudConfig = field(default_factory=CloudConfig)
