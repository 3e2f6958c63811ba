"""The surface of an arm in one configuration: its body, its bundles, and how wide they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm import skin
from softreach.arm.driving import body_of
from softreach.arm.lines import lengths_of_strains
from softreach.arm.skin import Centerline
from softreach.arm.tables import quadrature
from softreach.geometry.surface import Surface
from softreach.schema import configuration_dataset
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

    from softreach.arm.manipulator import Manipulator

__all__ = [
    "arm_surface",
    "bundle_curves",
    "bundle_skins",
    "bundle_surfaces",
    "marker_points",
    "rest_configuration",
]

Array = NDArray[np.float64]


def rest_configuration(arm: Manipulator, stations: int = 101) -> xr.Dataset:
    """The arm before activation: straight from its base, directors along the axes of that.

    Args:
        arm: The design.
        stations: Number of stations, evenly spaced in Z.
    """
    z = np.linspace(0.0, arm.length, stations)
    straight = np.zeros((1, stations, 3))
    straight[..., 2] = z
    directors = np.tile(np.eye(3), (1, stations, 1, 1))
    nodes = len(quadrature(body_of(arm))[0])
    straight_lines = lengths_of_strains(arm, np.zeros((1, nodes, 3)), np.ones((1, nodes)))
    lines: dict[str, Any] = {"line_length": straight_lines} if arm.bundles else {}
    shape = configuration_dataset(
        arm,
        np.zeros((1, arm.inputs)),
        z,
        position=arm.base.to_world(straight),
        directors=arm.base.directions_to_world(directors),
        curvature=np.zeros((1, stations, 3)),
        extension=np.ones((1, stations)),
        radius=arm.profile.radius(z),
        **lines,
    )
    return shape.isel(sample=0)


def arm_surface(arm: Manipulator, configuration: xr.Dataset, sides: int = 32) -> Surface:
    """The body of the arm as a closed tube.

    Args:
        arm: The design; where its radius is not smooth, the tube has a section.
        configuration: One configuration of that arm.
        sides: Corners of each section.

    Raises:
        InvalidInput: Several configurations, or fewer than three sides.
    """
    return skin.body_skin(arm, _drawn_line(arm, configuration), sides)


def bundle_curves(arm: Manipulator, configuration: xr.Dataset) -> Array:
    """The middle of every bundle, also where it does not act: r + R (cos a d1 + sin a d2).

    Args:
        arm: The design; a = arm.outline(Z).center. R is the distance of lines and lumens from the
            axis, and the outer radius of the ring that a sector is in.
        configuration: One configuration of that arm.

    Returns:
        Points [m], shape (bundles, stations, 3).

    Raises:
        InvalidInput: Several configurations.
    """
    return skin.bundle_curves(arm, _line(configuration))


def bundle_skins(
    arm: Manipulator, configuration: xr.Dataset, *, lift: float = 0.0, step: float = np.pi / 32
) -> list[Surface]:
    """Surfaces of all bundles where they act: bands, thin tubes for lines, tubes for lumens.

    Args:
        arm: The design; band j covers a_j - σ_j/2 to a_j + σ_j/2 on the outside of its ring.
        configuration: One configuration of that arm.
        lift: Height of bands above their ring, in R2 [-].
        step: Largest angle between neighboring points across a band [rad].

    Returns:
        One surface for each bundle; bands are open, and the points of each are (stations, across).

    Raises:
        InvalidInput: Several configurations.
    """
    return skin.bundle_skins(arm, _drawn_line(arm, configuration), lift=lift, step=step)


def bundle_surfaces(
    arm: Manipulator, configuration: xr.Dataset, thickness: float = 0.04
) -> list[Surface]:
    """Every bundle as a closed surface; bands are half sunk into the outside of their ring.

    Args:
        arm: The design.
        configuration: One configuration of that arm.
        thickness: Of bands, in R2 [-].

    Raises:
        InvalidInput: Several configurations.
    """
    return skin.bundle_solids(arm, _drawn_line(arm, configuration), thickness=thickness)


def marker_points(arm: Manipulator, configuration: xr.Dataset) -> Array:
    """Places of the markers of an arm, between the stations of a configuration for pictures.

    Args:
        arm: The design.
        configuration: One configuration of that arm, from its base to its tip.

    Returns:
        Points [m], shape (marker, 3).

    Raises:
        InvalidInput: Several configurations.
    """
    if not arm.markers:
        return np.empty((0, 3))
    stations = np.array([marker.station_at("station", arm.length) for marker in arm.markers])
    line = _line(configuration).with_stations(np.unique(stations))
    section = np.abs(line.z - stations[:, None]).argmin(axis=1)
    offsets = np.array([marker.offset for marker in arm.markers])
    return line.position[section] + np.einsum("mk,mkx->mx", offsets, line.directors[section])


def _drawn_line(arm: Manipulator, configuration: xr.Dataset) -> Centerline:
    """With stations where the radius has kinks and where bundles begin and end."""
    return _line(configuration).with_stations(arm.breakpoints)


def _line(configuration: xr.Dataset) -> Centerline:
    if not (least := float(configuration["extension"].min())) > 0.0:
        hint = "ask for the configuration of activations within the bounds of the design"
        extension = f"with extension ζ = {least:.4g}"
        raise InvalidInput("configuration", extension, "of an arm that has a length, ζ > 0", hint)
    if "sample" in configuration.dims:
        count = configuration.sizes["sample"]
        hint = "choose one with configuration.isel(sample=0)"
        raise InvalidInput("configuration.sizes['sample']", count, "absent: one shape", hint)
    return Centerline(
        z=configuration["Z"].values,
        position=configuration["position"].transpose("station", "axis").values,
        directors=configuration["directors"].transpose("station", "director", "axis").values,
    )
