"""A rod as a chain of stiff links, its energy, and whether an equilibrium is a minimum of it.

Links of equal length carry the frames; springs between them bend and twist, each link stretches.
The clamp and the tip have half a spring each. With the rotation of a spring as its Cayley vector
w, u = w/(η ℓ) over the length ℓ that the spring stands for, the energy is

    Σ ½ ℓ η (u - û)·K(u - û) + Σ ½ h K0 (ζ - ζ̂)²/η - work of the dead forces

and tends to that of the rod with the square of the links' length h. Moments and following forces
have no potential and are refused. Second derivatives are imaginary parts of the first.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.oracles.loaded_rod import Equilibrium, equilibrium
from tests.oracles.rod import Loads, Rod

Array = NDArray[np.float64]
Numbers = NDArray[Any]
"""Real, or complex where it carries a derivative."""

_IMAGINARY = 1e-30


@dataclass(frozen=True)
class Chain:
    """A rod under dead forces in `links` links.

    Its coordinates are the Cayley vectors of the links + 1 springs, then the stretches of the
    links, shape (4 links + 3,).
    """

    rod: Rod
    loads: Loads
    links: int = 40

    def __post_init__(self) -> None:
        load = self.loads
        moments = [load.tip_moment, *(point.moment for point in load.points)]
        if any(map(any, [*moments, load.following_force, load.following_moment])):
            raise ValueError("moments and following forces have no potential")

    @property
    def h(self) -> float:
        """Length of a link at rest [m]."""
        return self.rod.length / self.links

    @cached_property
    def joints(self) -> Array:
        """Z of the springs, in the middle of what they stand for, shape (links + 1,)."""
        inner = self.h * np.arange(1.0, self.links)
        return np.array([self.h / 4, *inner, self.rod.length - self.h / 4])

    @cached_property
    def centers(self) -> Array:
        """Z of the links' centers, shape (links,)."""
        return self.h * (np.arange(self.links) + 0.5)

    @cached_property
    def span(self) -> Array:
        """Length η ℓ that each spring stands for, shape (links + 1,)."""
        rest = np.full(self.links + 1, self.h)
        rest[[0, -1]] = self.h / 2
        return rest * [self.rod.grown(z) for z in self.joints]

    @cached_property
    def stiffness(self) -> Array:
        """(K1, K1, K3) of each spring, shape (links + 1, 3)."""
        rod = self.rod
        return np.array([[rod.bending(z), rod.bending(z), rod.torsion(z)] for z in self.joints])

    @cached_property
    def curvature(self) -> Array:
        """û of each spring, shape (links + 1, 3)."""
        return np.array([self.rod.curvature(z) for z in self.joints], float)

    @cached_property
    def stretch(self) -> Array:
        """ζ̂ of each link, shape (links,)."""
        return np.array([self.rod.stretch(z) for z in self.centers])

    @cached_property
    def axial(self) -> Array:
        """K0/η of each link, shape (links,)."""
        return np.array([self.rod.axial(z) / self.rod.grown(z) for z in self.centers])

    @cached_property
    def weight(self) -> Array:
        """Weight of the payload [N]."""
        return self.loads.payload * np.array(self.loads.gravity)

    @cached_property
    def pull(self) -> Array:
        """Dead force that the end of each link carries, half its own weight in it: (links, 3)."""
        loads = self.loads
        mass = np.array([self.rod.mass(z) for z in self.centers])
        forces = np.array([loads.force_per_length(z) for z in self.centers])
        own = self.h * (mass[:, None] * loads.gravity + forces)
        beyond = np.cumsum(own[::-1], axis=0)[::-1] - own / 2
        beyond = beyond + np.array(loads.tip_force) + self.weight
        for point in loads.points:
            share = np.clip(point.place / self.h - np.arange(self.links), 0.0, 1.0)
            beyond = beyond + share[:, None] * np.array(point.force)
        return beyond

    def rest(self) -> Array:
        """Coordinates without loads."""
        return self._coordinates(self.curvature, self.stretch)

    def near(self, found: Equilibrium) -> Array:
        """Coordinates of an equilibrium of the rod whose stations are the joints."""
        return self.bent_by(np.einsum("sij,sj->si", found.frame, found.moment))

    def bent_by(self, moment: Array) -> Array:
        """Coordinates under moments in the directors of the joints [N m], shape (links + 1, 3)."""
        return self._coordinates(self.curvature + moment / self.stiffness, self.stretch)

    def solve(self, start: Array | None = None) -> Array:
        """Coordinates of the equilibrium near a start: that of the rod's shooting if None."""
        if start is None:
            start = self.near(equilibrium(self.rod, self.loads, self.joints, rtol=1e-7))
        q = start
        for _ in range(30):
            step = np.linalg.solve(self.hessian(q), -self.gradient(q))
            q = q + step
            if np.abs(step).max() < 1e-11:
                return q
        raise ArithmeticError("no equilibrium of the chain near the start")

    def energy(self, q: Array) -> float:
        """Elastic energy less the work of the loads [J]."""
        w, zeta = self._parts(q)
        frames = self._frames(w[None])[0]
        bent = w / self.span[:, None] - self.curvature
        elastic = 0.5 * np.sum(self.span[:, None] * self.stiffness * bent**2)
        stretched = self.axial * (zeta - self.stretch) ** 2
        work = np.sum(self.h * zeta[:, None] * frames[1:-1, :, 2] * self.pull)
        work += frames[-1] @ np.array(self.loads.lever) @ self.weight
        return float(elastic + 0.5 * self.h * stretched.sum() - work)

    def gradient(self, q: Numbers) -> Numbers:
        """Derivative of the energy by the coordinates, for a batch of them: shape as q."""
        batch = np.atleast_2d(q)
        w, zeta = self._parts(batch)
        frames = self._frames(w)
        axes = frames[:, 1:-1, :, 2]
        along = self.axial * (zeta - self.stretch) - np.sum(axes * self.pull, axis=-1)
        torque = np.cross(self.h * zeta[..., None] * axes, self.pull)
        lever = frames[:, -1] @ np.array(self.loads.lever)
        torque = np.concatenate([torque, np.cross(lever, self.weight)[:, None]], axis=1)
        carried = np.cumsum(torque[:, ::-1], axis=1)[:, ::-1]
        seen = np.einsum("bjki,bjk->bji", frames[:, :-1], carried)  # from the frame before
        # (1 + w×/2)ᵀ/(1 + w²/4) takes a torque to the Cayley vector
        worked = (seen - np.cross(w, seen) / 2) / (1 + np.sum(w * w, axis=-1) / 4)[..., None]
        bend = self.stiffness * (w / self.span[:, None] - self.curvature) - worked
        flat = np.concatenate([bend.reshape(len(batch), -1), self.h * along], axis=1)
        return flat.reshape(np.shape(q))

    def hessian(self, q: Array) -> Array:
        """Second derivatives of the energy."""
        shifted = q + 1j * _IMAGINARY * np.eye(len(q))
        hessian = self.gradient(shifted).imag / _IMAGINARY
        return 0.5 * (hessian + hessian.T)

    def softest(self, q: Array, *, planar: bool = False) -> Array:
        """Eigenvalues of the Hessian in ascending order; negative ones are ways to fall.

        Args:
            q: Coordinates of an equilibrium.
            planar: Only turns about d2, for an arm that stays in the plane of d1 and d3.
        """
        size = 3 * (self.links + 1)
        kept = [*range(1, size, 3), *range(size, len(q))] if planar else range(len(q))
        return np.linalg.eigvalsh(self.hessian(q)[np.ix_(kept, kept)])

    def nodes(self, q: Array) -> Array:
        """Ends of the links in the fixed frame, from the clamp to the tip, shape (links + 1, 3)."""
        w, zeta = self._parts(q)
        axes = self._frames(w[None])[0, 1:-1, :, 2]
        return np.cumsum([np.zeros(3), *(self.h * zeta[:, None] * axes)], axis=0)

    def _coordinates(self, u: Array, zeta: Array) -> Array:
        return np.concatenate([(u * self.span[:, None]).ravel(), zeta])

    def _parts(self, q: Numbers) -> tuple[Numbers, Numbers]:
        size = 3 * (self.links + 1)
        return q[..., :size].reshape(*q.shape[:-1], -1, 3), q[..., size:]

    def _frames(self, w: Numbers) -> Numbers:
        """Clamp, links, tip: rotations with the directors as columns, (batch, links + 2, 3, 3)."""
        turns = _cayley(w)
        frames = [np.broadcast_to(np.array(self.rod.base).T, turns[:, 0].shape)]
        for j in range(turns.shape[1]):
            frames.append(frames[-1] @ turns[:, j])
        return np.stack(frames, axis=1)


def _cayley(w: Numbers) -> Numbers:
    """1 + (w× + w× w×/2)/(1 + w²/4)."""
    x, y, z = np.moveaxis(w, -1, 0)
    zero = 0 * x
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*w.shape, 3)
    size = (1 + np.sum(w * w, axis=-1) / 4)[..., None, None]
    return np.eye(3) + (cross + cross @ cross / 2) / size
