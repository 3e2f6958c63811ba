"""Parts of requirements as frozen values: targets to reach, regions to keep to, limits."""

import dataclasses
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.regions import Region
from softreach.inverse.request import ANGLE_TOL
from softreach.support import arguments
from softreach.support.arrays import Array, Mask, as_directions, as_points, read_only
from softreach.support.errors import InvalidInput, Range

MOST_PLACES = 1_000_000  # Places that all targets may have together
TOL = 1e-6  # over L: a place that is reached to the error of the tips is reached

_LENGTH = Range(0.0, unit="m")
_SHARE = Range(0.0, 1.0, open_low=True)
_CONE = Range(0.0, np.pi, unit="rad")
_REGION = "a region: Box, Sphere, HalfSpace or Mesh"


class Goals(NamedTuple):
    """Places to reach, each with the direction that the tip must have there."""

    places: Array  # [m], shape (n, 3)
    within: Array  # Distance to which each must be reached [m], shape (n,)
    directions: Array  # Unit vectors, NaN where any direction will do, shape (n, 3)
    cones: Array  # Angles around these that are allowed [rad], shape (n,)

    @classmethod
    def of(cls, places: Array, within: float) -> Self:
        """Places that any direction of the tip will do for."""
        n = len(places)
        return cls(places, np.full(n, within), np.full((n, 3), np.nan), np.full(n, np.pi))

    @property
    def directed(self) -> Mask:
        """Mask of those with a direction, shape (n,)."""
        return self.cones < np.pi

    def reached(self, gaps: Array, direction_errors: Array, length: float) -> Mask:
        """Mask of distances [m] and angles [rad] that do for an arm of a length L [m]; (..., n)."""
        near = gaps <= np.maximum(self.within, TOL * length)
        return near & ~(direction_errors > self.cones + ANGLE_TOL)


@dataclass(frozen=True, eq=False)
class Target:
    """Places that the tip must reach, or a region of which it must reach a share.

    Raises:
        InvalidInput: Neither places nor a region, both, or numbers out of range.
    """

    places: ArrayLike | None = None
    """A place, the places of a path, or a cloud of places [m], shape (n, 3)."""
    _: dataclasses.KW_ONLY
    region: Region | None = None
    """A region to be covered instead."""
    share: float = 1.0
    """Share of the region that must be reached [-]."""
    within: float = 0.0
    """Distance to which the tip must come to a place [m]; 0 for the error of the tips."""
    direction: ArrayLike | None = None
    """Direction of the tip's tangent d3 at the places, in the world and of any length [-], shape
    (3,) for all of them or (n, 3); None if any will do."""
    cone: float = 0.0
    """Angle from it that is allowed [rad]; with π any direction will do."""
    name: str = ""
    """Name in results."""

    def __post_init__(self) -> None:
        if (self.places is None) == (self.region is None):
            raise InvalidInput("places", arguments.as_given(self.places), "given, or else a region")
        if self.places is not None:
            places = as_points("places", self.places)
            if not 0 < len(places) <= MOST_PLACES:
                raise InvalidInput("places", f"{len(places):,}", f"from 1 to {MOST_PLACES:,}")
            object.__setattr__(self, "places", read_only(places.copy()))
        else:
            region = arguments.as_instance("region", self.region, Region, _REGION)
            if not np.isfinite(region.volume):
                raise InvalidInput("region", region, "bounded: a half-space has no end")
        object.__setattr__(self, "share", arguments.as_number("share", self.share, _SHARE))
        if self.region is None and self.share != 1.0:
            raise InvalidInput("share", self.share, "left out where there is no region")
        object.__setattr__(self, "within", arguments.as_number("within", self.within, _LENGTH))
        arguments.as_text("name", self.name)
        object.__setattr__(self, "cone", arguments.as_number("cone", self.cone, _CONE))
        if self.direction is None and self.cone:
            raise InvalidInput("cone", self.cone, "left out where there is no direction")
        if self.direction is not None:
            if self.region is not None:
                allowed = "left out where there is a region"
                raise InvalidInput("direction", arguments.as_given(self.direction), allowed)
            as_directions("direction", self.direction, len(self.points))
            object.__setattr__(self, "direction", read_only(np.array(self.direction, float)))

    @property
    def points(self) -> Array:
        """The places [m], shape (n, 3); none where there is a region."""
        return np.empty((0, 3)) if self.places is None else np.asarray(self.places)

    @property
    def goals(self) -> Goals:
        """The places with what is asked for there."""
        goals = Goals.of(self.points, self.within)
        if self.direction is None or self.cone == np.pi:
            return goals
        count = len(self.points)
        ways = as_directions("direction", self.direction, count)
        return goals._replace(directions=ways, cones=np.full(count, self.cone))


@dataclass(frozen=True, eq=False)
class Keep:
    """A region that the arm must stay in, or must avoid.

    Raises:
        InvalidInput: No region, or a value that is not one of those listed.
    """

    region: Region
    """The region."""
    inside: bool
    """True to stay inside, False to avoid it."""
    _: dataclasses.KW_ONLY
    of: Literal["tip", "arm"] = "arm"
    """The tip alone, or the arm from base to tip as wide as the widest of its body and its bundles
    before activation: tendons outside of the body run through disks of at least that radius."""
    when: Literal["targets", "always"] = "targets"
    """Poses that are judged: those used at the targets, or every pose within the bounds, among
    which samples and a polish search the worst, without proof."""
    clearance: float = 0.0
    """Distance to keep from the boundary [m]."""
    name: str = ""
    """Name in results."""

    def __post_init__(self) -> None:
        arguments.as_instance("region", self.region, Region, _REGION)
        arguments.as_flag("inside", self.inside)
        arguments.as_one_of("of", self.of, ("tip", "arm"))
        arguments.as_one_of("when", self.when, ("targets", "always"))
        clearance = arguments.as_number("clearance", self.clearance, _LENGTH)
        object.__setattr__(self, "clearance", clearance)
        arguments.as_text("name", self.name)

    @property
    def kind(self) -> str:
        """Table of a file that it stands in: "stay_inside" or "avoid"."""
        return "stay_inside" if self.inside else "avoid"

    def missed(self, points: Array) -> Array:
        """Signed distances of points (n, 3) from the allowed region [m], negative inside it."""
        distance = self.region.distance(points)
        return (distance if self.inside else -distance) + self.clearance


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Upper limits of an arm; None for no limit.

    Those of poses (shortening, force, pressure, stroke, bending) are judged in the poses that are
    used at the targets; where there are no targets, over all of the bounds: bending exactly where
    strains are affine in the inputs, all else by a search. The others follow from the design alone.

    Raises:
        InvalidInput: A number out of range.
    """

    actuators: int | None = None
    """Number of inputs that can move."""
    shortening: float | None = None
    """Share of its length before activation by which the line of a bundle shortens [-]."""
    force: float | None = None
    """Pull or push of a bundle that is driven by force, and tension of a tendon driven by length
    [N]."""
    pressure: float | None = None
    """Pressure of a chamber, above or below that around it [Pa]."""
    stroke: float | None = None
    """Displacement of a tendon that is driven by length [m]."""
    mass: float | None = None
    """Mass of the arm [kg]."""
    load_number: float | None = None
    """Λ, theory (79), under the largest payload [-]."""
    bending: float | None = None
    """κ R2 anywhere along the arm [-], κ of the centerline as it is under all loads, R2 before
    activation; its inner side folds at 1."""

    def __post_init__(self) -> None:
        for name, value in self.given.items():
            if name == "actuators":
                arguments.as_integer(name, value, 0, 1_000_000)
            else:
                allowed = Range(0.0, 1.0 if name == "shortening" else np.inf)
                object.__setattr__(self, name, arguments.as_number(name, value, allowed))

    @property
    def given(self) -> dict[str, float]:
        """Limits that are not None, by name [unit of each]."""
        return {name: value for name, value in vars(self).items() if value is not None}

    @property
    def of_poses(self) -> dict[str, float]:
        """Given limits that poses are judged by [unit of each]."""
        return {name: value for name, value in self.given.items() if name in _OF_POSES}


_OF_POSES = ("shortening", "force", "pressure", "stroke", "bending")
_UNITS = {"force": "N", "pressure": "Pa", "stroke": "m", "mass": "kg"}
LIMIT_UNITS = {field.name: _UNITS.get(field.name, "") for field in dataclasses.fields(Limits)}
"""Limit -> its SI unit."""
