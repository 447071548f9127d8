"""Joint covariances of any variables of a graph, from one sparse factorisation.

ISAM2's own `jointMarginalCovariance` costs 0.5-0.9 s a pair at 300 to 1000 keyframes, unless both are near its root.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu


class JointMarginals:
    """Columns of the inverse of J^T J.

    Args:
        graph: factors; robust ones count with the weights that they have at `values`.
        values: where they are linearised, the optimum; a value for every variable of the graph and no more.
    """

    def __init__(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
        keys, tangents = values.keys(), values.zeroVectors()
        self._columns, size = {}, 0
        for key in keys:
            width = len(tangents.at(key))
            self._columns[key] = np.arange(size, size + width)
            size += width
        # counted from 1, variables in the order of their keys; the last column is the right-hand side
        rows, columns, entries = graph.linearize(values).sparseJacobian_()
        jacobian = csc_matrix((entries, (rows.astype(int) - 1, columns.astype(int) - 1)))[:, :size]
        # a symmetric ordering and no pivoting make it as good as a Cholesky factorisation, which scipy has not
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        self._factors, self._size = splu((jacobian.T @ jacobian).tocsc(), **options), size

    def covariance(self, keys: Sequence[int]) -> np.ndarray:
        """(D, D) of the variables' tangents, in the order of `keys`."""
        columns = np.concatenate([self._columns[key] for key in keys])
        unit = np.zeros((self._size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        joint = self._factors.solve(unit)[columns]
        return (joint + joint.T) / 2.0
