"""Volume that a cloud of tips fills, and the share of its hull that it cannot reach (section 4)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry import hull as hulls
from softreach.geometry.alpha_shape import AlphaComplex, alpha_hull, delaunay
from softreach.geometry.hull import Hull, alpha_area, convex_edges, enclosed_area, plane_of
from softreach.sampling import sample_cube
from softreach.schema import AXES, is_stable
from softreach.support import parallel
from softreach.support.arguments import POSITIVE, as_flag, as_given, plain
from softreach.support.arrays import Mask, as_floats, as_points, labeled
from softreach.support.errors import InvalidInput, warn

if TYPE_CHECKING:
    import xarray as xr

DEFAULT_RADIUS = 0.05  # of the arm's length
SPACINGS = 3.0  # a smaller ball falls through between the points
SPARSE = 0.6  # of the spacing that points would have if they filled their convex hull
_PLACES = 1 << 16  # by which the overlap of two shapes is measured
_FLAT = 2e-6  # of its extent, that a cloud in one plane is thick: tips err by as much
QUARTER_SPACINGS = 2.5  # below, V(N/4) leaves the law N^-1/2: design/triangulation.md


def concave_hull(
    points: np.ndarray | xr.DataArray, alpha: float | str | None = None, *, bias: bool = False
) -> Hull:
    """The alpha shape of a cloud: what a ball of radius alpha cannot scoop out of its convex hull.

    The volume of a random cloud of N points falls short of that of infinitely many by an amount
    that shrinks as N^-1/2 (2 to 3 % for 400,000 tips), the same in every repetition. With
    ``bias=True`` the shape of a quarter of the points is measured too, on the way to that of all,
    and gives the estimate ``Hull.volume_corrected`` = 2 V(N) - V(N/4); it stays None, with a
    warning, if alpha is too small for the quarter. It is meant for random clouds: a grid has less
    bias than this takes it to have. It estimates the alpha shape of infinitely many points, which
    bridges gaps and hollows narrower than 2 alpha: right for a smooth convex body, it is 3 % too
    large for two unit balls 0.3 apart at alpha = 0.3, and 7 % at 0.45.

    ``alpha="critical"`` is the smallest radius at which one region covers all points. Neither it
    nor the volume there converges with N, as the most isolated point decides: compare clouds at a
    fixed radius.

    Points in one plane, on one line or fewer than four have volume 0 and no faces; so have more
    than some hundreds on a curve, such as the tips of one bundle.

    Args:
        points: Tips [m], shape (n, 3), or ``cloud.tip``, of which those that are no stable
            equilibria are left out.
        alpha: Radius [m]; ``"critical"``; or None for 0.05 of ``points.attrs["length"]``.
        bias: Whether to estimate the sampling bias.

    Raises:
        InvalidInput: Points of another shape, or not finite; a radius that is not positive, or
            None for points that do not carry their arm's length.

    Warns:
        SoftreachWarning: The radius is below three mean spacings of the points, or below two and a
            half of a quarter of them when the bias is asked for.

    References:
        [EdelsbrunnerMuecke1994]

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=20_000)
        >>> print(f"{sr.concave_hull(cloud.tip, alpha=0.1).volume:.2f} m³")
        0.63 m³
    """
    bias, positions, radius = as_flag("bias", bias), _positions(points), _radius(alpha, points)
    quarter = None
    if bias:  # a random quarter: every fourth point of a Sobol sequence lies in one part of the box
        quarter = np.zeros(len(positions), bool)
        quarter[np.random.default_rng(0).permutation(len(positions))[: len(positions) // 4]] = True
    hull, volume_of_quarter = _shape(positions, radius, quarter)
    _warn_if_fine(hull, positions)
    if quarter is None:
        return hull
    return _corrected(hull, replace(hull, volume=volume_of_quarter, n=int(quarter.sum())))


def convex_hull(points: np.ndarray | xr.DataArray) -> Hull:
    """The convex hull of a cloud, by Qhull.

    Points in one plane, on one line or fewer than four have volume 0 and no faces.

    Args:
        points: Tips [m], shape (n, 3), or ``cloud.tip``, of which those that are no stable
            equilibria are left out.

    Raises:
        InvalidInput: Points of another shape, or not finite.
    """
    return hulls.convex_hull(_positions(points))


def unreachability(points: np.ndarray | xr.DataArray, alpha: float | str | None = None) -> float:
    """The part of the convex hull that the cloud does not fill, UNR = 1 - V_conc / V_conv [-].

    Both volumes are smaller than those of infinitely many points,
    the first by more, so that the share is a few percent too large: `concave_hull` estimates the
    bias of the volume, and `reachable_set` needs no points. Of a cloud in one plane it is the share
    of the area; NaN for a cloud on a line, as 0/0 says nothing.

    Args:
        points: Tips [m], shape (n, 3), or ``cloud.tip``, of which those that are no stable
            equilibria are left out.
        alpha: Radius as in `concave_hull`.

    Raises:
        InvalidInput: As `concave_hull`.

    Warns:
        SoftreachWarning: The radius is below three mean spacings of the points.
    """
    positions = _positions(points)
    radius = _radius(alpha, points)
    if isinstance(radius, float) and (areas := flat_areas(positions, radius)) is not None:
        return 1.0 - areas[0] / areas[1] if areas[1] > 0.0 else np.nan
    with parallel.meanwhile(partial(hulls.convex_hull, positions)) as convex_hull:
        hull, _ = _shape(positions, radius, None)
        convex = convex_hull().volume or alpha_hull(positions, np.inf)[0].volume  # almost flat
    _warn_if_fine(hull, positions)
    return 1.0 - hull.volume / convex if convex > 0 else np.nan  # theory (37)


def flat_areas(points: np.ndarray, alpha: float) -> tuple[float, float] | None:
    """Areas of the alpha shape and of the convex hull of points in one plane [m²].

    Args:
        points: [m], shape (n, 3).
        alpha: Radius [m].

    Returns:
        None if they lie in no plane, to 2e-6 of their extent.

    Raises:
        InvalidInput: Points that are no numbers.
    """
    points = as_floats("points", points)
    size = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    plane = plane_of(points, _FLAT * size) if len(points) > 3 else None
    if plane is None:
        return None
    flat = plane.coordinates(points)
    return alpha_area(flat, alpha), enclosed_area(flat, convex_edges(flat))


def volume_curve(points: np.ndarray | xr.DataArray, alphas: ArrayLike) -> np.ndarray:
    """Volumes of the alpha shapes of many radii, from one triangulation.

    Args:
        points: Tips [m], shape (n, 3), or ``cloud.tip``, of which those that are no stable
            equilibria are left out.
        alphas: Radii [m], any shape.

    Returns:
        Volumes [m³], shape of the radii.

    Raises:
        InvalidInput: Points of another shape, or not finite; radii that are negative or NaN.
    """
    radii = as_floats("alphas", alphas)
    if not (radii >= 0).all():  # NaN too
        raise InvalidInput("alphas", radii, "radii of 0 or more [m]")
    return np.asarray(AlphaComplex(triangulation=delaunay(_positions(points))).volume(radii))


def compare(hull: Hull, other: Hull) -> xr.Dataset:
    """Compare two shapes, such as those of measured places and of a design.

    Returns:
        Dataset with `overlap` and `symmetric_difference` [m³], found by 65,536 places, with their
        standard error `overlap_error`; and how far corners of each are outside of the other at
        most, `farthest` and `farthest_of_other` [m].

    Raises:
        InvalidInput: One is no hull.
        NotPossible: One has no volume.
    """
    import xarray as xr

    for name, each in (("hull", hull), ("other", other)):
        if not isinstance(each, Hull):
            raise InvalidInput(name, type(each).__name__, "a Hull, such as of concave_hull(points)")
    low, high = np.stack([each.solid.bounds for each in (hull, other)], axis=1)
    low, widths = low.max(axis=0), (high.min(axis=0) - low.max(axis=0)).clip(0.0)
    places = low + widths * sample_cube("sobol", _PLACES, 3)
    is_shared = hull.contains(places) & other.contains(places)
    box, share = float(widths.prod()), float(is_shared.mean())
    ways = (hull, other), (other, hull)
    back, out = (float(x.solid.distance(y.vertices).max().clip(0.0)) for x, y in ways)
    numbers = {
        "volume_of_other": (other.volume, "m3"),
        "overlap": (box * share, "m3"),
        "overlap_error": (box * np.sqrt(share * (1.0 - share) / _PLACES), "m3"),
        "symmetric_difference": (hull.volume + other.volume - 2.0 * box * share, "m3"),
        "farthest": (out, "m"),
        "farthest_of_other": (back, "m"),
    }
    return xr.Dataset({name: ((), x, {"units": unit}) for name, (x, unit) in numbers.items()})


def _positions(points: np.ndarray | xr.DataArray) -> np.ndarray:
    """Points (n, 3), of an arm under loads the stable tips; labeled axes may be in either order."""
    array = as_floats("points", labeled("points", points, AXES))
    if not isinstance(points, np.ndarray) and "status" in getattr(points, "coords", ()):
        array = array[is_stable(points)]
    return as_points("points", array, any_scale=True)


def _radius(alpha: float | str | None, points: np.ndarray | xr.DataArray) -> float | str:
    """The radius [m], by default that for the length of the arm, or ``"critical"``."""
    if alpha is None:
        if (length := getattr(points, "attrs", {}).get("length")) is None:
            hint = "only points with attrs['length'] [m], as cloud.tip has, have a default"
            hint = f"{hint} of {DEFAULT_RADIUS} of it"
            raise InvalidInput("alpha", None, "a radius [m] for these points", hint)
        return DEFAULT_RADIUS * float(length)
    radius = plain(alpha)
    if isinstance(radius, str) and radius == "critical":
        return radius
    if POSITIVE.admits(radius) or (isinstance(radius, float) and radius == np.inf):
        return float(radius)  # infinity keeps every tetrahedron
    raise InvalidInput("alpha", as_given(alpha), "a radius > 0 [m], 'critical', or None")


def _shape(positions: np.ndarray, radius: float | str, part: Mask | None) -> tuple[Hull, float]:
    """The alpha shape, and the volume of that of a part; box by box if the radius is known."""
    if radius != "critical":
        return alpha_hull(positions, float(radius), part=part)
    clouds = [positions] if part is None else [positions, positions[part]]
    meshes = parallel.in_order(partial(delaunay, cloud) for cloud in clouds)
    shape, *of_part = (AlphaComplex(triangulation=mesh) for mesh in meshes)
    hull = shape.hull(shape.critical_alpha())
    return hull, sum(each.hull(hull.alpha).volume for each in of_part)


def _warn_if_fine(hull: Hull, positions: np.ndarray) -> None:
    """Warn if the radius is too small for the density of the points.

    A shape that has fallen apart has hardly any volume, hence no spacing of its own to judge by:
    the convex hull bounds it from below, for clouds that fill a fifth of their hull or more.
    """
    if hull.n == 0:
        return
    in_box = float(np.cbrt(np.ptp(positions, axis=0) / hull.n ** (1 / 3)).prod())
    if hull.alpha >= SPACINGS * max(hull.spacing, SPARSE * in_box):
        return  # the convex hull is no larger than the box
    convex = hulls.convex_hull(positions) if hull.volume > 0 else alpha_hull(positions, np.inf)[0]
    spacing = max(hull.spacing, SPARSE * convex.spacing)  # none on a curve
    if hull.alpha < SPACINGS * spacing:
        warn(
            f"alpha = {_in_spacings(hull, spacing)}: below {SPACINGS:g} the shape has holes "
            "between points and its volume is too small; use more points or a larger alpha"
        )


def _in_spacings(hull: Hull, spacing: float) -> str:
    return (
        f"{hull.alpha:.4g} m is {hull.alpha / spacing:.2g} mean spacings of "
        f"{hull.n} points ({spacing:.4g} m)"
    )


def _corrected(hull: Hull, quarter: Hull) -> Hull:
    """The hull with V* = 2 V(N) - V(N/4), from that of a quarter of the points."""
    if quarter.volume == 0.0 < hull.volume:
        warn(
            f"no estimate of the bias: {quarter.n} points, a quarter of the cloud, have no volume "
            f"at alpha = {hull.alpha:.4g} m; use more points or a larger alpha"
        )
        return hull
    if quarter.alpha < QUARTER_SPACINGS * quarter.spacing:
        warn(
            f"no estimate of the bias: alpha = {_in_spacings(quarter, quarter.spacing)}, a quarter "
            f"of the cloud; below {QUARTER_SPACINGS:g} the law N^-1/2 fails; use more points or a "
            "larger alpha"
        )
        return hull
    # theory (47)
    return replace(hull, volume_corrected=2.0 * hull.volume - quarter.volume)
