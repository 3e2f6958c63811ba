"""Choosing points that lie apart, best first."""

from __future__ import annotations

from softreach.kernels.compiler import kernel

__all__ = ["choose_apart"]


@kernel
def choose_apart(points, scales, most, least_distance, chosen):
    """Choose each point that lies apart from those chosen before it, until there are `most`.

    Args:
        points: Candidates of each set, best first, shape (t, k, m).
        scales: By which distances along each axis are measured, shape (m,).
        most: Largest number of one set.
        least_distance: The largest component of the distance between two is to exceed it.
        chosen: Whether each is chosen, shape (t, k).
    """
    for t in range(points.shape[0]):
        count = 0
        for k in range(points.shape[1]):
            apart = count < most
            for i in range(k):
                if not apart:
                    break
                if chosen[t, i]:
                    distance = 0.0
                    for j in range(points.shape[2]):
                        distance = max(distance, abs(points[t, i, j] - points[t, k, j]) / scales[j])
                    apart = distance > least_distance
            chosen[t, k] = apart
            count += apart
