"""The surface of an arm in one configuration: its body, its bundles, and how wide they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.geometry.surface import Surface
from softreach.geometry.tube import ribbon_surface, tube_surface
from softreach.schema import configuration_dataset

if TYPE_CHECKING:
    import xarray as xr

    from softreach.arm.manipulator import Manipulator

__all__ = [
    "arm_surface",
    "bundle_bands",
    "bundle_curves",
    "bundle_surfaces",
    "rest_configuration",
]

Array = NDArray[np.float64]


def rest_configuration(arm: Manipulator, stations: int = 101) -> xr.Dataset:
    """The arm before activation: straight along z, directors along x, y, z.

    Args:
        arm: The design.
        stations: Number of stations, evenly spaced in Z.
    """
    z = np.linspace(0.0, arm.length, stations)
    position = np.zeros((1, stations, 3))
    position[..., 2] = z
    shape = configuration_dataset(
        arm,
        np.zeros((1, arm.bundles)),
        z,
        position=position,
        directors=np.tile(np.eye(3), (1, stations, 1, 1)),
        curvature=np.zeros((1, stations, 3)),
        extension=np.ones((1, stations)),
        radius=arm.profile.radius(z),
    )
    return shape.isel(sample=0)


def arm_surface(configuration: xr.Dataset, sides: int = 32) -> Surface:
    """The body of the arm as a closed tube.

    Args:
        configuration: One configuration: position and radius [m], directors, along `station`.
        sides: Corners of each section.

    Raises:
        InvalidInput: Several configurations, or fewer than three sides.
    """
    position, directors = _frame(configuration)
    radius = configuration["radius"].values
    return tube_surface(position, directors[:, 0], directors[:, 1], radius, sides)


def bundle_curves(arm: Manipulator, configuration: xr.Dataset) -> Array:
    """The center line of every bundle on the surface: r + R2 (cos a d1 + sin a d2).

    Args:
        arm: The design; a = arm.outline(Z).center.
        configuration: One configuration of that arm.

    Returns:
        Points [m], shape (bundles, stations, 3).

    Raises:
        InvalidInput: Several configurations.
    """
    return _surface(configuration, arm.outline(configuration["Z"].values).center[..., None])[
        :, :, 0
    ]


def bundle_bands(
    arm: Manipulator, configuration: xr.Dataset, *, lift: float = 0.0, step: float = np.pi / 32
) -> list[Array]:
    """Strips of the surface that show the angular extent σ of every bundle.

    Args:
        arm: The design; bundle j covers a_j - σ_j/2 to a_j + σ_j/2.
        configuration: One configuration of that arm.
        lift: How far above the surface, in R2 [-].
        step: Largest angle between neighboring points across the strip [rad].

    Returns:
        One array of points [m] per bundle, shape (stations, across, 3).

    Raises:
        InvalidInput: Several configurations.
    """
    outline = arm.outline(configuration["Z"].values)
    bands = []
    for center, extent in zip(outline.center.T, outline.extent, strict=True):
        across = 2 + int(extent / step)
        angles = center[:, None] + np.linspace(-extent / 2, extent / 2, across)
        bands.append(_surface(configuration, angles[:, None], 1 + lift)[0])
    return bands


def bundle_surfaces(
    arm: Manipulator, configuration: xr.Dataset, thickness: float = 0.04
) -> list[Surface]:
    """Every bundle as a closed skin, half sunk into the surface.

    Args:
        arm: The design.
        configuration: One configuration of that arm.
        thickness: Of the skin, in R2 [-].

    Raises:
        InvalidInput: Several configurations.
    """
    inner = bundle_bands(arm, configuration, lift=-thickness / 2)
    outer = bundle_bands(arm, configuration, lift=thickness / 2)
    # along x across is d3 x e_θ = -e_R: the inner patch is the upper one
    return [ribbon_surface(high, low) for low, high in zip(inner, outer, strict=True)]


def _surface(configuration: xr.Dataset, angles: ArrayLike, reach: float = 1.0) -> Array:
    """Angles (stations, bundle, across) -> points (bundle, stations, across, 3)."""
    position, directors = _frame(configuration)
    angles = np.asarray(angles, float)
    arm = reach * configuration["radius"].values[:, None, None, None]
    d1, d2 = directors[:, None, None, 0], directors[:, None, None, 1]
    spokes = np.cos(angles)[..., None] * d1 + np.sin(angles)[..., None] * d2
    return (position[:, None, None] + arm * spokes).swapaxes(0, 1)


def _frame(configuration: xr.Dataset) -> tuple[Array, Array]:
    if "sample" in configuration.dims:
        count = configuration.sizes["sample"]
        hint = "choose one with configuration.isel(sample=0)"
        raise InvalidInput("configuration.sizes['sample']", count, "absent: one shape", hint)
    position = configuration["position"].transpose("station", "axis").values
    return position, configuration["directors"].transpose("station", "director", "axis").values
