"""A call of every public function that works, and what is asked of each argument."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np

import softreach as sr
import softreach.arm.parameters
import softreach.exchange.activefilaments
from softreach import atlas
from softreach.atlas import DesignSpace

__all__ = ["CALLS", "UNTRIED", "Argument", "Call", "bad"]

ARM = sr.designs.minimal_trunk()
MATERIAL = sr.Material(young_modulus=1e6, density=1000.0)
HEAVY = sr.designs.minimal_trunk(material=MATERIAL).replace(loads=sr.Loads())
GAMMA = np.full((1, 3), -0.5)
TIP = sr.tip_positions(ARM, GAMMA)


@cache
def cloud():
    """64 samples."""
    return sr.compute_cloud(ARM, 64)


@cache
def shape():
    """One configuration."""
    return sr.configuration(ARM, GAMMA[0], 11)


@cache
def distance():
    """Mean distances within that cloud."""
    return sr.activation_distance(cloud(), 0.3)


@cache
def hull():
    """The convex hull of that cloud."""
    return sr.convex_hull(cloud().tip)


@cache
def reached():
    """A coarse reachable set."""
    return sr.reachable_set(ARM, accuracy=0.2)


@cache
def family():
    """Two designs."""
    return DesignSpace.grid(ARM, taper=[0.0, 0.02])


@cache
def stored():
    """Their atlas, in memory."""
    store = {}
    sr.build_atlas(family(), store, n=10, metrics=["extent"])
    return store


@cache
def built():
    """That atlas, opened."""
    return sr.open_atlas(stored())


@cache
def grid():
    """A grid over space."""
    return reached().grid


@cache
def equilibria():
    """The only one of a light arm."""
    return sr.equilibria(HEAVY, GAMMA[0])


@cache
def figure():
    """One without anything."""
    from matplotlib.figure import Figure

    return Figure()


@cache
def statistics():
    """Curvatures of that cloud."""
    return sr.curvature.curvature_statistics(cloud())


class Argument(NamedTuple):
    """What is asked of an argument."""

    kind: str
    """A key of `BAD`."""
    fine: tuple[str, ...] = ()
    """Names of values there that are right for this argument after all."""


class Call(NamedTuple):
    """A function with arguments of which all are right."""

    function: Callable
    good: Callable[[], Mapping[str, object]]
    asked: Mapping[str, Argument]


def bad(kind: str, *fine: str) -> Argument:
    """An argument of a kind."""
    return Argument(kind, fine)


DATA, FLAG, NUMBER = bad("dataset"), bad("flag"), bad("number")
TOL, BOX = bad("number"), bad("array", "none")
OPTIONAL_DATA, OPTIONAL_NUMBER = bad("dataset", "none"), bad("number", "none")
ARRAY, WHOLE, WORD, PATH = bad("array"), bad("whole number"), bad("word"), bad("path")
PROGRESS = bad("function", "none", "a function", "a class")
AX, VIEW, SIZE = bad("dataset", "none"), WORD, OPTIONAL_NUMBER
COLOR = bad("word", "a number")
ANY_ARM = bad("arm")

SOME = {"arm": ARM, "activations": GAMMA}
DRAWN = {"ax": AX, "view": VIEW, "box": BOX}
POINTS = {"arm": ANY_ARM, "activations": ARRAY, "tol": TOL}

TRUNK = {name: NUMBER for name in ("revolution", "taper", "length", "radius_ratio")} | {
    "material": bad("arm", "none")
}

CALLS: dict[str, Call] = {
    "arm.describe": Call(sr.describe, lambda: {"arm": ARM}, {"arm": ANY_ARM}),
    "arm.named_material": Call(
        sr.arm.named_material, lambda: {"name": "steel"}, {"name": bad("word")}
    ),
    "arm.designs.minimal_trunk": Call(
        sr.designs.minimal_trunk,
        dict,
        TRUNK,
    ),
    "arm.designs.redundant_trunk": Call(
        sr.designs.redundant_trunk,
        dict,
        TRUNK,
    ),
    "arm.designs.three_tendon_robot": Call(
        sr.designs.three_tendon_robot, dict, {"segments": WHOLE}
    ),
    "arm.parameters.changed": Call(
        sr.arm.parameters.changed,
        lambda: {"arm": ARM, "values": {"taper": 0.01}},
        {"arm": ANY_ARM, "values": bad("mapping")},
    ),
    "arm.parameters.find_parameter": Call(
        sr.arm.parameters.find_parameter,
        lambda: {"arm": ARM, "name": "taper"},
        {"arm": ANY_ARM, "name": WORD},
    ),
    "arm.parameters.find_parameters": Call(
        sr.arm.parameters.find_parameters,
        lambda: {"arm": ARM, "names": ("taper",)},
        {"arm": ANY_ARM, "names": bad("words")},
    ),
    "arm.parameters.parameters": Call(
        sr.arm.parameters.parameters, lambda: {"arm": ARM}, {"arm": ANY_ARM}
    ),
    "arm.Manipulator.from_toml": Call(
        sr.Manipulator.from_toml, lambda: {"text": ARM.to_toml()}, {"text": bad("text")}
    ),
    "arm.Manipulator.load": Call(sr.Manipulator.load, dict, {"path": PATH}),
    "arm.Manipulator.save": Call(
        ARM.save, lambda: {"path": "missing/x.toml"}, {"path": PATH, "overwrite": FLAG}
    ),
    "arm.Manipulator.outline": Call(ARM.outline, lambda: {"z": [0.0]}, {"z": ARRAY}),
    "arm.Manipulator.split": Call(
        ARM.split,
        lambda: {"fiber": "left", "count": 2},
        {"fiber": bad("word", "a number"), "count": WHOLE, "keep_extent": FLAG},
    ),
    "arm.Manipulator.with_bounds": Call(
        ARM.with_bounds, lambda: {"activation_bounds": (-1.0, 0.0)}, {"activation_bounds": ARRAY}
    ),
    "arm.Profile.radius": Call(
        ARM.profile.radius,
        lambda: {"z": [0.0]},
        {"z": bad("array", "seven dimensions", "seven columns", "NaN", "infinity")},
    ),
    "cloud.compute_cloud": Call(
        sr.compute_cloud,
        lambda: {"arm": ARM, "n": 4},
        {
            "arm": ANY_ARM,
            "n": WHOLE,
            "seed": bad("whole number", "a number of 400 digits"),
            "sampler": WORD,
            "tol": TOL,
            "progress": PROGRESS,
        },
    ),
    "cloud.design_of": Call(sr.cloud.design_of, lambda: {"cloud": cloud()}, {"cloud": DATA}),
    "cloud.tip_map_of": Call(sr.cloud.tip_map_of, lambda: {"cloud": cloud()}, {"cloud": DATA}),
    "cloud.save_cloud": Call(
        sr.save_cloud,
        lambda: {"cloud": cloud(), "path": "missing/x.zarr"},
        {"cloud": DATA, "path": PATH, "overwrite": FLAG, "durable": FLAG},
    ),
    "cloud.open_cloud": Call(sr.open_cloud, dict, {"path": PATH}),
    "curvature.curvature_statistics": Call(
        sr.curvature.curvature_statistics,
        lambda: {"cloud": cloud()},
        {
            "cloud": DATA,
            "stations": bad("array", "none"),
            "bins": WHOLE,
            "quantiles": ARRAY,
        },
    ),
    "curvature.stream_statistics": Call(
        sr.curvature.stream_statistics,
        lambda: {"arm": ARM, "activations": [GAMMA]},
        {
            "arm": ANY_ARM,
            "activations": bad("mapping", "a list"),
            "stations": bad("array", "none"),
            "bins": WHOLE,
            "quantiles": ARRAY,
        },
    ),
    "curvature.distal_stations": Call(
        sr.curvature.distal_stations, lambda: {"arm": ARM}, {"arm": ANY_ARM, "count": WHOLE}
    ),
    "dexterity.dexterity": Call(
        sr.dexterity.dexterity, lambda: {"cloud": cloud()}, {"cloud": DATA}
    ),
    "dexterity.solution_measure": Call(
        sr.dexterity.solution_measure,
        lambda: {"cloud": cloud()},
        {"cloud": DATA, "cell": OPTIONAL_NUMBER},
    ),
    "exchange.activefilaments.design_script": Call(
        sr.exchange.activefilaments.design_script, lambda: {"arm": ARM}, {"arm": ANY_ARM}
    ),
    "exchange.activefilaments.gamma_path": Call(
        sr.exchange.activefilaments.gamma_path, dict, {"path": PATH}
    ),
    "exchange.activefilaments.read_cloud": Call(
        sr.exchange.activefilaments.read_cloud,
        lambda: {"arm": ARM, "path": "missing.csv"},
        {"arm": ANY_ARM, "path": PATH, "tol": TOL},
    ),
    "exchange.activefilaments.read_design": Call(
        sr.exchange.activefilaments.read_design, dict, {"path": PATH}
    ),
    "exchange.activefilaments.write_cloud": Call(
        sr.exchange.activefilaments.write_cloud,
        lambda: {"cloud": cloud(), "path": "missing/x.csv"},
        {"cloud": DATA, "path": PATH, "overwrite": FLAG},
    ),
    "exchange.activefilaments.write_design": Call(
        sr.exchange.activefilaments.write_design,
        lambda: {"arm": sr.designs.filament(), "path": "missing/x.jl"},
        {"arm": ANY_ARM, "path": PATH, "overwrite": FLAG},
    ),
    "export.export_arm": Call(
        sr.export.export_arm,
        lambda: {"arm": ARM, "configuration": shape(), "path": "missing/x.stl"},
        {"arm": ANY_ARM, "configuration": DATA, "path": PATH, "overwrite": FLAG, "sides": WHOLE},
    ),
    "export.export_cloud": Call(
        sr.export.export_cloud,
        lambda: {"cloud": cloud(), "path": "missing/x.csv"},
        {"cloud": DATA, "path": PATH, "overwrite": FLAG},
    ),
    "export.export_mesh": Call(
        sr.export.export_mesh,
        lambda: {"mesh_or_hull": hull(), "path": "missing/x.stl"},
        {"mesh_or_hull": DATA, "path": PATH, "overwrite": FLAG},
    ),
    "forces.blocked_force": Call(
        sr.forces.blocked_force,
        lambda: {"arm": HEAVY, "places": TIP, "direction": (1.0, 0.0, 0.0)},
        {
            "arm": ANY_ARM,
            "places": ARRAY,
            "direction": ARRAY,
            "start": bad("array", "none"),
            "family": WHOLE,
            "tol": TOL,
            "progress": PROGRESS,
        },
    ),
    "inverse.prepared_map": Call(
        sr.inverse.prepared_map,
        lambda: {"arm": ARM},
        {"arm": ANY_ARM, "tol": TOL, "cells": WHOLE, "depth": WHOLE},
    ),
    "inverse.solve_inverse": Call(
        sr.solve_inverse,
        lambda: {"arm": ARM, "targets": TIP},
        {
            "arm": ANY_ARM,
            "targets": ARRAY,
            "residual_over_length": NUMBER,
            "near": bad("array", "none"),
            "direction": bad("array", "none"),
            "direction_weight": NUMBER,
            "family": WHOLE,
            "prove_least": FLAG,
            "seed": WHOLE,
            "tol": TOL,
        },
    ),
    "path.track_path": Call(
        sr.track_path,
        lambda: {"arm": ARM, "path": TIP},
        {
            "arm": ANY_ARM,
            "path": ARRAY,
            "start": bad("array", "none"),
            "residual_over_length": NUMBER,
            "tol": TOL,
        },
    ),
    "payload.payload_curve": Call(
        sr.payload_curve,
        lambda: {"arm": HEAVY, "payloads": [0.1]},
        {
            "arm": ANY_ARM,
            "payloads": bad("array", "none", "seven dimensions", "seven columns"),
            "accuracy": NUMBER,
            "tol": TOL,
            "progress": PROGRESS,
        },
    ),
    "plot.plot_arm": Call(
        sr.plot.plot_arm,
        lambda: {"arm": ARM},
        {
            "arm": ANY_ARM,
            "configuration": OPTIONAL_DATA,
            **DRAWN,
            "rest": FLAG,
            "bundles": bad("array", "none"),
        },
    ),
    "plot.plot_cloud": Call(
        sr.plot.plot_cloud,
        lambda: {"cloud": cloud()},
        {"cloud": DATA, **DRAWN, "color": COLOR, "size": SIZE, "key": FLAG},
    ),
    "plot.plot_compliance": Call(
        sr.plot.plot_compliance,
        lambda: {"arm": ARM, "configuration": shape(), "compliance": np.eye(3)},
        {
            "arm": ANY_ARM,
            "configuration": DATA,
            "compliance": ARRAY,
            **DRAWN,
            "force": OPTIONAL_NUMBER,
            "rest": FLAG,
        },
    ),
    "plot.plot_cross_section": Call(
        sr.plot.plot_cross_section,
        lambda: {"arm": ARM},
        {
            "arm": ANY_ARM,
            "z": NUMBER,
            "ax": AX,
            "bundles": bad("array", "none"),
            "half_width": OPTIONAL_NUMBER,
            "legend": bad("flag", "none"),
        },
    ),
    "plot.plot_curvature": Call(
        sr.plot.plot_curvature,
        lambda: {"statistics": {"a": statistics()}},
        {"statistics": bad("mapping"), "ax": AX, "quantity": WORD},
    ),
    "plot.plot_designs": Call(
        sr.plot.plot_designs,
        lambda: {"panels": [sr.plot.DesignPanel("a", ARM)]},
        {"panels": bad("words"), "stations_over_length": ARRAY, "width": OPTIONAL_NUMBER},
    ),
    "plot.plot_distance": Call(
        sr.plot.plot_distance,
        lambda: {"cloud": cloud(), "distance": distance()},
        {
            "cloud": DATA,
            "distance": DATA,
            **DRAWN,
            "high": OPTIONAL_NUMBER,
            "size": SIZE,
            "key": FLAG,
        },
    ),
    "plot.plot_distance_histograms": Call(
        sr.plot.plot_distance_histograms,
        lambda: {"distances": {"a": distance()}},
        {"distances": bad("mapping"), "bins": WHOLE, "width": NUMBER},
    ),
    "plot.plot_equilibria": Call(
        sr.plot.plot_equilibria, lambda: {"equilibria": equilibria()}, {"equilibria": DATA, **DRAWN}
    ),
    "plot.plot_hull": Call(
        sr.plot.plot_hull,
        lambda: {"hull": hull()},
        {"hull": DATA, **DRAWN, "length": OPTIONAL_NUMBER, "color": ARRAY},
    ),
    "plot.plot_opposite_sides": Call(
        sr.plot.plot_opposite_sides,
        lambda: {"clouds": {"a": cloud()}},
        {"clouds": bad("mapping"), "view": VIEW, "box_over_length": BOX, "width": NUMBER},
    ),
    "plot.plot_redundancy": Call(
        sr.plot.plot_redundancy,
        lambda: {"clouds": {"a": cloud()}, "distances": {"a": distance()}},
        {
            "clouds": bad("mapping"),
            "distances": bad("mapping"),
            "bundles": bad("mapping", "none", "a dictionary"),
            "thickness": OPTIONAL_NUMBER,
            "width": NUMBER,
        },
    ),
    "plot.plot_slab": Call(
        sr.plot.plot_slab,
        lambda: {"cloud": cloud(), "thickness": 1.0},
        {
            "cloud": DATA,
            **DRAWN,
            "at": NUMBER,
            "thickness": OPTIONAL_NUMBER,
            "color": COLOR,
            "size": SIZE,
            "key": FLAG,
        },
    ),
    "plot.plot_slice": Call(
        sr.plot.plot_slice,
        lambda: {"grid": grid()},
        {"grid": DATA, "ax": AX, "view": VIEW, "at": NUMBER, "key": FLAG},
    ),
    "plot.plot_slices": Call(
        sr.plot.plot_slices,
        lambda: {"grid": grid()},
        {"grid": DATA, "at": ARRAY, "width": NUMBER},
    ),
    "plot.plot_views": Call(
        sr.plot.plot_views,
        lambda: {"cloud": cloud()},
        {
            "cloud": DATA,
            "arm": bad("arm", "none"),
            "configuration": OPTIONAL_DATA,
            "view": VIEW,
            "color": COLOR,
            "size": SIZE,
            "width": NUMBER,
        },
    ),
    "plot.plot_volume_curve": Call(
        sr.plot.plot_volume_curve,
        lambda: {"curves": {"a": [1.0]}, "alphas": [0.1]},
        {
            "curves": bad("mapping"),
            "alphas": ARRAY,
            "ax": AX,
            "length": OPTIONAL_NUMBER,
            "exact": OPTIONAL_NUMBER,
            "convex": OPTIONAL_NUMBER,
        },
    ),
    "plot.save_figure": Call(
        sr.plot.save_figure,
        lambda: {"figure": figure(), "path": "missing/x.png"},
        {"figure": DATA, "path": PATH, "overwrite": FLAG},
    ),
    "redundancy.activation_distance": Call(
        sr.activation_distance,
        lambda: {"cloud": cloud(), "radius": 0.1},
        {"cloud": DATA, "radius": NUMBER, "queries": bad("array", "none")},
    ),
    "redundancy.distance_map": Call(
        sr.redundancy.distance_map,
        lambda: {"cloud": cloud(), "distance": distance()},
        {"cloud": DATA, "distance": DATA, "cell": OPTIONAL_NUMBER},
    ),
    "redundancy.redundancy_summary": Call(
        sr.redundancy.redundancy_summary,
        lambda: {"cloud": cloud(), "distance": distance()},
        {
            "cloud": DATA,
            "distance": DATA,
            "threshold": NUMBER,
            "cell": OPTIONAL_NUMBER,
            "quantiles": ARRAY,
        },
    ),
    "redundancy.tip_density": Call(
        sr.redundancy.tip_density,
        lambda: {"cloud": cloud()},
        {"cloud": DATA, "cell": OPTIONAL_NUMBER},
    ),
    "rest.rest": Call(sr.rest.rest, lambda: {"arm": HEAVY}, {"arm": ANY_ARM, "tol": TOL}),
    "rod.configuration": Call(
        sr.configuration,
        lambda: {"arm": ARM, "activation": GAMMA},
        {"arm": ANY_ARM, "activation": ARRAY, "stations": ARRAY, "tol": TOL},
    ),
    "rod.equilibria": Call(sr.equilibria, lambda: {**SOME, "arm": HEAVY}, POINTS),
    "rod.free_bundles": Call(
        sr.rod.free_bundles, lambda: {"rod": sr.rod.tip_map(ARM)}, {"rod": ANY_ARM}
    ),
    "rod.tip_jacobian": Call(sr.tip_jacobian, lambda: SOME, POINTS),
    "rod.tip_map": Call(
        sr.rod.tip_map, lambda: {"arm": ARM}, {"arm": ANY_ARM, "tol": TOL, "warn": FLAG}
    ),
    "rod.tip_positions": Call(sr.tip_positions, lambda: SOME, POINTS),
    "rod.TipMap.tips": Call(
        sr.rod.tip_map(ARM).tips, lambda: {"activations": GAMMA}, {"activations": ARRAY}
    ),
    "rod.TipMap.frames": Call(
        sr.rod.tip_map(ARM).frames,
        lambda: {"activations": GAMMA, "stations": [0.5]},
        {"activations": ARRAY, "stations": ARRAY},
    ),
    "rod.TipMap.refined": Call(sr.rod.tip_map(ARM).refined, dict, {"tol": TOL}),
    "stiffness.cloud_compliance": Call(
        sr.stiffness.cloud_compliance, lambda: {"cloud": cloud()}, {"cloud": DATA}
    ),
    "stiffness.principal_compliances": Call(
        sr.stiffness.principal_compliances,
        lambda: {"compliance": np.eye(3)[None]},
        {"compliance": bad("array", "NaN")},
    ),
    "stiffness.stiffness_along": Call(
        sr.stiffness.stiffness_along,
        lambda: {"compliance": np.eye(3)[None], "direction": (0.0, 0.0, 1.0)},
        {"compliance": bad("array", "NaN"), "direction": ARRAY},
    ),
    "stiffness.tip_compliance": Call(
        sr.stiffness.tip_compliance, lambda: {**SOME, "arm": HEAVY}, POINTS
    ),
    "volume.concave_hull": Call(
        sr.concave_hull,
        lambda: {"points": cloud().tip, "alpha": 0.5},
        {
            "points": ARRAY,
            "alpha": bad("number", "none", "infinity"),
            "bias": FLAG,
            "method": WORD,
        },
    ),
    "volume.convex_hull": Call(sr.convex_hull, lambda: {"points": TIP}, {"points": ARRAY}),
    "volume.unreachability": Call(
        sr.volume.unreachability,
        lambda: {"points": cloud().tip, "alpha": 0.5},
        {"points": ARRAY, "alpha": bad("number", "none", "infinity"), "method": WORD},
    ),
    "volume.volume_curve": Call(
        sr.volume.volume_curve,
        lambda: {"points": cloud().tip, "alphas": [0.1]},
        {
            "points": ARRAY,
            "alphas": bad("array", "seven dimensions", "seven columns", "infinity"),
            "method": WORD,
        },
    ),
    "workspace.direction_spread": Call(
        sr.workspace.direction_spread,
        lambda: {"arm": ARM, "n": 64},
        {"arm": ANY_ARM, "n": WHOLE, "cell": OPTIONAL_NUMBER, "seed": WHOLE, "tol": TOL},
    ),
    "workspace.reachable_set": Call(
        sr.reachable_set,
        lambda: {"arm": ARM, "accuracy": 0.2},
        {
            "arm": ANY_ARM,
            "accuracy": NUMBER,
            "cell": OPTIONAL_NUMBER,
            "grid": bad("whole number", "none"),
            "tol": TOL,
            "memory": OPTIONAL_NUMBER,
            "progress": PROGRESS,
        },
    ),
    "atlas.DesignSpace.grid": Call(
        DesignSpace.grid,
        lambda: {"base": ARM, "taper": [0.0, 0.02]},
        {"base": ANY_ARM, "taper": ARRAY},
    ),
    "atlas.DesignSpace.listed": Call(
        DesignSpace.listed,
        lambda: {"base": ARM, "taper": [0.0, 0.02]},
        {"base": ANY_ARM, "taper": ARRAY},
    ),
    "atlas.DesignSpace.sampled": Call(
        DesignSpace.sampled,
        lambda: {"base": ARM, "count": 4, "taper": (0.0, 0.02)},
        {
            "base": ANY_ARM,
            "count": WHOLE,
            "method": WORD,
            "seed": WHOLE,
            "taper": ARRAY,
        },
    ),
    "atlas.atlas_cloud": Call(
        lambda atlas, at: sr.atlas.atlas_cloud(atlas, taper=at),
        lambda: {"atlas": built(), "at": 0.0},
        {"atlas": PATH, "at": NUMBER},
    ),
    "atlas.atlas_design": Call(
        lambda atlas, at: sr.atlas.atlas_design(atlas, taper=at),
        lambda: {"atlas": built(), "at": 0.0},
        {"atlas": PATH, "at": NUMBER},
    ),
    "atlas.atlas_status": Call(atlas.atlas_status, lambda: {"atlas": built()}, {"atlas": PATH}),
    "atlas.best_designs": Call(
        atlas.best_designs,
        lambda: {"atlas": built(), "metric": "z_max"},
        {
            "atlas": PATH,
            "metric": WORD,
            "smallest": FLAG,
            "where": bad("mapping", "none"),
            "count": bad("whole number", "a number of 400 digits", "a number of 5000 digits"),
        },
    ),
    "atlas.build_atlas": Call(
        sr.build_atlas,
        lambda: {"space": family(), "store": {}, "n": 10, "metrics": ["extent"]},
        {
            "space": ANY_ARM,
            "store": PATH,
            "n": WHOLE,
            "seed": WHOLE,
            "sampler": WORD,
            "metrics": bad("words"),
            "alpha_over_length": NUMBER,
            "accuracy": NUMBER,
            "tol": TOL,
            "keep_clouds": FLAG,
            "executor": bad("function", "none", "a function"),
            "shard": bad("array"),
            "durable": FLAG,
            "progress": PROGRESS,
        },
    ),
    "atlas.open_atlas": Call(sr.open_atlas, lambda: {"store": stored()}, {"store": PATH}),
    "atlas.over_length": Call(
        atlas.over_length,
        lambda: {"atlas": built(), "metric": "z_max"},
        {"atlas": bad("dataset"), "metric": bad("word")},
    ),
    "atlas.verify_atlas": Call(atlas.verify_atlas, lambda: {"store": stored()}, {"store": PATH}),
    "atlas.worker_processes": Call(
        atlas.worker_processes, lambda: {"count": 1}, {"count": bad("whole number")}
    ),
    "workspace.ReachableSet.distance": Call(
        lambda points: reached().distance(points), lambda: {"points": TIP}, {"points": ARRAY}
    ),
    "workspace.ReachableSolid.contains": Call(
        lambda points: reached().contains(points), lambda: {"points": TIP}, {"points": ARRAY}
    ),
    "workspace.volume_gradient": Call(
        sr.volume_gradient,
        lambda: {"arm": ARM, "parameters": "taper", "accuracy": 0.2},
        {"arm": ANY_ARM, "parameters": bad("words"), "accuracy": NUMBER, "progress": PROGRESS},
    ),
}
"""By the names of `tests.test_names`."""

UNTRIED = {
    "arm.material_names": "takes nothing",
    "atlas.DesignSpace.design": "takes a number that the space itself told",
    "atlas.DesignSpace.from_dict": "takes what to_dict gave",
    "atlas.DesignSpace.place": "takes a number that the space itself told",
    "atlas.DesignSpace.survey": "takes a function of one's own",
    "atlas.DesignSpace.values": "takes a number that the space itself told",
    "atlas.Metric.from_dict": "takes what to_dict gave",
    "atlas.Metric.value": "takes what an atlas finds",
    "arm.designs.elephant_trunk": "takes nothing",
    "arm.designs.filament": "takes nothing",
    "arm.designs.helical_tendon_robot": "takes nothing",
    "arm.designs.lce_arm": "takes nothing",
    "arm.designs.three_chamber_arm": "takes nothing",
    "plot.box_over_length": "takes an atlas",
    "plot.plot_cloud_sheet": "takes functions of one's own",
    "plot.plot_hull_sheet": "takes functions of one's own",
    "plot.plot_metric_map": "takes an atlas",
    "plot.plot_payload_curve": "takes minutes to prepare",
    "plot.sheet_axes": "takes an atlas",
}
"""Functions that the table leaves out, and why."""
