"""Hypothetical objects: a class, a place and a size each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class VolumeHypothesis:
    """One hypothetical object.

    Attributes:
        position: (3,) world, metres.
        log_size: (3,) log half-axes in the upright frame.
        class_id: k, column of the detector's scores.
        log_likelihood: nats against "nothing there but what looks like one", up to a constant.
        covariance: (3, 3) of the position, square metres.
        detection_of: (V, 5) detection that shows it in each view with each template (`VolumePart`), -1 none.
    """

    position: np.ndarray
    log_size: np.ndarray
    class_id: int
    log_likelihood: float
    covariance: np.ndarray
    detection_of: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Volumes:
    """N hypothetical objects, as arrays; whatever is not known yet is NaN, -1 or 0.

    Attributes:
        position: (N, 3) world, metres.
        log_size: (N, 3) log half-axes in the upright frame.
        class_id: (N,).
        detection_of: (N, V, 5).
        iterations: (N,) rounds of association and optimisation.
        settled: (N,) bool, whether the association had stopped changing.
        energy: (N,) of alignment and size at the end (`alignment.py`).
        covariance: (N, 3, 3) of the position by the energy's quadratic approximation, poses being exact; square metres.
        log_likelihood: (N,) nats.
    """

    position: np.ndarray
    log_size: np.ndarray
    class_id: np.ndarray
    detection_of: np.ndarray = field(default=None)  # type: ignore[assignment]
    iterations: np.ndarray = field(default=None)  # type: ignore[assignment]
    settled: np.ndarray = field(default=None)  # type: ignore[assignment]
    energy: np.ndarray = field(default=None)  # type: ignore[assignment]
    covariance: np.ndarray = field(default=None)  # type: ignore[assignment]
    log_likelihood: np.ndarray = field(default=None)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        N = len(self.position)
        unknown = {
            "detection_of": np.full((N, 0, 5), -1),
            "iterations": np.zeros(N, dtype=np.int64),
            "settled": np.zeros(N, dtype=np.bool_),
            "energy": np.full(N, np.nan),
            "covariance": np.full((N, 3, 3), np.nan),
            "log_likelihood": np.full(N, np.nan),
        }
        for name, value in unknown.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, n: int) -> VolumeHypothesis:
        return VolumeHypothesis(
            self.position[n],
            self.log_size[n],
            int(self.class_id[n]),
            float(self.log_likelihood[n]),
            self.covariance[n],
            self.detection_of[n],
        )

    def __iter__(self) -> Iterator[VolumeHypothesis]:
        return (self[n] for n in range(len(self)))

    def select(self, index: np.ndarray) -> Volumes:
        """Those that a boolean mask (N,) or indices (M,) name, in that order."""
        rows = np.arange(len(self))[index]
        return Volumes(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @classmethod
    def concatenate(cls, first: Volumes, second: Volumes) -> Volumes:
        """Both, in order; of the same views."""
        return cls(**{f.name: np.concatenate([getattr(first, f.name), getattr(second, f.name)]) for f in fields(cls)})
