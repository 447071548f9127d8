"""What views say of class and existence."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...factors.free_space import FreeSpace


@dataclass(frozen=True, slots=True)
class BeliefConfig:
    """Class and existence: how much each kind of evidence counts."""

    view_angle: float = 0.17  # rad (10 degrees): views closer than this are not independent (Georgakis et al., eq. 2)
    view_log_range: float = 0.3  # the same for log distance
    repeat_correlation: float = 0.9  # of looks from the same place: at most 1.1 views' worth, however many
    size_outlier: float = 0.05  # objects of which only a part is ever measured, such as chairs pushed under a table
    site_tolerance: float = 0.05  # symmetric change of a size site below which it is left as it is
    size_coupling: bool = True  # off: sizes say nothing of classes, nor classes of sizes


@dataclass(frozen=True, slots=True)
class PresenceConfig:
    """When a thing that was there counts as taken away."""

    hazard: float = 1e-4  # probability of it between two looks: about seven clear looks make it likelier than not
    detected: float = 3.0  # nats, a detection against it; as many as one look through it says for it at most
    usual_most: float = (
        0.4  # share that a first look from somewhere may show and still be usual from there; tried: with
    )
    # 0.3 a thing that a detector hardly ever finds is lost before a still camera, with 0.5 a cup taken away is kept
    usual_free: float = 0.15  # share of an object's volume that is free, before it is known for the one at hand


@dataclass(frozen=True, slots=True)
class EvidenceConfig:
    """The likelihoods outside the graph; each says where its numbers come from.

    The switches turn a kind of evidence off, to measure what it is worth (benchmarks/run.py).
    """

    occlusion: bool = True  # off: as if nothing were ever hidden, nor seen through (Meger et al., Clutter, VI-C)
    misses: bool = True  # off: what should have been seen and was not says nothing
    depth: bool = True  # off: depth at an object's place says nothing for or against it
    parts: bool = True  # off: detections of object parts are not used
    model: str = ""  # path of an evidence model that `thingmap learn` wrote; "hog": of the shipped HOG detector;
    # "generic" for none; empty: what the detector says, else the shipped one for its classes, else the generic one
    free_space: FreeSpace = field(default_factory=FreeSpace)
    presence: PresenceConfig = field(default_factory=PresenceConfig)
