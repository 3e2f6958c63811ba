"""How far tips are off because the linear law lets tendons pull along the straight arm."""

from __future__ import annotations

import numpy as np

from softreach.arm.actuators import Tendon
from softreach.arm.driving import Driving, body_of
from softreach.arm.lines import places
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import Array, tables

__all__ = ["law_warning", "pull_error"]

_STATIONS = 64
_STEPS = 40  # of a fixed point, whose first step is off by about a tenth of its change
_SETTLED = 1e-5  # of an angle over L, in a step
_SAMPLES = 256
_NOTED = 1e-3  # L


def law_warning(arm: Manipulator) -> str:
    """One line where that error exceeds 0.1 % of L; else empty."""
    error = pull_error(arm)
    if error <= _NOTED * arm.length:
        return ""
    return (
        f"tips are off by up to about {1e3 * error:.2g} mm ({error / arm.length:.2g} L) within the "
        "bounds: tendons pull along their bent lines, and the linear law takes the straight ones; "
        "narrow the bounds, or take tendons that wind less"
    )


def pull_error(arm: Manipulator) -> float:
    """Largest distance of tips from those of tendons that pull along their bent lines [m].

    Without loads (54) is an equation for the curvature of each section alone. It is solved by
    repetition from the linear law (52), for inputs at the ends and the middle of their bounds.
    """
    body = body_of(arm)
    pulls = np.array([isinstance(each, Tendon) for each in body.bundle_actuators], bool)
    if not pulls.any():
        return 0.0
    step = arm.length / _STATIONS
    z = np.linspace(0.5 * step, arm.length - 0.5 * step, _STATIONS)
    table, acts = tables(body, z), body.outline(z).acts[:, pulls, None]
    (x, y), (dx, dy) = (
        values[..., pulls]
        for values in (places(body, z), np.gradient(places(body, z), step, axis=1, edge_order=2))
    )
    stiffness = body.stiffness_at(z)
    resistance = np.stack([stiffness.bending, stiffness.bending, stiffness.torsion], axis=1)
    shares = np.rint(2.0 * np.random.default_rng(0).random((_SAMPLES, arm.inputs))) / 2.0
    low, high = arm.input_bounds.T
    gamma = Driving(arm).activations(np.unique(low + shares * (high - low), axis=0))
    zeta, eta = 1.0 + gamma @ table.extension.T, 1.0 + gamma @ table.rest_length_factor.T

    def moments(omega: Array, zeta: Array) -> Array:
        one, two, three = (omega[..., k, None] for k in range(3))
        along = np.stack([dx - three * y, dy + three * x, zeta[..., None] + one * y - two * x])
        t1, t2, t3 = along / np.linalg.norm(along, axis=0)
        moment = np.stack([-y * t3, x * t3, y * t1 - x * t2], axis=-1)
        return np.einsum("nb,nsbk->nsk", gamma[:, pulls], np.where(acts, moment, 0.0))

    linear = np.einsum("nb,skb->nsk", gamma, table.curvature)
    rest, bent = moments(0.0 * linear, 1.0 + 0.0 * zeta), linear
    for _ in range(_STEPS):
        before, bent = bent, linear + (moments(eta[..., None] * bent, zeta) - rest) / resistance
        if np.abs(bent - before).max() * arm.length < _SETTLED:
            break
    tips = [_tips(eta[..., None] * each * step, zeta * step) for each in (linear, bent)]
    return float(np.linalg.norm(tips[1] - tips[0], axis=1).max())


def _tips(turns: Array, lengths: Array) -> Array:
    """Tips [m] of arms whose pieces turn by turns, shape (n, piece, 3), and have these lengths."""
    from scipy.spatial.transform import Rotation

    tip, frame = np.zeros((len(turns), 3)), Rotation.identity(len(turns))
    for turn, length in zip(np.swapaxes(turns, 0, 1), lengths.T, strict=True):
        half = Rotation.from_rotvec(turn / 2.0)
        tip += length[:, None] * (frame * half).as_matrix()[..., 2]
        frame = frame * half * half
    return tip
