"""Closed surfaces that touch themselves along edges, parted there, as slicers ask.

The boundary of a union of tetrahedra, such as an alpha shape, is closed, but where two of them meet
in an edge alone, four of its triangles do. Around the edge the solid fills wedges. Each gets a
corner of its own, in the middle of the edge and a little within the wedge, so that the triangles
there are two of one wedge.
"""

from __future__ import annotations

import numpy as np

from softreach.support.arrays import Array, Faces, Index, Points

__all__ = ["parted"]

_ASIDE = 1e-3  # of the length of an edge, by which a wedge is drawn back


def parted(vertices: Points, faces: Faces) -> tuple[Points, Faces]:
    """A closed surface with two triangles at every edge; one that has them, or is open, as it is.

    Args:
        vertices: Corners, shape (v, 3).
        faces: Turning outwards, shape (f, 3).
    """
    faces = np.asarray(faces, np.int64)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    _, edge, count = np.unique(low * len(vertices) + high, return_inverse=True, return_counts=True)
    ups = np.bincount(edge, weights=starts < ends)
    several = np.flatnonzero(count > 2)
    if not len(several) or (count != 2 * ups).any():
        return vertices, faces
    order = np.argsort(edge, kind="stable")
    first = np.cumsum(count) - count
    corners = np.full(faces.size, -1)  # of the middle of each side, by face and side
    middles: list[Array] = []
    for k in several:
        sides = order[first[k] : first[k] + count[k]]
        for one, other, place in _wedges(vertices, faces, sides):
            corners[[one, other]] = len(vertices) + len(middles)
            middles.append(place)
    touching = corners.reshape(-1, 3)
    cut = (touching >= 0).any(axis=1)
    pieces = [piece for face, mid in zip(faces[cut], touching[cut], strict=True)
              for piece in _cut(face.tolist(), mid.tolist())]  # fmt: skip
    return np.concatenate([vertices, middles]), np.concatenate([faces[~cut], pieces])


def _wedges(vertices: Points, faces: Faces, sides: Index) -> list[tuple[int, int, Array]]:
    """Pairs of sides with solid between them, and a place in its middle."""
    triangles, k = np.divmod(sides, 3)
    starts, ends = faces[triangles, k], faces[triangles, (k + 1) % 3]
    a, b = vertices[min(starts[0], ends[0])], vertices[max(starts[0], ends[0])]
    length = np.linalg.norm(b - a)
    along = (b - a) / length
    out = vertices[faces[triangles, (k + 2) % 3]] - a
    across = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    angle = np.arctan2(out @ np.cross(along, across), out @ across)
    # The solid lies where angles fall from a side that runs along the edge to one that runs back.
    wedges = []
    for side in np.flatnonzero(starts < ends):
        fall = (angle[side] - angle) % (2.0 * np.pi)
        back = np.where(starts > ends, fall, np.inf)
        other = int(np.argmin(back))
        middle = angle[side] - back[other] / 2.0
        inward = np.cos(middle) * across + np.sin(middle) * np.cross(along, across)
        place = (a + b) / 2.0 + _ASIDE * length * inward
        wedges.append((int(sides[side]), int(sides[other]), place))
    return wedges


def _cut(face: list[int], middle: list[int]) -> list[tuple[int, int, int]]:
    """The triangles of one with corners in the middle of some sides; -1 for none."""
    while middle[0] < 0 or (middle[1] < 0 <= middle[2]):  # the side cut, or the first of two
        face, middle = face[1:] + face[:1], middle[1:] + middle[:1]
    (a, b, c), (ab, bc, ca) = face, middle
    if ca >= 0:
        return [(a, ab, ca), (ab, b, bc), (bc, c, ca), (ab, bc, ca)]
    if bc >= 0:
        return [(ab, b, bc), (ab, bc, c), (ab, c, a)]
    return [(ab, b, c), (ab, c, a)]
