"""Equilibria of a loaded rod by shooting from its base, in the fixed frame.

An extensible rod that bends and twists but does not shear, about the shape that it has without
loads: with the stretch ζ̂(Z) and the curvature û(Z) per length of η(Z), which is ζ̂ but for forces:

    r' = ζ d3,    dᵢ' = η u × dᵢ,    n' = -f,    m' = -r' × n

    u = û + K⁻¹ m,    ζ = ζ̂ + η n·d3/K0

K resists by K1 and K2 about axes at an angle to d1 and d2, which may be two numbers,
with m, n, r and the directors in the fixed frame. At the base the pose and all dead forces are
known; unknown is m(0), and with a force that follows the tip also that force. SciPy's DOP853
walks to the tip, where m must be what acts there. Derivatives of the tip by the unknowns and by
the load come from imaginary parts too small to change the real ones, in the same walk. Loads grow
from nothing along the branch of the unloaded shape, by steps of a tangent predictor that are
halved where Newton's method fails.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from tests.oracles.rod import Loads, Rod

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_IMAGINARY = 1e-30
_SMALLEST_STEP = 1e-3


class Equilibrium(NamedTuple):
    """A rod in equilibrium at stations, or where the branch ended."""

    converged: bool
    """Whether the branch led to the whole load."""
    load: float
    """Share of the load that was reached [-]."""
    place: Array
    """r [m], shape (station, 3)."""
    frame: Array
    """Rows d1, d2, d3, shape (station, 3, 3)."""
    moment: Array
    """m in the fixed frame [N m], shape (station, 3); the first is m(0) if Z = 0 is a station."""
    base_moment: Array
    """m(0) in the fixed frame [N m]."""
    residual: float
    """Largest miss at the tip over the size of the moments [-]."""
    steps: int
    """Steps of continuation."""

    @property
    def tip(self) -> Array:
        """r at the last station [m]."""
        return self.place[-1]


def equilibrium(
    rod: Rod,
    loads: Loads,
    stations: ArrayLike | None = None,
    *,
    rtol: float = 1e-12,
    largest_step: float = 0.5,
) -> Equilibrium:
    """Follow the unloaded shape while the loads grow to their values.

    Args:
        rod: The rod.
        loads: What acts on it.
        stations: Z of the result [m]; base and tip if None.
        rtol: Relative tolerance of the last solution; those on the way are solved to 1e-7.
        largest_step: Of the share of the load in one step of continuation.
    """
    z = np.array([0.0, rod.length]) if stations is None else np.asarray(stations, float)
    coarse, fine = (_Shooting(rod, loads, tolerance) for tolerance in (1e-7, rtol))
    unknowns, reached, step, steps = np.zeros(coarse.size), 0.0, largest_step, 0
    slope = coarse.newton(unknowns, 0.0).by_load
    while reached < 1.0 and step > _SMALLEST_STEP:
        load = min(1.0, reached + step)
        predicted = slope * (load - reached)
        found = coarse.solve(unknowns + predicted, load)
        if found is None or coarse.far(found[0] - unknowns - predicted, predicted):
            step /= 2
            continue
        unknowns, slope = found
        reached, step, steps = load, min(largest_step, 1.5 * step), steps + 1
    polished = fine.solve(unknowns, reached)
    unknowns = unknowns if polished is None else polished[0]
    converged = polished is not None and reached == 1.0
    return fine.result(unknowns, reached, z, converged=converged, steps=steps)


class _Newton(NamedTuple):
    step: Array
    by_load: Array
    """Derivative of the solution by the load."""
    miss: float


class _Shooting:
    """The tip as a function of the unknowns at the base and the share of the load."""

    def __init__(self, rod: Rod, loads: Loads, rtol: float) -> None:
        self.rod, self.loads, self.rtol = rod, loads, rtol
        self.size = 6 if any(loads.following_force) else 3
        self.ends = sorted({0.0, rod.length, *rod.breaks, *(point.place for point in loads.points)})
        self.weight = loads.payload * np.array(loads.gravity)
        self.force = self._dead_force()
        arm, stiffness = rod.length, rod.bending(0.0) / rod.length
        self.scale = np.array([stiffness + arm * np.linalg.norm(self.force)] * 3 + [0.0] * 3)
        self.scale[3:] = self.scale[0] / arm

    def solve(self, unknowns: Array, load: float) -> tuple[Array, Array] | None:
        """The solution nearby and its derivative by the load, or None."""
        x, last = unknowns, np.inf
        for _ in range(10):
            try:
                found = self.newton(x, load)
            except ArithmeticError:
                return None
            size = np.abs(found.step / self.scale[: self.size]).max()
            if size > 2 * last or not np.isfinite(size):
                return None
            x, last = x + found.step, size
            if size < max(1e-9, 10 * self.rtol):
                return x, found.by_load
        return None

    def far(self, correction: Array, predicted: Array) -> bool:
        """Whether a correction is so large that it may lead to another branch."""
        scale = self.scale[: self.size]
        allowed = max(0.2 * np.abs(predicted / scale).max(), 1e-3)
        return bool(np.abs(correction / scale).max() > allowed)

    def newton(self, unknowns: Array, load: float) -> _Newton:
        """Newton's step and the tangent of the branch."""
        columns = np.zeros((self.size + 1, self.size + 1), complex)
        columns += np.append(unknowns, load)[:, None]
        columns += 1j * _IMAGINARY * np.eye(self.size + 1)
        miss = self._miss(columns)
        slopes = miss.imag / _IMAGINARY
        solved = -np.linalg.solve(
            slopes[:, :-1], np.stack([miss[:, 0].real, slopes[:, -1]], axis=1)
        )
        worst = np.abs(miss[:, 0].real / self.scale[: self.size]).max()
        return _Newton(solved[:, 0], solved[:, 1], float(worst))

    def result(
        self, unknowns: Array, load: float, z: Array, *, converged: bool, steps: int
    ) -> Equilibrium:
        columns = np.append(unknowns, load)[:, None].astype(complex)
        states = np.empty((18, len(z)))
        for low, high, walk in self._walk(columns, dense=True):
            if (inside := (z >= low) & (z <= high)).any():
                states[:, inside] = walk(z[inside]).real
        frame = states[3:12].reshape(3, 3, -1).transpose(2, 1, 0)
        miss = self._miss(columns)[:, 0].real / self.scale[: self.size]
        return Equilibrium(
            converged,
            load,
            states[:3].T,
            frame,
            states[12:15].T,
            unknowns[:3],
            float(np.abs(miss).max()),
            steps,
        )

    def _miss(self, columns: Complex) -> Complex:
        """What is left at the tip, for each column of unknowns and load."""
        *_, (_, high, walk) = self._walk(columns)
        state, load = walk(high).reshape(18, -1), columns[-1]
        frame, moment = state[3:12].reshape(3, 3, -1), state[12:15]
        applied = load * np.array(self.loads.tip_moment)[:, None]
        applied = applied + _turned(frame, load * np.array(self.loads.following_moment)[:, None])
        lever = _turned(frame, np.array(self.loads.lever)[:, None] + 0 * load)
        applied = applied + _cross(lever, load * self.weight[:, None])
        if self.size == 3:
            return moment - applied
        following = _turned(frame, load * np.array(self.loads.following_force)[:, None])
        return np.concatenate([moment - applied, columns[3:6] - following])

    def _walk(self, columns: Complex, *, dense: bool = False) -> list[tuple]:
        """(low, high, state of Z) of each piece from base to tip."""
        load, count = columns[-1], columns.shape[1]
        state = np.zeros((18, count), complex)
        state[3:12] = np.array(self.rod.base).T.reshape(9, 1)
        state[12:15] = columns[:3]
        state[15:] = load * self.force[:, None] + (columns[3:6] if self.size == 6 else 0.0)
        pieces = []
        for low, high in pairwise(self.ends):
            walk = solve_ivp(
                self._rates,
                (low, high),
                state.ravel(),
                method="DOP853",
                args=(load,),
                dense_output=dense,
                rtol=self.rtol,
                atol=self.rtol * 1e-2,
            )
            if not walk.success:
                raise ArithmeticError(walk.message)
            end = walk.y[:, -1]
            pieces.append((low, high, walk.sol if dense else lambda _, end=end: end))
            state = end.reshape(18, -1).copy()
            for point in self.loads.points:
                if point.place == high:
                    state[12:15] -= load * np.array(point.moment)[:, None]
                    state[15:] -= load * np.array(point.force)[:, None]
        return pieces

    def _rates(self, z: float, flat: Complex, load: Complex) -> Complex:
        y, rod = flat.reshape(18, -1), self.rod
        frame, moment, force = y[3:12].reshape(3, 3, -1), y[12:15], y[15:]
        k1, k3, eta = rod.bending(z), rod.torsion(z), rod.grown(z)
        k2, in_directors = (rod.across or rod.bending)(z), (frame * moment[:, None]).sum(axis=0)
        cos, sin = np.cos(rod.angle), np.sin(rod.angle)
        axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        yielded = axes.T @ ((axes @ in_directors) / np.array([[k1], [k2], [k3]]))
        u = np.asarray(rod.curvature(z))[:, None] + yielded
        turn = _turned(frame, eta * u)
        thrust = (frame[:, 2] * force).sum(axis=0)
        rates = np.empty_like(y)
        rates[:3] = (rod.stretch(z) + eta * thrust / rod.axial(z)) * frame[:, 2]
        rates[3:12] = _cross(turn[:, None], frame).reshape(9, -1)
        rates[12:15] = -_cross(rates[:3], force)
        rates[15:] = -self._per_length(z)[:, None] * load
        return rates.ravel()

    def _per_length(self, z: float) -> Array:
        weight = self.rod.mass(z) * np.array(self.loads.gravity)
        return weight + np.asarray(self.loads.force_per_length(z))

    def _dead_force(self) -> Array:
        """n(0) of all that does not follow the tip [N]."""
        nodes, weights = np.polynomial.legendre.leggauss(40)
        total = self.weight + np.array(self.loads.tip_force)
        total = total + sum((np.array(point.force) for point in self.loads.points), np.zeros(3))
        for low, high in pairwise(self.ends):
            half = 0.5 * (high - low)
            at = low + half * (1 + nodes)
            total = total + half * weights @ np.array([self._per_length(z) for z in at])
        return total


def _turned(frame: Complex, components: Complex) -> Complex:
    """A vector in the fixed frame from its components in the directors, the frame's columns."""
    return (frame * components).sum(axis=1)


def _cross(a: Complex, b: Complex) -> Complex:
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
