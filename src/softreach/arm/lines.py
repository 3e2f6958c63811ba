"""Lengths of the lines along which bundles run, and tensions of those driven by length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.driving import Driving, body_of
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.tables import quadrature, tables
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, as_rows
from softreach.support.errors import Range

__all__ = ["lengths_of_strains", "limit_shortening", "line_lengths", "line_strains", "places"]

_STEP = 1e-5  # of a piece, for derivatives along the arm
_HALVINGS = 52


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
    """Length of the middle line of each bundle [m] by strains at the nodes of `quadrature`.

    Args:
        arm: The design.
        turn: ω, curvature per length before activation [1/m], shape (n, node, 3).
        zeta: ζ [-], shape (n, node).

    Returns:
        Shape (n, bundle).
    """
    z, weights, half = quadrature(body_of(arm))
    step = _STEP * half
    place = places(arm, z)
    along = (places(arm, z + step) - places(arm, z - step)) / (2.0 * step[:, None])
    (x, y), (dx, dy) = place, along
    one, two, three = (turn[..., k, None] for k in range(3))
    speed = np.sqrt(
        (dx - three * y) ** 2 + (dy + three * x) ** 2 + (zeta[..., None] + one * y - two * x) ** 2
    )
    return np.einsum("s,nsb->nb", weights, np.where(arm.outline(z).acts, speed, 0.0))


def line_strains(arm: Manipulator) -> Array:
    """Smallest and largest change of length of each bundle's line by its own activation [-].

    The others stay zero: shape (bundle, 2), negative where the line shortens.
    """
    return np.sort(_strains_at(arm, arm.bounds), axis=1)


def limit_shortening(arm: Manipulator, most: float) -> Manipulator:
    """The arm with bounds under which no bundle shortens its line by more than a share of it.

    That holds for each bundle alone, while the others are not activated. Each bound that shortens
    too far moves toward zero.

    Args:
        arm: The design, whose bounds hold zero.
        most: Largest shortening [-], such as 0.3.

    Raises:
        InvalidInput: Not between 0 and 1.
    """
    most = as_number("most", most, Range(0.0, 1.0))
    bounds = a_manipulator("arm", arm).bounds
    kept, refused = np.zeros_like(bounds), bounds
    for _ in range(_HALVINGS):
        middle = 0.5 * (kept + refused)
        fits = _strains_at(arm, middle) >= -most
        kept, refused = np.where(fits, middle, kept), np.where(fits, refused, middle)
    return arm.with_bounds(np.where(_strains_at(arm, bounds) >= -most, bounds, kept))


def _strains_at(arm: Manipulator, ends: Array) -> Array:
    """Change of length of each bundle's line at activations of its own [-], shape (bundle, 2)."""
    arm, count = arm.replace(drives=()), arm.bundles
    alone = np.concatenate([np.zeros((1, count)), np.diag(ends[:, 0]), np.diag(ends[:, 1])])
    lengths = line_lengths(arm, alone)
    return (lengths[1:].reshape(2, count, count).diagonal(axis1=1, axis2=2) / lengths[0] - 1.0).T


def places(arm: Manipulator, z: Array) -> Array:
    """Middle of each bundle in the sections [m], shape (2, station, bundle)."""
    outline = arm.outline(z)
    middle = outline.middle_ratio * arm.profile.radius(z)[:, None]
    return middle * np.stack([np.cos(outline.center), np.sin(outline.center)])
