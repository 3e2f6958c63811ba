"""How well the tip can be moved from each sample of a cloud, from the Jacobian there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.cloud import design_of
from softreach.kinematics import BLOCK, tips_and_jacobians
from softreach.manipulator import Manipulator
from softreach.schema import check_cloud

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["dexterity"]

Array = NDArray[np.float64]
Signs = NDArray[np.int8]


def dexterity(cloud: xr.Dataset) -> xr.Dataset:
    """Manipulability, condition number and orientation of the tip map at each sample.

    With J = ∂r/∂γ, of shape (3, m): manipulability is √det(J Jᵀ) (Yoshikawa 1985), for three
    bundles |det J|, the volume that the tip sweeps per unit of activations; with fewer bundles
    √det(Jᵀ J), the area or length. It vanishes, and the condition number is infinite, on a fold.

    Args:
        cloud: A cloud; its design and tolerance are in its attributes. It is read in blocks.

    Returns:
        Dataset over `sample`: `manipulability` [m³] (m² or m for two bundles or one),
        `condition` [-] and, for three bundles, `orientation`, the sign of det J.

    Raises:
        InvalidInput: The dataset is no cloud.
    """
    import xarray as xr

    check_cloud(cloud)
    arm, n = design_of(cloud), cloud.sizes["sample"]
    measure, condition = np.empty(n), np.empty(n)
    sign = np.empty(n, np.int8)
    for rows in parallel.blocks(n, 8 * BLOCK):
        slope = _slopes(arm, cloud.activation[rows].values, float(cloud.attrs["tol"]))
        parallel.run(_tasks(slope, measure[rows], condition[rows], sign[rows]))
    unit = {1: "m", 2: "m2"}.get(arm.bundles, "m3")
    result = xr.Dataset(attrs=cloud.attrs)
    result["manipulability"] = ("sample", measure, {"units": unit, "long_name": "√det(J Jᵀ)"})
    result["condition"] = (
        "sample",
        condition,
        {"units": "1", "long_name": "condition of J"},
    )
    if arm.bundles == 3:
        result["orientation"] = ("sample", sign, {"units": "1", "long_name": "sign of det J"})
    return result


def _slopes(arm: Manipulator, gamma: Array, tol: float) -> Array:
    """∂r/∂γ = v + ω × r [m], shape (n, 3, m)."""
    tips, jacobians = tips_and_jacobians(arm, gamma, tol)
    turn = np.cross(jacobians[:, 3:], tips[:, :, None], axis=1)
    return jacobians[:, :3] + turn


def _tasks(slope: Array, measure: Array, condition: Array, sign: Signs) -> Iterator[partial[None]]:
    for rows in parallel.blocks(len(slope), 4096):
        yield partial(_measure, slope[rows], measure[rows], condition[rows], sign[rows])


def _measure(slope: Array, measure: Array, condition: Array, sign: Signs) -> None:
    sigma = np.linalg.svd(slope, compute_uv=False)
    measure[:] = sigma.prod(axis=1)
    with np.errstate(divide="ignore"):
        condition[:] = sigma[:, 0] / sigma[:, -1]
    if slope.shape[2] == 3:
        sign[:] = np.sign(np.linalg.det(slope))
