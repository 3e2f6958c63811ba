"""Arms and measured poses of them, made up with noise."""

import numpy as np

import softreach as sr
from softreach.arm import (
    LengthTendon,
    LinearTaper,
    Manipulator,
    Marker,
    Material,
    RestShape,
    Ring,
    Section,
    Tendon,
)
from softreach.arm.parameters import changed

STEEL = Material(young_modulus=50e9, poisson_ratio=0.3, density=7800.0)
SILICONE = Material(young_modulus=3e5, poisson_ratio=0.45, density=1100.0)


def pulled_wire(loads=None):
    """A wire with two segments of three tendons driven by length, bent at rest."""
    tendons = tuple(
        LengthTendon(
            name=f"s{k + 1}",
            bundles=3,
            distance=0.0045,
            offset=0.5 * k,
            end_over_length=end,
            activation_bounds=(-0.01, 0.02),
            tendon_stiffness=1e4,
        )
        for k, end in enumerate((0.45, 1.0))
    )
    return Manipulator(
        profile=LinearTaper(length=0.19, outer_radius=0.0005),
        section=Section(rings=(Ring(inner_ratio=0.5, material=STEEL),)),
        actuators=tendons,
        loads=loads,
        rest=RestShape(curvature_x=1.0, twist=0.3),
        base=sr.Base(points="down", position=(0.01, 0.0, 0.3)),
    )


def hanging_tentacle(loads=None):
    """A cone of silicone with three tendons and two markers."""
    return Manipulator(
        profile=LinearTaper(length=0.3, outer_radius=0.015, taper=0.02),
        section=Section(rings=(Ring(inner_ratio=0.6, material=SILICONE),)),
        actuators=(
            Tendon(
                name="t",
                distance=0.009,
                bundles=3,
                end_over_length=0.9,
                activation_bounds=(0.0, 3.0),
            ),
        ),
        loads=loads,
        base=sr.Base(points="down"),
        markers=(
            Marker(name="half", station=0.16, offset=(0.02, 0.0, 0.0)),
            Marker(name="tool", offset=(0.0, 0.0, 0.01)),
        ),
    )


def table(places, inputs, names, markers, unit="N"):
    """Columns of measured poses, lengths in mm."""
    size = 1e3 if unit == "mm" else 1.0
    columns = {f"{name}_{unit}": size * inputs[:, k] for k, name in enumerate(names)}
    for m, marker in enumerate(markers):
        for a, axis in enumerate("xyz"):
            columns[f"{marker}_{axis}_mm"] = 1e3 * places[:, m, a]
    return columns


def random_inputs(arm, count, seed=0):
    """Inputs within the bounds of an arm."""
    low, high = arm.bounds.T
    return low + np.random.default_rng(seed).random((count, arm.bundles)) * (high - low)


MODULUS = "rings[0].material.young_modulus"
"""Young's modulus of all arms here."""


def measured(arm, count=20, noise=2e-4, seed=0, inputs=None, shared=0.0, runs=1):
    """Poses of an arm as a laboratory would have them: columns of inputs, and places with noise.

    Each run shares an error besides [m].
    """
    inputs = random_inputs(arm, count, seed) if inputs is None else inputs
    if arm.markers:
        places = sr.rod.marker_positions(arm, inputs, 1e-9)
    else:
        places = sr.tip_positions(arm, inputs, 1e-9)[:, None]
    rng = np.random.default_rng(seed + 1)
    run = np.arange(len(inputs)) % runs
    places = places + noise * rng.standard_normal(places.shape)
    places = places + shared * rng.standard_normal((runs, *places.shape[1:]))[run]
    unit = {"m": "mm"}.get(arm.input_units[0], "N")
    markers = [marker.name for marker in arm.markers] or ["tip"]
    data = table(places, inputs, arm.input_names, markers, unit)
    return data | {"run": [f"run {k}" for k in run]} if runs > 1 else data


def on_the_bench(arm):
    """An arm that is a little stiffer than it was designed, and stands elsewhere."""
    base = arm.base.replace(position=(0.01, 0.02, 0.03))
    return changed(arm, {MODULUS: 1.1 * SILICONE.young_modulus}).replace(base=base)
