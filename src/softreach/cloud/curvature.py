"""Bend, twist and stretch over a cloud (section 4): blocks of samples fill histograms.

Their bins span what the activation box allows; no array of all samples by stations ever exists.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.driving import pilot
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import Tables, ends_over, tables
from softreach.cloud.clouds import tip_map_of
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map
from softreach.rod.steps import pilot_activations
from softreach.rod.tip_map import Strains, TipMap, no_equilibrium
from softreach.schema import check_cloud, provenance
from softreach.support import parallel
from softreach.support.arguments import as_instance, as_integer
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Minimum, quartiles, maximum and the middle nine tenths."""

QUANTITIES = {
    "bending": ("1/m", "bending curvature κ = √(u1² + u2²)"),
    "torsion": ("1/m", "torsion u3"),
    "extension": ("1", "axial extension ζ"),
}
"""Quantity -> unit and meaning."""

_MOST = 1 << 24  # bins, and stations
_HEADINGS = 720
_AT_A_TIME = 1 << 19  # samples times stations whose strains stay in the cache


def curvature_statistics(
    cloud: xr.Dataset,
    stations: ArrayLike | None = None,
    *,
    bins: int = 2048,
    quantiles: Sequence[float] = QUANTILES,
) -> xr.Dataset:
    """Distributions of bending κ, torsion u3 and extension ζ over a cloud (section 4).

    Curvatures are per unit of activated arclength, in the directors. Memory does not grow with the
    number of stations times samples.

    Two things limit the numbers: quantiles are accurate to one bin, and all of them are those of a
    sample, whose mean is off by about `..._std` / √n, with n in the attribute `samples`. Of an arm
    under loads only stable equilibria count, and bins span the strains of a pilot of activations:
    what is beyond counts in the last bin, with exact extremes and moments.

    Args:
        cloud: A cloud; its design and activations are used.
        stations: Z [m], shape (station,); None for six even stations of the distal half.
        bins: Bins of each histogram.
        quantiles: Which quantiles, each in [0, 1].

    Returns:
        For each quantity over `station` (coordinate Z [m]): `..._count` over `bin` with the bins'
        ends `..._edge`, and `..._quantile`, `..._mean`, `..._std`.

    Raises:
        InvalidInput: Stations off the arm, or bins or quantiles out of range.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=1000)
        >>> found = sr.curvature.curvature_statistics(cloud, stations=[0.5, 1.0])
        >>> found.bending_mean.values.round(1)  # κ [1/m] in the middle and at the tip
        array([ 3.5, 14.6])
    """
    activation = check_cloud(cloud)["activation"].values
    return stream_statistics(
        tip_map_of(cloud), [activation], stations, bins=bins, quantiles=quantiles
    )


def stream_statistics(
    arm: Manipulator | TipMap,
    activations: Iterable[Array],
    stations: ArrayLike | None = None,
    *,
    bins: int = 2048,
    quantiles: Sequence[float] = QUANTILES,
) -> xr.Dataset:
    """`curvature_statistics` of activations that arrive in blocks, inside the arm's bounds.

    Args:
        arm: The design, or its tip map.
        activations: Blocks of γ [-], shape (n, bundles) each.
        stations: As for `curvature_statistics`.
        bins: As for `curvature_statistics`.
        quantiles: As for `curvature_statistics`.

    Raises:
        InvalidInput: As for `curvature_statistics`; also no activations at all.
    """
    bins = as_integer("bins", bins, 1, _MOST)
    shares = as_floats("quantiles", quantiles)
    if shares.ndim != 1 or not shares.size or not ((shares >= 0) & (shares <= 1)).all():
        allowed = "one number from 0 to 1 or more of them, shape (k,)"
        raise InvalidInput("quantiles", quantiles, allowed)
    allowed = "an iterable of arrays of shape (n, bundles)"
    activations = as_instance("activations", activations, Iterable, allowed)
    tip_map = as_tip_map(arm)
    places = distal_stations(tip_map) if stations is None else stations
    z = tip_map.check_stations(np.atleast_1d(as_floats("stations", places)), ascending=False)
    tallies = {
        name: _Tally(ends, bins)
        for name, ends in zip(QUANTITIES, strain_ranges(tip_map, z), strict=True)
    }
    for strains in _strains(tip_map, activations, z):
        for k in range(len(z)):
            u1, u2, u3 = strains.curvature[:, k].T
            tallies["bending"].add(k, np.hypot(u1, u2))  # theory (7), (45)
            tallies["torsion"].add(k, u3)
            tallies["extension"].add(k, strains.extension[:, k])
    if not tallies["bending"].count.any():
        raise InvalidInput("activations", "none", "at least one sample")
    return _dataset(tip_map, z, tallies, shares)


def distal_stations(arm: Manipulator | TipMap) -> Array:
    """Six even stations from the middle of the arm to its tip, both included, Z [m] (figure 3c)."""
    arm = as_instance("arm", arm, (Manipulator, TipMap), "a Manipulator or a TipMap")
    return np.linspace(0.5, 1.0, 6) * arm.length


def _strains(tip_map: TipMap, activations: Iterable[Array], z: Array) -> Iterator[Strains]:
    for activation in activations:
        block = tip_map.check_activations("activations", activation)
        for rows in parallel.blocks(len(block), max(1, _AT_A_TIME // len(z))):
            curvature, extension = tip_map.strains(block[rows], z)
            if tip_map.supports_unstable:  # samples without a stable equilibrium are NaN
                settled = np.isfinite(extension).all(axis=1)
                curvature, extension = curvature[settled], extension[settled]
            yield Strains(curvature, extension)


def strain_ranges(tip_map: ArmMap, z: Array) -> tuple[Array, Array, Array]:
    """Ranges within the activation box of bending, torsion and extension, (station, 2) each.

    Exact but for bending, which is at most 1e-5 too large for fibers and muscles, and with tendons
    and chambers by as much as their ζ differs. Under loads, and with tendons driven by length, they
    are those of samples: others may strain the arm a little more.
    """
    driving, inner = tip_map.inputs.driving, tip_map.rod
    if driving is not None and not driving.is_bundles:
        whole = all_inputs(tip_map)
        return _sampled(whole.strains(whole.box.from_cube(pilot(whole.box.bundles)), z))
    if not tip_map.supports_unstable:
        return _exact(tables(inner.arm, z), inner.box)
    gamma = pilot_activations(inner.arm, inner.box)
    strains = inner.strains(gamma, z)
    if np.isnan(strains.extension).all():
        raise no_equilibrium(len(gamma), "an equilibrium")
    return _sampled(strains)


def _sampled(strains: Strains) -> tuple[Array, Array, Array]:
    u1, u2, u3 = np.moveaxis(strains.curvature, 2, 0)
    bending, torsion, extension = (
        np.stack([np.nanmin(values, axis=0), np.nanmax(values, axis=0)], axis=1)
        for values in (np.hypot(u1, u2), u3, strains.extension)
    )
    bending[:, 0] = 0.0
    return bending, torsion, extension


def _exact(table: Tables, box: ActivationBox) -> tuple[Array, Array, Array]:
    bounds = np.stack([box.low, box.high], axis=1)
    # An upper bound of √(u1² + u2²): the support of (u1, u2) toward many headings.
    heading = np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
    toward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    along = np.einsum("hc,scb->shb", toward, table.curvature[:, :2])
    most = (along[..., None] * bounds).max(-1).sum(-1).max(axis=1) / np.cos(np.pi / _HEADINGS)
    bending = np.stack([np.zeros_like(most), most], axis=1)
    torsion = ends_over(table.curvature[:, 2], bounds)
    extension = 1.0 + ends_over(table.extension, bounds)
    if table.has_forces:  # η/ζ = 1 - (ζ - η)/ζ
        forces = ends_over(table.extension - table.rest_length_factor, bounds)
        ratio = 1.0 - _products(forces, 1.0 / extension)
        bending, torsion = bending * ratio[:, :1], _products(torsion, ratio)
    return bending, torsion, extension


def _products(first: Array, second: Array) -> Array:
    """Least and largest products of numbers from two ranges, shape (station, 2)."""
    all_ends = (first[:, :, None] * second[:, None]).reshape(len(first), 4)
    return np.stack([all_ends.min(axis=1), all_ends.max(axis=1)], axis=1)


class _Tally:
    """Histogram, extremes and moments of one quantity at every station."""

    def __init__(self, ends: Array, bins: int) -> None:
        """Begin without values, with bins from the lower to the upper end of each row."""
        self.low, high = ends.T
        # A quantity that cannot vary still needs bins of some width.
        self.width = np.maximum(high - self.low, 1e-12 * np.maximum(np.abs(high), 1.0)) / bins
        self.count = np.zeros((len(ends), bins), np.int64)
        self.extremes = np.tile([np.inf, -np.inf], (len(ends), 1))
        self.moments = np.zeros((len(ends), 2))

    def add(self, k: int, values: Array) -> None:
        if not len(values):
            return
        bins = self.count.shape[1]
        # About the lower end, so that a narrow range far from zero loses no digits.
        shifted = values - self.low[k]
        place = (shifted / self.width[k]).astype(np.int64)
        self.count[k] += np.bincount(np.clip(place, 0, bins - 1, out=place), minlength=bins)
        low, high = self.extremes[k]
        self.extremes[k] = min(low, values.min()), max(high, values.max())
        self.moments[k] += shifted.sum(), np.square(shifted, out=shifted).sum()

    @property
    def edges(self) -> Array:
        """Ends of the bins, shape (station, bin + 1)."""
        return self.low[:, None] + self.width[:, None] * np.arange(self.count.shape[1] + 1)

    def quantiles(self, shares: Array) -> Array:
        """Quantiles, linear within a bin and inside the extremes, shape (station, quantile)."""
        quantiles = np.empty((len(self.low), len(shares)))
        for k, (count, edges) in enumerate(zip(self.count, self.edges, strict=True)):
            below = np.concatenate([[0], np.cumsum(count)]) / count.sum()
            # Empty bins make flat pieces of the distribution; its inverse jumps over them.
            rises = np.flatnonzero(np.diff(below) > 0)
            corners = np.unique(np.concatenate([rises, rises + 1]))
            within = np.interp(shares, below[corners], edges[corners])
            quantiles[k] = np.clip(within, *self.extremes[k])
        return quantiles


def _dataset(tip_map: TipMap, z: Array, tallies: dict[str, _Tally], quantiles: Array) -> xr.Dataset:
    import xarray as xr

    variables = {}
    for name, tally in tallies.items():
        unit, meaning = QUANTITIES[name]
        first, second = (tally.moments / tally.count.sum(axis=1, keepdims=True)).T
        mean, std = tally.low + first, np.sqrt(np.maximum(second - first**2, 0.0))
        of = {"units": unit, "long_name": meaning}
        variables |= {
            f"{name}_count": (("station", "bin"), tally.count, {"units": "1"}),
            f"{name}_edge": (("station", "edge"), tally.edges, of),
            f"{name}_quantile": (("station", "quantile"), tally.quantiles(quantiles), of),
            f"{name}_mean": ("station", mean, of),
            f"{name}_std": ("station", std, of),
        }
    coordinates = {
        "Z": ("station", z, {"units": "m", "long_name": "station before activation"}),
        "quantile": quantiles,
    }
    samples = int(tallies["bending"].count[0].sum())
    attrs = {**provenance(tip_map.arm, tip_map.frame), "length": tip_map.length, "samples": samples}
    return xr.Dataset(variables, coordinates, attrs)
