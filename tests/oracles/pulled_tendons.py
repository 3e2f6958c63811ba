"""Strains of least energy of an arm without loads, some of whose tendons are pulled in by lengths.

The strains at Gauss nodes are the unknowns of SciPy's SLSQP; pulling in a tendon is an inequality
for the length of its path, and a tendon that stretches has one more unknown. Tensions appear
nowhere. Paths are those of lines at p = ρ (cos θ, sin θ): a small change of the strains changes
their length by ∫ t3 dζ + dω·(p × t) dZ, with t along the straight arm.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import minimize

from softreach.arm import LengthTendon, Manipulator
from softreach.arm.tables import tables

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True)
class PulledArm:
    """An arm, and activations of all its bundles with displacements among them [m]."""

    arm: Manipulator
    activation: Array

    @cached_property
    def edges(self) -> Array:
        """Ends of the pieces in which the strains are smooth [m]."""
        return np.array([0.0, *self.arm.breakpoints, self.arm.length])

    @cached_property
    def nodes(self) -> tuple[Array, Array]:
        """Gauss nodes Z and their weights [m], shape (piece, node)."""
        half = np.diff(self.edges)[:, None] / 2.0
        return self.edges[:-1, None] + half * (1.0 + _NODES), half * _WEIGHTS

    @cached_property
    def unpulled(self) -> tuple[Array, Array]:
        """(ζ, ω) at the nodes without these tendons, and η, shape (station, 4) and (station,)."""
        gamma = np.where(self.is_pulled, 0.0, self.activation)
        table = tables(self.arm, self.nodes[0].ravel())
        eta = 1.0 + table.rest_length_factor @ gamma
        turn = eta[:, None] * (table.curvature @ gamma)
        return np.column_stack([1.0 + table.extension @ gamma, turn]), eta

    @property
    def is_pulled(self) -> NDArray[np.bool_]:
        """Mask of the bundles that are tendons driven by length."""
        return np.array([isinstance(each, LengthTendon) for each in self.arm.bundle_actuators])

    def paths(self) -> Array:
        """Shortening per (ζ, ω) at the nodes, shape (tendon, station, 4)."""
        z, rows = self.nodes[0].ravel(), []
        for tendon in self.arm.actuators:
            if not isinstance(tendon, LengthTendon):
                continue
            ends = tendon.start_over_length, tendon.end_over_length
            start, end = (end * self.arm.length for end in ends)
            rate = tendon.revolution / (end - start)
            for k in range(tendon.bundles):
                angle = tendon.offset + 2 * np.pi * k / tendon.bundles + rate * (z - start)
                out = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(z))], 1)
                around = np.stack([-np.sin(angle), np.cos(angle), np.zeros(len(z))], 1)
                along = tendon.distance * rate * around + [0.0, 0.0, 1.0]
                t = along / np.linalg.norm(along, axis=1)[:, None]
                shortens = -np.column_stack([t[:, 2], np.cross(tendon.distance * out, t)])
                rows.append(np.where(((z > start) & (z < end))[:, None], shortens, 0.0))
        return np.array(rows)

    def strains(self) -> Array:
        """(ζ, ω) of least energy at the nodes, shape (station, 4)."""
        before, eta = self.unpulled
        stiffness = self.arm.section.stiffness_at(self.arm.profile, self.nodes[0].ravel())
        turning = stiffness.bending / eta, stiffness.bending / eta, stiffness.torsion / eta
        resists = np.stack([stiffness.axial, *turning], axis=1)
        size = np.sqrt(self.nodes[1].ravel()[:, None] * resists)  # energy is ½ |size d|²
        paths = self.paths() * self.nodes[1].ravel()[:, None]
        at_rest = np.column_stack([np.ones(len(before)), np.zeros((len(before), 3))])
        shortened = np.einsum("tsc,sc->t", paths, before - at_rest)
        tendons = [self.arm.bundle_actuators[k] for k in np.flatnonzero(self.is_pulled)]
        pulled = self.activation[self.is_pulled] - [tendon.slack for tendon in tendons]
        springs = np.array([tendon.tendon_stiffness or np.inf for tendon in tendons])
        pulled = pulled + [tendon.pretension for tendon in tendons] / springs - shortened
        stretch = np.diag(1.0 / np.sqrt(springs))[:, np.isfinite(springs)]
        slopes = np.concatenate([(paths / size).reshape(len(paths), -1), stretch], axis=1)
        scale = 1.0 / np.linalg.norm(slopes, axis=1)  # constraints of like size
        slopes, pulled = slopes * scale[:, None], pulled * scale
        largest = np.abs(pulled).max() or 1.0
        found = minimize(
            lambda x: (0.5 * x @ x, x),
            np.zeros(slopes.shape[1]),
            jac=True,
            method="SLSQP",
            constraints={
                "type": "ineq",
                "fun": lambda x: slopes @ x - pulled / largest,
                "jac": lambda x: slopes,
            },
            options={"ftol": 1e-18, "maxiter": 200},
        )
        change = largest * found.x[: before.size].reshape(before.shape) / size
        return before + change

    def tip(self) -> Array:
        """The tip, by SciPy's DOP853 through the strains [m]."""
        pieces = self.strains().reshape(len(self.edges) - 1, len(_NODES), 4)
        state = np.concatenate([np.zeros(3), np.eye(3).ravel()])
        for k, (z, values) in enumerate(zip(self.nodes[0], pieces, strict=True)):
            between = BarycentricInterpolator(z, values)

            def rhs(place: float, state: Array, between=between) -> Array:
                zeta, *turn = between(place)
                directors = state[3:].reshape(3, 3)  # rows d1, d2, d3
                return np.concatenate(
                    [zeta * directors[2], np.cross(turn @ directors, directors).ravel()]
                )

            span = (self.edges[k], self.edges[k + 1])
            state = solve_ivp(rhs, span, state, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        return state[:3]


@dataclass(frozen=True)
class HeavyPulledArm(PulledArm):
    """The same under gravity and a payload at the tip, of a smooth arm without fibers.

    The potential energy of the places joins that of the strains. Its derivatives are imaginary
    parts, in the steps of Runge and Kutta from base to tip.
    """

    steps: int = 160

    @cached_property
    def between(self) -> Array:
        """Strains at both ends and the middle of each step from those at the nodes."""
        z = np.linspace(0.0, self.arm.length, 2 * self.steps + 1)
        return BarycentricInterpolator(self.nodes[0][0], np.eye(len(_NODES)))(z)

    def places(self, strains: Array) -> Array:
        """r at the ends of the steps [m] of strains (..., node, 4), which may be complex."""
        along = np.einsum("zn,...nc->z...c", self.between, strains)
        h = self.arm.length / self.steps
        batch, kind = strains.shape[:-2], strains.dtype
        turn = np.eye(3) + np.zeros((*batch, 3, 3), kind)  # columns d1, d2, d3
        place = np.zeros((*batch, 3), kind)
        places = [place]

        def rates(values: Array, turn: Array) -> tuple[Array, Array]:
            x, y, z = (values[..., k, None] for k in (1, 2, 3))
            one, two, three = turn[..., 0], turn[..., 1], turn[..., 2]
            columns = [z * two - y * three, x * three - z * one, y * one - x * two]
            return np.stack(columns, -1), values[..., :1] * three

        for k in range(self.steps):
            first, middle, last = along[2 * k : 2 * k + 3]
            a = rates(first, turn)
            b = rates(middle, turn + 0.5 * h * a[0])
            c = rates(middle, turn + 0.5 * h * b[0])
            d = rates(last, turn + h * c[0])
            turn = turn + h / 6.0 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            place = place + h / 6.0 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
            places.append(place)
        return np.stack(places, -2)

    def weight(self) -> Array:
        """Weight at the ends of the steps [N], by Simpson's rule, shape (place, 3)."""
        z = np.linspace(0.0, self.arm.length, self.steps + 1)
        simpson = np.where(np.arange(len(z)) % 2, 4.0, 2.0)
        simpson[[0, -1]] = 1.0
        mass = simpson * self.arm.length / self.steps / 3.0
        mass *= self.arm.section.mass_per_length_at(self.arm.profile, z)
        assert self.arm.loads is not None
        mass[-1] += self.arm.loads.payload
        return mass[:, None] * np.array(self.arm.loads.gravity)

    def tip(self) -> Array:
        """The tip of least energy [m]."""
        before, _ = self.unpulled
        stiffness = self.arm.section.stiffness_at(self.arm.profile, self.nodes[0].ravel())
        resists = np.stack([*stiffness[:2], *stiffness[1:]], axis=1)
        size = np.sqrt(self.nodes[1].ravel()[:, None] * resists)
        paths = self.paths() * self.nodes[1].ravel()[:, None]
        pulled = self.activation - [each.slack for each in self.arm.bundle_actuators]
        slopes = (paths / size).reshape(len(paths), -1)
        scale = 1.0 / np.linalg.norm(slopes, axis=1)
        weight, count = self.weight(), before.size
        unit = np.sqrt(np.abs(weight).sum() * self.arm.length)  # of the unknowns

        def energy(x: Array) -> tuple[float, Array]:
            changes = unit * (x + 1e-30j * np.eye(count)).reshape(count, *before.shape) / size
            work = np.einsum("px,npx->n", weight, self.places(before + changes))
            return 0.5 * x @ x - work[0].real / unit**2, x - work.imag / 1e-30 / unit**2

        lengths = {
            "type": "ineq",
            "fun": lambda x: scale * (unit * slopes @ x - pulled) / unit,
            "jac": lambda x: scale[:, None] * slopes,
        }
        found = minimize(
            energy,
            np.zeros(count),
            jac=True,
            method="SLSQP",
            constraints=lengths,
            options={"ftol": 1e-17, "maxiter": 500},
        )
        return self.places(before + unit * found.x.reshape(before.shape) / size)[-1]
