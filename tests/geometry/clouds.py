"""Clouds to triangulate: easy, real and malicious."""

import numpy as np

__all__ = ["DEGENERATE", "FLAT", "arc_tips", "random_points"]


def random_points(n: int, seed: int = 0) -> np.ndarray:
    """Uniform in the unit cube."""
    return np.random.default_rng(seed).random((n, 3))


def arc_tips(n: int, seed: int = 0) -> np.ndarray:
    """Tips of three arcs in a row, each bent by its own share of three random activations.

    Strongly non-convex, and its density varies by orders of magnitude, as that of real clouds.
    """
    activation = np.random.default_rng(seed).uniform(-1.7, 0.0, (n, 3))
    tip, frame = np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3))
    for turn in (0.0, 0.7, 1.3):
        angles = turn + np.array([0.0, 2.1, 4.2])
        bend = 1.2 * activation @ np.stack([np.cos(angles), np.sin(angles)], axis=1)
        arc, rotation = _arc(bend)
        tip = tip + np.einsum("nij,nj->ni", frame, arc)
        frame = frame @ rotation
    return tip


def _arc(bend: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """End and end frame of arcs of length 1/3, bent by the angle |bend| about (bx, by, 0)."""
    angle = np.linalg.norm(bend, axis=1) + 1e-12
    x, y = (bend / angle[:, None]).T
    zero = np.zeros_like(x)
    skew = np.stack([zero, zero, y, zero, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    sin, versine = np.sin(angle), 1.0 - np.cos(angle)
    rotation = np.eye(3) + sin[:, None, None] * skew + versine[:, None, None] * skew @ skew
    chord = np.stack([y * versine, -x * versine, sin], axis=1) / angle[:, None] / 3.0
    return chord, rotation


def _lattice(k: int) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(float(k))] * 3), axis=-1).reshape(-1, 3)


def _on_sphere(n: int) -> np.ndarray:
    x = np.random.default_rng(1).normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def _rotated(points: np.ndarray) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    return points @ q


def _circle(n: int) -> np.ndarray:
    t = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    return np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=1)


_CUBE = random_points(150, seed=3)

DEGENERATE = {
    "lattice": _lattice(6),
    "lattice of tenths": 0.1 * _lattice(6),
    "rotated lattice": _rotated(_lattice(5)),
    "cube corners": _lattice(2),
    "on a sphere": _on_sphere(150),
    "on two linked circles": np.concatenate([_circle(40), _circle(40)[:, [2, 0, 1]] + [1, 0, 0]]),
    "on a cylinder": np.concatenate([_circle(24) + [0, 0, z] for z in range(5)]),
    "moment curve": np.linspace(0.0, 1.0, 60)[:, None] ** [1, 2, 3],
    "rounded to tenths": np.round(random_points(400), 1),
    "duplicates": np.concatenate([_CUBE, _CUBE]),
    "near-duplicates": np.concatenate([_CUBE, _CUBE + 1e-15 * random_points(150, seed=4)]),
    "far from the origin": 1e8 + _CUBE,
    "tiny": 1e-80 * _CUBE,
    "huge": 1e80 * _CUBE,
    "one outlier": np.concatenate([1e-6 * _CUBE, [[1e6, 0.0, 0.0]]]),
    "sheared flat": _CUBE * [1.0, 1.0, 1e-12],
    "plane and one point": np.concatenate([_CUBE * [1, 1, 0], [[0.3, 0.3, 1.0]]]),
    "five points": random_points(5),
    "four points": random_points(4),
}

FLAT = {
    "empty": np.empty((0, 3)),
    "one": np.ones((1, 3)),
    "three": random_points(3),
    "all equal": np.ones((20, 3)),
    "line": np.arange(20.0)[:, None] * [1.0, 2.0, 3.0],
    "plane": _CUBE * [1.0, 1.0, 0.0],
    "tilted plane": np.stack([*_lattice(4)[:, :2].T, _lattice(4)[:, :2].sum(axis=1)], axis=1),
    "three distinct": np.repeat(random_points(3), 5, axis=0),
}
