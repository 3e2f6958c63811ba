"""Designs and oracles that the laws are tested with."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.base import POINTS, Base
from softreach.arm.driving import Driving
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables
from softreach.inverse import Solutions

Array = NDArray[np.float64]


def large(*cases: object) -> list:
    """Cases of a parameter that only `make test-all` has."""
    return [pytest.param(case, marks=pytest.mark.large) for case in cases]


def arm_of(*fibers: FiberArchitecture, **changes: object) -> Manipulator:
    """An arm of the paper's proportions with fibers of one's own."""
    fields = {
        "length": 1.0,
        "outer_radius": 1 / 16,
        "inner_radius": 3 / 64,
        "actuators": fibers,
        "activation_bounds": (-1.0, 0.0),
    }
    return Manipulator.tapered(**(fields | changes))


def single(revolution: float = 0.0, **changes: object) -> Manipulator:
    """One bundle of 48 degrees."""
    fiber = FiberArchitecture(revolution=revolution, offset=0.7, extent=np.radians(48))
    return arm_of(fiber, **changes)


def tensions_of_lengths(arm: Manipulator, displacements: object) -> Array:
    """Tensions [N] of the tendons that are driven by length, without loads, (n, such tendons)."""
    driving = Driving(arm)
    return driving.activations(np.asarray(displacements, float))[:, driving.law.columns]


def of_length(arm: Manipulator, length: float) -> Manipulator:
    """The arm with another length, its radius at the base as it was."""
    return arm.replace(profile=arm.profile.replace(length=length))


@st.composite
def arms(draw: st.DrawFn) -> Manipulator:
    """Any arm with one to three architectures of one to three narrow bundles."""
    number = st.floats
    fibers = tuple(
        FiberArchitecture(
            revolution=draw(number(-3, 3)),
            offset=draw(number(-7, 7)),
            extent=draw(number(0.05, 0.6)),
            bundles=draw(st.integers(1, 3)),
        )
        for _ in range(draw(st.integers(1, 3)))
    )
    length = draw(number(0.05, 20))
    radius = length * draw(number(0.03, 0.1))
    steepest = np.arctan(0.8 * radius / length)
    return Manipulator.tapered(
        length=length,
        outer_radius=radius,
        inner_radius=radius * draw(number(0, 0.95)),
        taper=draw(number(-0.1, 1)) * steepest,
        poisson_ratio=draw(number(0, 0.5)),
        actuators=fibers,
        activation_bounds=(-draw(number(0, 0.8)), draw(number(0, 0.3))),
    )


def integrated_tip(arm: Manipulator, gamma: Array) -> Array:
    """The tip by SciPy's eighth-order integrator on the rod's own equations (section 2)."""

    def rhs(z: float, state: Array) -> Array:
        table = tables(arm, [z])
        directors = state[3:].reshape(3, 3)  # rows d1, d2, d3
        zeta, eta = 1.0 + table.extension[0] @ gamma, 1.0 + table.rest_length_factor[0] @ gamma
        u = (table.curvature[0] @ gamma) @ directors
        return np.concatenate([zeta * directors[2], (eta * np.cross(u, directors)).ravel()])

    start = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    span = (0.0, arm.length)
    return solve_ivp(rhs, span, start, method="DOP853", rtol=1e-12, atol=1e-13).y[:3, -1]


def in_box(arm: Manipulator, n: int, seed: int = 1) -> Array:
    cube = np.random.default_rng(seed).random((n, arm.bundles))
    return arm.bounds[:, 0] + cube * np.diff(arm.bounds, axis=1)[:, 0]


def miss_of_original(solutions: Solutions, gamma: Array) -> Array:
    """Distance from each original activation to the nearest of those found for its tip."""
    target = np.repeat(np.arange(len(solutions)), solutions.counts)
    nearest = np.full(len(solutions), np.inf)
    np.minimum.at(nearest, target, np.abs(solutions.activations - gamma[target]).max(axis=1))
    return nearest


def differences(f: Callable[[Array], Array], gamma: Array, step: float = 1e-3) -> Array:
    """Fourth-order central differences of f along every column of gamma, on a last axis."""
    columns = []
    for e in step * np.eye(gamma.shape[1]):
        near, far = (f(gamma + k * e) - f(gamma - k * e) for k in (1, 2))
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def rotvec(angles):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angles)


@st.composite
def bases(draw: st.DrawFn) -> Base:
    """Poses within meters, pointing anywhere."""
    number = st.floats(-3, 3)
    words, angles = st.sampled_from([*POINTS]), st.tuples(number, number, number)
    turned = angles.map(lambda w: rotvec(w).as_matrix())
    position = draw(st.tuples(number, number, number))
    return Base(position=position, points=draw(words | turned), turn=draw(number))
