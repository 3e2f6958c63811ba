"""How many dimensions a cloud of points fills, seen from the points themselves."""

from __future__ import annotations

import numpy as np

from softreach.arrays import Points

__all__ = ["lies_on_curve", "local_dimension"]

_SAMPLED = 512
_NEIGHBORS = 16


def lies_on_curve(points: Points) -> bool:
    """Whether neighbors of points are strung along a line, as the tips of one bundle are."""
    return local_dimension(points) < 1.5


def local_dimension(points: Points) -> float:
    """The power with which the number of neighbors grows with distance: 1 on a curve, 2, 3.

    The estimate of largest likelihood over the 16 nearest others of 512 points at most; its
    standard error is some percent. Bends and borders make it smaller, noise larger.

    Args:
        points: Positions, shape (n, 3); equal ones count once.

    Returns:
        The dimension [-]; 0 for fewer than 17 different points.

    References:
        Levina, Bickel (2004), Maximum likelihood estimation of intrinsic dimension, NIPS 17.
        MacKay, Ghahramani (2005), Comments on it: likelihoods are multiplied, not estimates added.
    """
    from scipy.spatial import KDTree  # lazily

    distinct = np.unique(points, axis=0)
    if len(distinct) <= _NEIGHBORS:
        return 0.0
    count = min(_SAMPLED, len(distinct))
    chosen = np.random.default_rng(0).choice(len(distinct), count, replace=False)
    distance = np.asarray(KDTree(distinct).query(distinct[chosen], k=_NEIGHBORS + 1)[0])[:, 1:]
    growth = np.log(distance[:, -1:] / distance[:, :-1]).sum()
    return float(count * (_NEIGHBORS - 1) / growth) if growth > 0 else 0.0  # one sets the scale
