"""Lines along which bundles run: their lengths, and how far they leave the straight arm's.

The linear law lets tendons pull along their lines in the straight arm; how far tips are off by that
is known from the bent ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators import Tendon
from softreach.arm.driving import Driving, body_of
from softreach.arm.guides import Guides, has_guides
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.section import turned
from softreach.arm.tables import quadrature, tables
from softreach.support.arrays import Array, as_rows

_STEP = 1e-5  # of a piece, for derivatives along the arm
_SECTIONS = 64
_REPETITIONS = 40  # of a fixed point, whose first step is off by about a tenth of its change
_SETTLED = 1e-5  # of an angle over L, in a step
_SAMPLES = 256
_NOTED = 1e-3  # L


def line_lengths(arm: Manipulator, activations: ArrayLike) -> Array:
    """Length of the middle line of each bundle where it acts, without loads [m].

    A line at x d₁ + y d₂ from the axis runs along
    dp/dZ = (x' - ω₃ y) d₁ + (y' + ω₃ x) d₂ + (ζ + ω₁ y - ω₂ x) d₃, with ω = η u the turn of the
    directors along the arm before activation, theory (6).

    Args:
        arm: The design.
        activations: Shape (n, bundle).

    Returns:
        Shape (n, bundle).

    Raises:
        InvalidInput: No finite activations of that shape.
    """
    arm = a_manipulator("arm", arm)
    gamma = as_rows("activations", activations, arm.inputs, "of shape (n, inputs)")
    gamma, body = Driving(arm).activations(gamma), body_of(arm)
    table = tables(body, quadrature(body)[0])
    zeta = 1.0 + gamma @ table.extension.T
    eta = 1.0 + gamma @ table.rest_length_factor.T if table.has_forces else zeta
    turn = eta[..., None] * np.einsum("nb,scb->nsc", gamma, table.curvature)
    return lengths_of_strains(arm, turn, zeta)


def lengths_of_strains(arm: Manipulator, turn: Array, zeta: Array) -> Array:
    """Length of each bundle's middle line [m] by ω (n, node, 3) and ζ (n, node) at `quadrature`."""
    z, weights, half = quadrature(body_of(arm))
    step = _STEP * half
    slopes = (line_places(arm, z + step) - line_places(arm, z - step)) / (2.0 * step[:, None])
    speed, _ = _tangents(line_places(arm, z), slopes, turn, zeta)
    lengths = np.einsum("sb,nsb->nb", weights[:, None] * arm.outline(z).acts, speed)
    if has_guides(arm):
        guides = Guides(body_of(arm))
        force, moment = guides.works.loads_at(z, weights)
        works = (zeta - 1.0) @ force + np.einsum("nsc,scw->nw", turn, moment)
        lengths[:, guides.columns] = guides.lengths(works)
    return lengths


def _tangents(
    places: Array, slopes: Array, turn: Array, zeta: Array
) -> tuple[Array, tuple[Array, Array, Array]]:
    """|dp/dZ| of lines and dp/dZ in the directors [-], shape (n, node, bundle) each."""
    (x, y), (dx, dy) = places, slopes
    w1, w2, w3 = (turn[..., k, None] for k in range(3))
    p1, p2, p3 = dx - w3 * y, dy + w3 * x, zeta[..., None] + w1 * y - w2 * x
    return np.sqrt(p1**2 + p2**2 + p3**2), (p1, p2, p3)


def line_strains(arm: Manipulator) -> Array:
    """Least and largest strain of each bundle's line [-] by its own activation, (bundle, 2)."""
    ends, count, alone = arm.bounds, arm.bundles, arm.replace(drives=())
    gamma = np.concatenate([np.zeros((1, count)), np.diag(ends[:, 0]), np.diag(ends[:, 1])])
    lengths = line_lengths(alone, gamma)
    each = lengths[1:].reshape(2, count, count).diagonal(axis1=1, axis2=2) / lengths[0] - 1.0
    return np.sort(each.T, axis=1)


def line_places(arm: Manipulator, z: Array) -> Array:
    """Middle of each bundle in the sections [m], shape (2, station, bundle)."""
    outline = arm.outline(z)
    middle = outline.middle_ratio * arm.profile.radius(z)[:, None]
    return middle * np.stack([np.cos(outline.center), np.sin(outline.center)])


def law_warning(arm: Manipulator) -> str:
    """One line where the `pull_error` exceeds 0.1 % of L; else empty."""
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
    tendons = [each if isinstance(each, Tendon) else None for each in body.bundle_actuators]
    pulls = np.array([each is not None and not each.has_guides for each in tendons], bool)
    if not pulls.any():
        return 0.0
    step = arm.length / _SECTIONS
    z = np.linspace(0.5 * step, arm.length - 0.5 * step, _SECTIONS)
    table, acts = tables(body, z), body.outline(z).acts[:, pulls, None]
    places = line_places(body, z)
    slopes = np.gradient(places, step, axis=1, edge_order=2)[..., pulls]
    places = places[..., pulls]
    x, y = places
    angle, resistance = body.section.bending_angle, body.section.resistance(body.stiffness_at(z))
    shares = np.rint(2.0 * np.random.default_rng(0).random((_SAMPLES, arm.inputs))) / 2.0
    low, high = arm.input_bounds.T
    gamma = Driving(arm).activations(np.unique(low + shares * (high - low), axis=0))
    zeta, eta = 1.0 + gamma @ table.extension.T, 1.0 + gamma @ table.rest_length_factor.T

    def moments(omega: Array, zeta: Array) -> Array:
        speed, along = _tangents(places, slopes, omega, zeta)
        t1, t2, t3 = (each / speed for each in along)
        moment = np.stack([-y * t3, x * t3, y * t1 - x * t2], axis=-1)
        return np.einsum("nb,nsbk->nsk", gamma[:, pulls], np.where(acts, moment, 0.0))

    linear = np.einsum("nb,skb->nsk", gamma, table.curvature)
    rest, bent = moments(0.0 * linear, 1.0 + 0.0 * zeta), linear
    for _ in range(_REPETITIONS):
        more = turned((moments(eta[..., None] * bent, zeta) - rest)[..., None], -angle)
        more = turned(more / resistance[..., None], angle)[..., 0]
        before, bent = bent, linear + more
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
