"""Forward kinematics: where the tip is, how it moves, what shape the arm takes.

The base clamps the arm at Z = 0, its z is d3 there; places are in the world by default.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softreach import schema
from softreach.arm.driving import body_of
from softreach.arm.lines import lengths_of_strains
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import quadrature
from softreach.rod.rods import ArmMap, as_tip_map, with_unstable
from softreach.rod.tip_map import Device, Frame, Frames, Strains, TipMap
from softreach.support import parallel
from softreach.support.arguments import as_given, plain
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr


_LINES_TOGETHER = 256  # samples


def tip_positions(
    arm: Manipulator | TipMap,
    activations: ArrayLike,
    tol: float = 1e-6,
    *,
    frame: Frame = "world",
    device: Device = "cpu",
) -> Array:
    """Tip positions of many activations: theory (25), by sixth-order Magnus integration.

    Args:
        arm: The design, or its tip map.
        activations: γ [-], shape (n, bundles), or (bundles,) for one; values outside the bounds are
            allowed, but `tol` is promised inside them.
        tol: Largest tip error, in L; it decides the number of steps.
        frame: Frame of the tips: that of the "world", or of the "base", whose z is along the
            straight arm.
        device: What computes them: "cpu", or "cuda" for a GPU, of arms without loads.

    Returns:
        Tips [m], shape (n, 3).

    Raises:
        InvalidInput: Activations of another shape, not finite, or such that there is no arm
            (ζ <= 0) or none that the steps follow; or a `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
        MissingExtra: `softreach[cuda]` is not installed.
        NotPossible: There is no GPU, no driver for it, or the arm has loads.

    Examples:
        >>> sr.tip_positions(sr.designs.minimal_trunk(), [[0, 0, 0], [-1, 0, 0]]).round(3)
        array([[0.   , 0.   , 1.   ],
               [0.398, 0.167, 0.022]])
    """
    tip_map = with_unstable(as_tip_map(arm, tol, frame=frame, device=device))
    return tip_map.tips(tip_map.check_activations("activations", activations))


def tip_jacobian(
    arm: Manipulator | TipMap,
    activations: ArrayLike,
    tol: float = 1e-6,
    *,
    frame: Frame = "world",
    device: Device = "cpu",
) -> Array:
    """Spatial twist of the tip per unit of each activation: the exact derivative of the tip.

    Column j is (v, ω): ω [rad] turns the tip frame, and the tip at p moves by v + ω × p [m],
    theory (29) and (31).

    Args:
        arm: The design, or its tip map.
        activations: γ [-], shape (n, bundles).
        tol: As for `tip_positions`, whose derivative this is to rounding.
        frame: As for `tip_positions`; v is the velocity of what passes its origin.
        device: As for `tip_positions`.

    Returns:
        Jacobians, shape (n, 6, bundles), linear rows first.

    Raises:
        InvalidInput: As for `tip_positions`.
        MissingExtra: As for `tip_positions`.
        NotPossible: As for `tip_positions`.

    Examples:
        >>> twists = sr.tip_jacobian(sr.designs.minimal_trunk(), [[-1, -0.5, 0]])
        >>> linear, angular = twists[0, :3], twists[0, 3:]
        >>> linear.shape
        (3, 3)
    """
    tip_map = with_unstable(as_tip_map(arm, tol, frame=frame, device=device))
    return tip_map.tip_twists(tip_map.check_activations("activations", activations))[1]


def marker_positions(
    arm: Manipulator | TipMap, activations: ArrayLike, tol: float = 1e-6, *, frame: Frame = "world"
) -> Array:
    """Places of the markers of an arm under many activations, such as those of a cloud.

    Args:
        arm: The design, or its tip map.
        activations: γ [-], shape (n, bundles), or (bundles,) for one.
        tol: As for `tip_positions`.
        frame: As for `tip_positions`.

    Returns:
        Places [m] in the order of `Manipulator.markers`, shape (n, marker, 3); NaN where there is
        no equilibrium.

    Raises:
        InvalidInput: As for `tip_positions`.
    """
    tip_map = with_unstable(as_tip_map(arm, tol, frame=frame))
    return _markers(tip_map, tip_map.check_activations("activations", activations))


def _markers(tip_map: TipMap, gamma: Array) -> Array:
    if not len(z := marker_sections(tip_map.arm)):
        return np.empty((len(gamma), 0, 3))
    return marked(tip_map.arm, z, tip_map.frames(gamma, z))


def marker_sections(arm: Manipulator) -> Array:
    """Z of the sections of all markers [m], ascending."""
    return np.unique([marker.station_at("station", arm.length) for marker in arm.markers])


def marked(arm: Manipulator, z: Array, frames: Frames) -> Array:
    """r + x d1 + y d2 + z d3 of each marker [m], shape (n, marker, 3).

    Of frames at ascending stations Z [m] that hold `marker_sections`.
    """
    stations = [marker.station_at("station", arm.length) for marker in arm.markers]
    offsets = np.reshape([marker.offset for marker in arm.markers], (-1, 3))
    section = np.searchsorted(z, stations)
    turned = np.einsum("mk,nmkx->nmx", offsets, frames.directors[:, section])
    return frames.position[:, section] + turned


def configuration(
    arm: Manipulator | TipMap,
    activation: ArrayLike,
    stations: int | ArrayLike = 101,
    tol: float = 1e-6,
    *,
    frame: Frame = "world",
) -> xr.Dataset:
    """The whole shape of the arm: centerline, directors, curvature and extension along Z.

    Args:
        arm: The design, or its tip map.
        activation: γ [-], shape (bundles,), or (n, bundles) for a leading `sample` dimension.
        stations: Number of stations, evenly spaced from base to tip, or their Z [m], ascending.
        tol: Largest error of the tip, in L.
        frame: As for `tip_positions`.

    Returns:
        Dataset with `position` [m], `directors` (d1, d2, d3), `curvature` u [1/m] in the directors,
        `extension` ζ and `radius` R2 [m], over `station` (coordinate Z [m]); `marker_position` [m]
        over `marker`, if the arm has markers. `line_length` [m] over `line` of the middle line of
        each bundle where it acts, and `bundle_activation` there, such as tensions [N], if drives or
        displacements lead to them.

    Raises:
        InvalidInput: Activations or stations of another shape or out of range, or activations
            under which there is no arm (ζ <= 0).

    Examples:
        >>> shape = sr.configuration(sr.designs.three_tendon_robot(), [1, 0, 0], stations=3)
        >>> shape.position.values.round(3)  # [m], of base, middle and tip
        array([[0.   , 0.   , 0.   ],
               [0.   , 0.005, 0.1  ],
               [0.   , 0.02 , 0.199]])
    """
    tip_map = with_unstable(as_tip_map(arm, tol, frame=frame))
    values = as_floats("activation", activation)
    gamma = tip_map.check_activations("activation", np.atleast_2d(values))
    z = stations_along(tip_map, stations)
    nodes = quadrature(body_of(tip_map.arm))[0] if tip_map.arm.bundles else np.empty(0)
    strained = np.union1d(z, nodes)
    shapes = tip_map.shapes(gamma, z, strained)
    strains = Strains(shapes.curvature, shapes.extension)
    at_stations, on_lines = (
        Strains(*(values[:, np.searchsorted(strained, places)] for values in strains))
        for places in (z, nodes)
    )
    others = _lines(tip_map, gamma, on_lines)
    others["marker_position"] = _markers(tip_map, gamma)
    dataset = shape_dataset(tip_map, gamma, z, Frames(*shapes[:2]), at_stations, **others)
    if tip_map.supports_unstable:
        dataset = schema.with_status(dataset, shapes.status)
    return dataset.isel(sample=0) if values.ndim == 1 else dataset


def rest_configuration(arm: Manipulator, stations: int = 101) -> xr.Dataset:
    """The arm before activation: straight from its base, at so many stations even in Z."""
    z, lines = np.linspace(0.0, arm.length, stations), dict[str, Any]()
    if arm.bundles:
        nodes = len(quadrature(body_of(arm))[0])
        straight = np.zeros((1, nodes, 3)), np.ones((1, nodes))
        lines["line_length"] = lengths_of_strains(arm, *straight)
    shape = schema.configuration_dataset(
        arm,
        np.zeros((1, arm.inputs)),
        z,
        position=arm.base.to_world(z[None, :, None] * np.array([0.0, 0.0, 1.0])),
        directors=arm.base.directions_to_world(np.tile(np.eye(3), (1, stations, 1, 1))),
        curvature=np.zeros((1, stations, 3)),
        extension=np.ones((1, stations)),
        radius=arm.profile.radius(z),
        **lines,
    )
    return shape.isel(sample=0)


def shape_dataset(
    tip_map: TipMap, gamma: Array, z: Array, frames: Frames, strains: Strains, **others: Array
) -> xr.Dataset:
    """Shapes at stations Z [m] as `configuration` has them, one for each row of activations."""
    return schema.configuration_dataset(
        tip_map.arm,
        gamma * tip_map.measures,
        z,
        names=tip_map.box.names,
        frame=tip_map.frame,
        **frames._asdict(),
        **strains._asdict(),
        radius=tip_map.radius(z),
        **{name: values for name, values in others.items() if values.shape[1]},
    )


def _lines(tip_map: ArmMap, gamma: Array, strains: Strains) -> dict[str, Array]:
    """Lengths of the lines of bundles, and what drives and displacements activate there."""
    arm, length = tip_map.arm, np.empty((len(gamma), tip_map.arm.bundles))
    if not arm.bundles:
        return {}
    for b in parallel.blocks(len(gamma), _LINES_TOGETHER):
        extension = strains.extension[b]
        turn = strains.curvature[b] * extension[..., None]
        length[b] = lengths_of_strains(arm, turn, extension)
    if arm.is_direct:
        return {"line_length": length}
    activation = tip_map.inputs.activations(gamma)[:, : arm.bundles]
    return {"line_length": length, "bundle_activation": activation}


def stations_along(tip_map: TipMap, stations: int | ArrayLike) -> Array:
    """Z [m] of stations given by their number, even from base to tip, or by themselves, ascending.

    Raises:
        InvalidInput: No such number or stations.
    """
    if isinstance(stations, list | tuple) or getattr(stations, "ndim", 0) > 0:
        return tip_map.check_stations(stations)
    number = plain(stations)
    if isinstance(number, bool) or not isinstance(number, int) or number < 2:
        raise InvalidInput("stations", as_given(stations), "2 or more, or the stations' Z in m")
    return np.linspace(0.0, tip_map.length, number)
