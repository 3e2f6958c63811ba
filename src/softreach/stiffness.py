"""Compliance of the tip, and the directions in which it is soft."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import tip_map_of
from softreach.rod.free import ArmRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import as_tip_map, of_tip
from softreach.rod.tip_map import BLOCK, TipMap
from softreach.schema import AXES, check_cloud
from softreach.support import parallel
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidDesign, InvalidInput

if TYPE_CHECKING:
    import xarray as xr


def tip_compliance(arm: Manipulator | TipMap, activations: ArrayLike, tol: float = 1e-6) -> Array:
    """∂r/∂F: how a tip yields to a small force on it that keeps its direction.

    It is the exact derivative of the computed tip, loads and their change with the shape included;
    without loads the arm yields about its activated shape. Under loads that have a potential it is
    symmetric, under those that follow the tip it need not be. At an unstable equilibrium it has
    negative eigenvalues.

    Args:
        arm: The design, with or without loads, or its tip map.
        activations: γ [-], shape (n, bundles).
        tol: Largest tip error, in L.

    Returns:
        Compliances [m/N], shape (n, 3, 3), the force's axis last; NaN where there is no
        equilibrium.

    Raises:
        InvalidInput: Activations of another shape, not finite, or under which there is no arm
            (ζ <= 0); or a tip map of another kind than the arm's own.
        InvalidDesign: A material has no Young's modulus.
    """
    rod = as_tip_map(arm, tol)
    return _compliance(rod, rod.check_activations("activations", activations))


class PrincipalCompliances(NamedTuple):
    """Axes of the ellipsoid to which forces of one size in all directions move the tip."""

    values: Array
    """|∂r| per |F| along each axis of the ellipsoid, largest first [m/N], shape (n, 3)."""
    displacements: Array
    """Unit vectors along which the tip moves [-], as rows, shape (n, 3, 3)."""
    forces: Array
    """Unit vectors along which a force moves it so [-], as rows, shape (n, 3, 3).

    Those of `displacements` where the compliance is symmetric and the equilibrium stable.
    """

    @property
    def largest(self) -> Array:
        """Compliance where the tip is softest [m/N], shape (n,)."""
        return self.values[:, 0]

    @property
    def smallest(self) -> Array:
        """Compliance where the tip is stiffest [m/N], shape (n,)."""
        return self.values[:, 2]


def principal_compliances(compliance: ArrayLike) -> PrincipalCompliances:
    """The axes of the ellipsoids to which forces of unit size move the tips.

    They are the singular values of the compliance; of a symmetric one with positive eigenvalues
    these are its eigenvalues.

    Args:
        compliance: As of `tip_compliance` [m/N], shape (n, 3, 3).

    Raises:
        InvalidInput: Another shape.
    """
    matrices = as_floats("compliance", compliance)
    if matrices.ndim != 3 or matrices.shape[1:] != (3, 3):
        raise InvalidInput("compliance.shape", matrices.shape, "of shape (n, 3, 3)")
    known = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full((len(matrices), 3), np.nan)
    left, right = np.full((2, len(matrices), 3, 3), np.nan)
    left[known], values[known], right[known] = np.linalg.svd(matrices[known])
    return PrincipalCompliances(values, np.swapaxes(left, 1, 2), right)


def cloud_compliance(cloud: xr.Dataset) -> xr.Dataset:
    """The compliance of the tip at each sample of a cloud.

    Args:
        cloud: A cloud; its design and tolerance are in its attributes. It is read in blocks.

    Returns:
        Dataset over `sample`: `compliance` (sample, axis, force) [m/N], the `largest_compliance`
        and the `smallest_compliance` [m/N], and the `softest_direction` (sample, axis) along which
        the tip moves by the largest. NaN where there is no equilibrium.

    Raises:
        InvalidInput: The dataset is no cloud.
        InvalidDesign: A material has no Young's modulus.
    """
    import xarray as xr

    rod = tip_map_of(check_cloud(cloud))
    n = cloud.sizes["sample"]
    matrices, soft = np.empty((n, 3, 3)), np.empty((n, 3))
    largest, smallest = np.empty((2, n))
    for rows in parallel.blocks(n, 8 * BLOCK):
        matrices[rows] = _compliance(rod, cloud.activation[rows].values)
        axes = principal_compliances(matrices[rows])
        largest[rows], smallest[rows] = axes.largest, axes.smallest
        soft[rows] = axes.displacements[:, 0]
    each, size = ("sample", "axis"), {"units": "m/N", "scale": "log"}
    most, least = ({"long_name": f"{which} compliance"} for which in ("largest", "smallest"))
    whole = {"units": "m/N", "long_name": "compliance of the tip"}
    along = {"units": "1", "long_name": "direction of the largest compliance"}
    return xr.Dataset(
        {
            "compliance": ((*each, "force"), matrices, whole),
            "largest_compliance": ("sample", largest, size | most),
            "smallest_compliance": ("sample", smallest, size | least),
            "softest_direction": (each, soft, along),
        },
        {"axis": list(AXES), "force": list(AXES)},
        cloud.attrs,
    )


def yielding_rod(rod: TipMap) -> LoadedRod:
    """The rod of a tip map that also knows how it yields, in the frame of the base.

    Without loads nothing weighs on it.
    """
    own = of_tip(rod)
    if isinstance(own.rod, LoadedRod) and own.inputs.is_plain:
        return own.rod
    if not isinstance(own.rod, ArmRod) or not own.inputs.is_plain:
        raise InvalidInput("arm", repr(rod), "a Manipulator, or the tip map that it has")
    return _without_loads(own.rod.arm, own.rod.tol)


def _compliance(rod: TipMap, activations: ArrayLike) -> Array:
    """∂r/∂F [m/N] in the frame of a tip map, shape (n, 3, 3)."""
    gamma = rod.box.check(activations)
    at = as_tip_map(rod).inputs.activations(gamma)
    matrices, turn = yielding_rod(rod).compliance(at), rod.pose.rotation
    return matrices if rod.pose.is_identity else turn @ matrices @ turn.T


@lru_cache(maxsize=16)
def _without_loads(arm: Manipulator, tol: float) -> LoadedRod:
    if faults := arm.section.modulus_faults("for a compliance"):
        raise InvalidDesign(faults)
    return LoadedRod(arm, tol)
