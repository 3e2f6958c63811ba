"""An arm as a chain of arcs between disks that guide its tendons: least energy, by SciPy."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, minimize

Array = np.ndarray


@dataclass(frozen=True)
class Tendon:
    """A tendon through holes of some disks."""

    disks: tuple[int, ...]
    holes: tuple[tuple[float, float], ...]


def arcs(strains: Array) -> tuple[Array, Array]:
    """Ends and turns of arcs with (λ, ω), shape (arc, 4), by Rodrigues' formula."""
    x = np.linalg.norm(strains[:, 1:], axis=1)[:, None, None]
    w = np.cross(np.eye(3), strains[:, None, 1:])
    sine, cosine = np.sinc(x / np.pi), 0.5 * np.sinc(0.5 * x / np.pi) ** 2
    cubic = np.where(x > 1e-3, (1.0 - sine) / np.maximum(x, 1e-3) ** 2, 1.0 / 6.0)
    moved = np.eye(3) + cosine * w + cubic * w @ w
    return moved[:, :, 2] * strains[:, :1], np.eye(3) + sine * w + cosine * w @ w


@dataclass(frozen=True)
class ArcChain:
    """Arcs with lengths [m] and stiffnesses (K0, K1, K2, K3); a disk stands at each end of each."""

    lengths: Array
    stiffness: Array
    tendons: tuple[Tendon, ...]
    rest: Array | None = None

    def disks(self, strains: Array) -> tuple[Array, Array]:
        """Places and rotations of the disks at (λ - h, ω) of the arcs, shape (arc, 4)."""
        places, turns = [np.zeros(3)], [np.eye(3)]
        ways, turned = arcs(strains + np.outer(self.lengths, [1.0, 0.0, 0.0, 0.0]))
        for way, turn in zip(ways, turned, strict=True):
            places.append(places[-1] + turns[-1] @ way)
            turns.append(turns[-1] @ turn)
        return np.array(places), np.array(turns)

    def tendon_lengths(self, strains: Array) -> Array:
        """Sum of the straight pieces of each tendon [m]."""
        places, turns = self.disks(strains)
        lengths = []
        for tendon in self.tendons:
            holes = np.array([(*hole, 0.0) for hole in tendon.holes])
            disks = list(tendon.disks)
            points = places[disks] + np.einsum("kij,kj->ki", turns[disks], holes)
            lengths.append(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return np.array(lengths)

    @property
    def _springs(self) -> Array:
        return np.where(self.lengths[:, None] > 0, self.stiffness / self.lengths[:, None], 0.0)

    def at_tensions(self, tension: Array) -> Array:
        """Strains of least energy under tensions [N]."""
        size = np.sqrt(self._springs)
        rest = np.zeros_like(size) if self.rest is None else self.rest

        def energy(x: Array) -> float:
            off = x.reshape(size.shape)
            return 0.5 * float(x @ x) + float(tension @ self.tendon_lengths(rest + off / size))

        best = minimize(energy, np.zeros(size.size), method="BFGS", options={"gtol": 1e-9})
        return rest + best.x.reshape(size.shape) / size

    def at_pulled(self, pulled: Array, stiffness: float) -> Array:
        """Strains of least energy where tendons with a stiffness [N/m] are pulled in [m]."""
        size = np.sqrt(self._springs)
        straight = self.tendon_lengths(np.zeros((len(self.lengths), 4)))

        def residuals(x: Array) -> Array:
            off = self.tendon_lengths(x.reshape(size.shape) / size) - (straight - pulled)
            return np.concatenate([x, np.sqrt(stiffness) * np.maximum(off, 0.0)])

        best = least_squares(residuals, np.zeros(size.size), xtol=1e-15, ftol=1e-15, gtol=1e-13)
        return best.x.reshape(size.shape) / size
