"""Labels of voxels: the random field of Lai et al. over what was gathered of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...datasets.truth import NO_OBJECT
from ..map.labels_file import PointLabels
from .energy import PottsEnergy
from .minimise import minimise
from .mrf_config import MrfConfig, Smoothness
from .neighbours import neighbour_pairs
from .pairwise import pair_weights
from .voxel_normals import surface_normals
from .voxels import Voxels


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """What every voxel is.

    Attributes:
        label: (N,) int64 index into the classes, `NO_OBJECT` for background.
        second: (N,) the same: what the voxel's own evidence says next to its label, or rather than that.
        margin: (N,) float32 nats of one look, by which the voxel's own evidence is for `label` and not for `second`;
            below 0 where the neighbours have decided.
        pairs: of voxels that touch and are asked to agree.
        energy: of the labels, nats (eq. 1).
        gap: by which share of its lower bound the energy may be too high at most; None where no bound was asked for.
        settled: whether the search ended by itself.
    """

    label: np.ndarray
    second: np.ndarray
    margin: np.ndarray
    pairs: int
    energy: float
    gap: float | None
    settled: bool

    def of_points(self, instance: np.ndarray | None = None) -> PointLabels:
        """What labels.ply says of the voxels, a point each; with (N,) numbers of their things where these are known."""
        return PointLabels(self.label, self.second, self.margin, instance)


def label_voxels(voxels: Voxels, config: MrfConfig, more: np.ndarray | None = None) -> Labels:
    """The labels of least energy that are found.

    The data term of a voxel is the negative mean log probability of its points (eq. 7); of several sources their sum.

    Args:
        voxels: N of them, with the evidence of K classes.
        config: the pairwise term and how to minimise.
        more: (N, K + 1) log probabilities of another source, weighted as it shall count.
    """
    background = voxels.log_p.shape[1] - 1
    log_p = voxels.log_p if more is None else voxels.log_p + more
    has_pairs = config.smoothness is not Smoothness.NONE
    edges = neighbour_pairs(voxels.cells) if has_pairs else np.empty((0, 2), np.int32)
    normals = voxels.normals
    if config.smoothness is Smoothness.NORMALS:
        normals = surface_normals(voxels.cells, normals, config.normals_radius, config.normals_agreement)
    weights = pair_weights(edges, voxels.cells, voxels.points / voxels.size, normals, voxels.colours, config)
    found = minimise(PottsEnergy(-log_p.astype(np.float32), edges, weights), config)
    label = found.labelling.labels.astype(np.int64)
    second, margin = _runners_up(log_p, label)
    return Labels(
        label=np.where(label == background, NO_OBJECT, label),
        second=np.where(second == background, NO_OBJECT, second),
        margin=margin,
        pairs=len(edges),
        energy=found.labelling.energy,
        gap=found.gap,
        settled=found.labelling.settled,
    )


def _runners_up(log_p: np.ndarray, label: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) the likeliest columns of (N, L) other than (N,) labels, and (N,) by how much less likely they are."""
    rows = np.arange(len(log_p))
    others = log_p.copy()
    others[rows, label] = -np.inf
    second = others.argmax(axis=1)
    return second, (log_p[rows, label] - others[rows, second]).astype(np.float32)
