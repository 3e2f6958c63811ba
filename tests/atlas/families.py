"""Small families of designs and what is built of them."""

import numpy as np
import xarray as xr

import softreach as sr
from softreach.atlas import DesignSpace
from softreach.atlas.metrics import chosen_metrics
from softreach.atlas.space import Command

SMALL = {"n": 2_000, "alpha_over_length": 0.5}
SMALL["metrics"] = ("extent", "convex", "concave", "curvature")
TINY = SMALL | {"n": 10, "metrics": ("extent", "curvature")}


def small_space(**more) -> DesignSpace:
    tapers = np.radians([0.0, 2.0])
    return DesignSpace.grid(sr.designs.minimal_trunk(), revolution=[0.5, 1.5], taper=tapers, **more)


def gapped_space() -> DesignSpace:
    """Four designs, of which the third cannot exist."""
    taper, radius = np.radians([2.0, 4.0]), [1 / 16, 0.1]
    return DesignSpace.grid(sr.designs.minimal_trunk(), taper=taper, outer_radius=radius)


def similar_designs(*lengths: float) -> DesignSpace:
    base = sr.designs.minimal_trunk()
    radii = np.array(lengths) * base.profile.outer_radius
    return DesignSpace.listed(base, length=lengths, outer_radius=radii)


def command(space: DesignSpace, **options) -> Command:
    rest = {"seed": 0, "sampler": "uniform", "tol": 1e-6, "accuracy": 3e-3, "keep_clouds": True}
    metrics = chosen_metrics(options.pop("metrics"))
    return Command(space=space, metrics=metrics, **rest | options)


def assert_same(found: xr.Dataset, truth: xr.Dataset) -> None:
    xr.testing.assert_identical(found, truth)
