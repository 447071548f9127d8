"""Every number of the mapper: its default, its unit and where it came from.

One YAML file may override any of it (`config_file.load_config`); its keys are the field names below.
"""

from __future__ import annotations

from .back_end import CorrectionConfig, LifecycleConfig, SmootherConfig
from .batch import BatchConfig, ScorePotential
from .evidence import BeliefConfig, EvidenceConfig, PresenceConfig
from .keyframes import HybridConfig, KeyframeConfig, ScanConfig, SparseConfig, VisualConfig
from .loops import ConstellationConfig, LoopConfig, PlaceConfig
from .mapper import CloudConfig, MapperConfig
from .multiview import MultiViewConfig
from .odometry import FlowConfig, GicpConfig, LidarConfig, OdometryConfig, OdometrySource
from .views import AssociationConfig, LiftingConfig, TrackConfig, UpConfig

__all__ = [
    "AssociationConfig",
    "BatchConfig",
    "BeliefConfig",
    "CloudConfig",
    "ConstellationConfig",
    "CorrectionConfig",
    "EvidenceConfig",
    "FlowConfig",
    "GicpConfig",
    "HybridConfig",
    "KeyframeConfig",
    "LidarConfig",
    "LifecycleConfig",
    "LiftingConfig",
    "LoopConfig",
    "MapperConfig",
    "MultiViewConfig",
    "OdometryConfig",
    "OdometrySource",
    "PlaceConfig",
    "PresenceConfig",
    "ScanConfig",
    "ScorePotential",
    "SmootherConfig",
    "SparseConfig",
    "TrackConfig",
    "UpConfig",
    "VisualConfig",
]
