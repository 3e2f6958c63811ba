"""Regions of space, in the world: boxes, spheres, half-spaces, cylinders and tubes."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from softreach.kernels import room
from softreach.support import arrays
from softreach.support.arguments import POSITIVE, as_integer, as_number
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible, Range

Triple = tuple[float, float, float]
Ends = tuple[Array, Array]  # Least and largest of something

_STEPS = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
"""1/g, 1/g² and 1/g³ with g⁴ = g + 1: steps of a sequence that fills the cube evenly."""
_MOST_PLACES = 1_000_000
_EMPTIEST = 1e-4  # share of its bounding box that a region fills at least, to draw places from it
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)
_LENGTH = POSITIVE._replace(unit="m")


class Region(ABC):
    """A part of space; lengths in m, in the world."""

    convex: ClassVar[bool] = True
    """True if it holds all between any two of its points."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points (n, 3) to its boundary [m], negative inside, shape (n,)."""
        return self.nearest(np.ascontiguousarray(arrays.as_points("points", points)))[0]

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume [m³]; infinite for a half-space."""

    @property
    @abstractmethod
    def bounds(self) -> Array:
        """Lower and upper corner of the box around it [m], shape (2, 3)."""

    kind: ClassVar[int] = room.MESH
    """Kind of solid that kernels know."""

    @property
    def numbers(self) -> Array:
        """Numbers of the solid as `kernels.room.shapes` takes them [m], axes [-]."""
        return np.empty(0)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Signed distances of points (n, 3) [m], and their gradients [-], (n,) and (n, 3)."""
        from softreach.kernels.room.shapes import signed_distances  # designs are read without Numba

        distance, gradient = np.empty(len(points)), np.empty((len(points), 3))
        numbers = np.pad(self.numbers, (0, room.NUMBERS - len(self.numbers)))
        signed_distances(self.kind, numbers, points, distance, gradient)
        return distance, gradient

    @abstractmethod
    def wireframe(self, around: Array) -> list[Array]:
        """Lines to draw it by [m], each of shape (k, 3).

        Args:
            around: Lower and upper corner of what else is drawn [m], shape (2, 3).
        """

    def places(self, n: int) -> Array:
        """The first n places inside of a sequence that fills space evenly [m], shape (n, 3).

        Args:
            n: Number of places; the same n gives the same places.

        Raises:
            InvalidInput: The region has no end.
            NotPossible: It fills next to nothing of the box around it.
        """
        n, (low, high) = as_integer("n", n, 1, _MOST_PLACES), self.bounds
        if not np.isfinite(self.volume):
            raise InvalidInput("region", self, "bounded: a half-space has no end")
        kept, drawn = np.empty((0, 3)), 0
        while len(kept) < n:
            numbers = np.arange(drawn + 1, drawn + max(n, 256) + 1)[:, None]
            points = low + (0.5 + numbers * _STEPS) % 1.0 * (high - low)
            kept = np.concatenate([kept, points[self.distance(points) <= 0.0]])
            drawn += len(points)
            if len(kept) < _EMPTIEST * drawn and drawn > 1.0 / _EMPTIEST:
                raise NotPossible(f"{self} is too thin to draw places from it")
        return kept[:n]

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        """Least and largest distance of the points of circular sections, negative inside.

        Exact for half-spaces and for spheres; of boxes the largest is exact by faces. Otherwise a
        ball takes the place of the section, so that the range is never too narrow.

        Args:
            center: Centers [m], shape (..., 3).
            tangent: Unit vectors across the sections, d3 [-], shape (..., 3).
            radius: Radii [m], shape (...).
        """
        distance = self._distances(center)
        return distance - radius, distance + radius

    def _distances(self, points: Array) -> Array:
        return self.distance(points.reshape(-1, 3)).reshape(points.shape[:-1])


@dataclass(frozen=True)
class Box(Region):
    """A box along the axes of the world.

    Raises:
        InvalidInput: No low < high along each axis.
    """

    low: Triple
    """Lower corner [m]."""
    high: Triple
    """Upper corner [m]."""

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, as_triple(name, getattr(self, name)))
        for axis, start, end in zip("xyz", self.low, self.high, strict=True):
            if not start < end:
                allowed = f"below high = {end:g} m, so that the box is not empty"
                raise InvalidInput(f"low along {axis}", start, allowed)

    kind: ClassVar[int] = room.BOX

    @property
    def numbers(self) -> Array:
        return np.array([*self.low, *self.high])

    @property
    def volume(self) -> float:
        return float(np.prod(np.subtract(self.high, self.low)))

    @property
    def bounds(self) -> Array:
        return np.array([self.low, self.high])

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        reach = radius[..., None] * np.sqrt(np.maximum(1.0 - tangent**2, 0.0))
        beyond = np.maximum(self.low - center, center - self.high)
        ball = self._distances(center) - radius
        return np.maximum(ball, (beyond - reach).max(axis=-1)), (beyond + reach).max(axis=-1)

    def wireframe(self, around: Array) -> list[Array]:
        corners = np.array(list(np.ndindex(2, 2, 2)))
        ends = [(a, b) for a in corners for b in corners if (b - a).sum() == 1 and (b >= a).all()]
        return [self.bounds[np.stack(pair), range(3)] for pair in ends]


@dataclass(frozen=True)
class Sphere(Region):
    """A ball.

    Raises:
        InvalidInput: No finite center, or no radius > 0.
    """

    center: Triple
    """Middle of the sphere [m]."""
    radius: float
    """Radius of the sphere [m]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", as_triple("center", self.center))
        object.__setattr__(self, "radius", as_number("radius", self.radius, _LENGTH))

    kind: ClassVar[int] = room.SPHERE

    @property
    def numbers(self) -> Array:
        return np.array([*self.center, self.radius])

    @property
    def volume(self) -> float:
        return 4.0 / 3.0 * np.pi * self.radius**3

    @property
    def bounds(self) -> Array:
        return np.array(self.center) + self.radius * np.array([[-1.0], [1.0]])

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        apart = center - self.center
        height = (apart * tangent).sum(axis=-1)
        across = np.sqrt(np.maximum((apart**2).sum(axis=-1) - height**2, 0.0))
        least, most = np.maximum(across - radius, 0.0), across + radius
        return np.hypot(height, least) - self.radius, np.hypot(height, most) - self.radius

    def wireframe(self, around: Array) -> list[Array]:
        flat = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE], axis=1)
        return [self.center + self.radius * np.roll(flat, k, axis=1) for k in range(3)]


@dataclass(frozen=True)
class HalfSpace(Region):
    """Everything behind a plane: (x - point) · normal <= 0.

    Raises:
        InvalidInput: No finite point, or a normal without length.
    """

    point: Triple
    """A point of the plane [m]."""
    normal: Triple
    """Normal that points out of the half-space [-], of any length."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", as_triple("point", self.point))
        (normal,) = arrays.as_directions("normal", self.normal, 1).tolist()
        object.__setattr__(self, "normal", tuple(normal))

    kind: ClassVar[int] = room.HALF_SPACE

    @property
    def numbers(self) -> Array:
        return np.array([*self.point, *self.normal])

    @property
    def volume(self) -> float:
        return np.inf

    @property
    def bounds(self) -> Array:
        return np.array([[-np.inf] * 3, [np.inf] * 3])

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        distance, along = self._distances(center), tangent @ np.array(self.normal)
        reach = radius * np.sqrt(np.maximum(1.0 - along**2, 0.0))
        return distance - reach, distance + reach

    def wireframe(self, around: Array) -> list[Array]:
        """A square of the plane, about as large as what else is drawn [m]."""
        middle, half = around.mean(axis=0), 0.5 * float(np.ptp(around, axis=0).max())
        normal = np.array(self.normal)
        foot = middle - self.distance(middle[None]) * normal
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)], float)
        return [foot + half * corners @ _across(normal)]


@dataclass(frozen=True)
class Cylinder(Region):
    """A round bar with flat ends.

    Raises:
        InvalidInput: Two ends at one place, or no radius > 0.
    """

    start: Triple
    """Middle of one end [m]."""
    end: Triple
    """Middle of the other [m]."""
    radius: float
    """Radius of the bar [m]."""

    kind: ClassVar[int] = room.CYLINDER

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            object.__setattr__(self, name, as_triple(name, getattr(self, name)))
        if not np.linalg.norm(np.subtract(self.end, self.start)) > 0.0:
            raise InvalidInput("end", self.end, "another place than start")
        object.__setattr__(self, "radius", as_number("radius", self.radius, _LENGTH))

    @property
    def length(self) -> float:
        """From end to end [m]."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    @property
    def axis(self) -> Array:
        """Unit vector from start to end [-], shape (3,)."""
        return np.subtract(self.end, self.start) / self.length

    @property
    def numbers(self) -> Array:
        return np.array([*self.start, *self.axis, self.length, self.radius])

    @property
    def volume(self) -> float:
        return np.pi * self.radius**2 * self.length

    @property
    def bounds(self) -> Array:
        across = self.radius * np.sqrt(np.maximum(1.0 - self.axis**2, 0.0))
        ends = np.array([self.start, self.end])
        return np.stack([ends.min(axis=0) - across, ends.max(axis=0) + across])

    def wireframe(self, around: Array) -> list[Array]:
        return self._rings(self.radius)

    def _rings(self, radius: float) -> list[Array]:
        """Both ends as circles, and four lines between them."""
        turns = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1)
        ring: Any = radius * turns @ _across(self.axis)
        ends = ring + self.start, ring + self.end
        return [*ends, *(np.stack([end[k] for end in ends]) for k in range(0, 48, 12))]


@dataclass(frozen=True)
class Tube(Cylinder):
    """The wall of a round tube, which is open at both ends.

    Raises:
        InvalidInput: Two ends at one place, or no radius > inner_radius > 0.
    """

    inner_radius: float
    """Radius of its bore [m]."""

    kind: ClassVar[int] = room.TUBE
    convex: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed = Range(0.0, self.radius, "m", open_low=True, open_high=True)
        object.__setattr__(
            self, "inner_radius", as_number("inner_radius", self.inner_radius, allowed)
        )

    @property
    def numbers(self) -> Array:
        return np.append(super().numbers, self.inner_radius)

    @property
    def volume(self) -> float:
        return super().volume * (1.0 - (self.inner_radius / self.radius) ** 2)

    def wireframe(self, around: Array) -> list[Array]:
        return self._rings(self.radius) + self._rings(self.inner_radius)


def _across(axis: Array) -> Array:
    """Two unit vectors across an axis and across each other, shape (2, 3)."""
    first = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    first /= np.linalg.norm(first)
    across: Any = np.stack([first, np.cross(axis, first)])
    return across


def as_triple(name: str, value: object) -> Triple:
    """Three finite numbers."""
    allowed = "three finite numbers"
    numbers = arrays.check_finite(name, arrays.as_floats(name, value, allowed))
    if numbers.shape != (3,):
        raise InvalidInput(name, value, allowed)
    return tuple(numbers.tolist())
