"""What a section resists and what drives it, by quadrature over its area.

Nothing is integrated by hand here. An actuator is an active strain at every point of the section:
a fiber or muscle along the unit vector m that changes its length by γ, and its girth by -νγ,
strains the point by γ ((1 + ν) m m - ν 1). Kept from straining, the point bears the axial stress
E ε33 and the shear stresses E/(1 + ν) ε13 and E/(1 + ν) ε23; the rest is free to relax. Force and
moment are the integrals of these over the area.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Direction = Callable[[Array, Array], Array]
"""Unit vectors m, shape (3, point), at the points (x, y) of a section."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)


class Points(NamedTuple):
    """Quadrature points of an area."""

    x: Array
    y: Array
    area: Array


class Stiffness(NamedTuple):
    """What a section resists, and its mass per length."""

    axial: float
    """K0 = ∫ E dA [N]."""
    bending_1: float
    """K1 = ∫ E y² dA [N m²]."""
    bending_2: float
    """K2 = ∫ E x² dA [N m²]."""
    torsion: float
    """K3 = ∫ E/(2(1 + ν)) (x² + y²) dA [N m²]."""
    mass: float
    """∫ ρ dA [kg/m]."""


class Load(NamedTuple):
    """Force along d3 [N] and moment about the directors [N m] on a section."""

    force: float
    moment: Array


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A disc or ring of one material; layers may overlap."""

    inner: float = 0.0
    """[m]."""
    outer: float
    """[m]."""
    young_modulus: float
    """[Pa]."""
    poisson_ratio: float
    density: float = 0.0
    """[kg/m³]."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Fibers or a muscle in a sector of a layer."""

    layer: Layer
    sector: tuple[float, float]
    """Polar angles where the sector starts and stops [rad]."""
    direction: Direction


def ring_sector(inner: float, outer: float, start: float, stop: float) -> Points:
    """Gauss points of a sector of a ring."""
    radius, radial = _gauss(inner, outer)
    angle, angular = _gauss(start, stop)
    r, theta = (grid.ravel() for grid in np.meshgrid(radius, angle, indexing="ij"))
    return Points(
        r * np.cos(theta), r * np.sin(theta), r * np.multiply.outer(radial, angular).ravel()
    )


def disc(center: tuple[float, float], radius: float) -> Points:
    """Gauss points of a disc anywhere in the section."""
    x, y, area = ring_sector(0.0, radius, 0.0, 2 * np.pi)
    return Points(x + center[0], y + center[1], area)


def stiffness(layers: Sequence[Layer]) -> Stiffness:
    """What the layers resist together; where they overlap each adds its own."""
    total = np.zeros(5)
    for layer in layers:
        x, y, area = _whole(layer)
        e, shear = layer.young_modulus, _shear_modulus(layer)
        densities = (e + 0 * x, e * y**2, e * x**2, shear * (x**2 + y**2), layer.density + 0 * x)
        total += [np.sum(area * density) for density in densities]
    return Stiffness(*total.tolist())


def fiber(layer: Layer, helical_angle: float, slope: float = 0.0) -> Direction:
    """Fibers that wind on cones through the layer.

    Args:
        layer: Its outer radius is where the angle and the slope are measured.
        helical_angle: α, from the meridian of the outer cone [rad].
        slope: dR/dZ of the layer's outer radius [-]; negative where the arm tapers.
    """

    def direction(x: Array, y: Array) -> Array:
        share = np.hypot(x, y) / layer.outer
        alpha, phi = np.arctan(share * np.tan(helical_angle)), np.arctan(share * slope)
        outward, around = _polar(x, y)
        meridian = np.sin(phi) * outward + np.cos(phi) * np.array([[0.0], [0.0], [1.0]])
        return np.cos(alpha) * meridian + np.sin(alpha) * around

    return direction


def radial(x: Array, y: Array) -> Array:
    """Muscle fibers that point away from the axis."""
    return _polar(x, y)[0]


def active_load(drive: Drive) -> Load:
    """Force and moment on the section for each unit of activation."""
    (x, y, area), stress = _points(drive), _active_stress(drive)
    place = np.stack([x, y, 0 * x])
    return Load(
        float(np.sum(area * stress[2])),
        np.sum(area * np.cross(place, stress, axis=0), axis=1),
    )


def _active_stress(drive: Drive) -> Array:
    """Stress vector on the section for each unit of activation [Pa], shape (3, point)."""
    axial, *shears = _active_strains(drive)
    shear = _shear_modulus(drive.layer)
    return np.stack([shear * shears[0], shear * shears[1], drive.layer.young_modulus * axial])


def pressure_load(lumen: Points) -> Load:
    """Force and moment on the section for each pascal in a lumen that cannot widen."""
    x, y, area = lumen
    moment = np.array([np.sum(area * y), -np.sum(area * x), 0.0])
    return Load(float(np.sum(area)), moment)


def least_energy_strains(layers: Sequence[Layer], drive: Drive) -> Array:
    """(ζ - 1, u1, u2, u3) for each unit of activation, at the least elastic energy.

    The energy is ∫ ½E ε² + ½G |shear|² over the layers, among them the drive's, with the strains
    that a plane section allows; in the drive's sector it counts what they are beyond the active
    ones: its gradient is linear, and zero at the minimum.
    """
    curvature = sum(_energy(layer, _whole(layer), _modes(_whole(layer))) for layer in layers)
    points = _points(drive)
    return np.linalg.solve(curvature, _energy(drive.layer, points, _active_strains(drive)))


def _energy(layer: Layer, points: Points, strains: Array) -> Array:
    """∫ modulus × mode × strain dA over (ε33, 2ε13, 2ε23), for each of the four modes."""
    shear = _shear_modulus(layer)
    weight = np.multiply.outer([layer.young_modulus, shear, shear], points.area)
    return np.einsum("ip,aip,...ip->a...", weight, _modes(points), strains)


def _modes(points: Points) -> Array:
    """Strains (ε33, 2ε13, 2ε23) of a unit of ζ, u1, u2, u3: shape (4, 3, point)."""
    x, y, _ = points
    zero = 0 * x
    return np.array([[1 + zero, zero, zero], [y, zero, zero], [-x, zero, zero], [zero, -y, x]])


def _active_strains(drive: Drive) -> Array:
    """(ε33, 2ε13, 2ε23) of γ ((1 + ν) m m - ν 1) for each unit of γ, shape (3, point)."""
    x, y, _ = _points(drive)
    m, nu = drive.direction(x, y), drive.layer.poisson_ratio
    strain = (1 + nu) * np.einsum("ip,jp->ijp", m, m) - nu * np.eye(3)[:, :, None]
    return np.stack([strain[2, 2], 2 * strain[0, 2], 2 * strain[1, 2]])


def _points(drive: Drive) -> Points:
    return ring_sector(drive.layer.inner, drive.layer.outer, *drive.sector)


def _whole(layer: Layer) -> Points:
    return ring_sector(layer.inner, layer.outer, 0.0, 2 * np.pi)


def _shear_modulus(layer: Layer) -> float:
    return layer.young_modulus / (2 * (1 + layer.poisson_ratio))


def _gauss(low: float, high: float) -> tuple[Array, Array]:
    """Gauss-Legendre nodes and weights of an interval."""
    half = 0.5 * (high - low)
    return low + half * (1 + _NODES), half * _WEIGHTS


def _polar(x: Array, y: Array) -> tuple[Array, Array]:
    """Unit vectors away from the axis and around it, shape (3, point)."""
    r = np.hypot(x, y)
    return np.stack([x / r, y / r, 0 * x]), np.stack([-y / r, x / r, 0 * x])
