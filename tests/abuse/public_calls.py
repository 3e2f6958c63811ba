"""A call of every public function that works, and the kind of each of its arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import softreach as sr
from softreach.atlas import DesignSpace
from tests.calibration.arms import hanging_tentacle, measured
from tests.test_names import FUNCTIONS, parameters

__all__ = ["CALLS", "UNTRIED", "Call"]

ARM = sr.designs.minimal_trunk()
MATERIAL = sr.Material(young_modulus=1e6, density=1000.0)
HEAVY = sr.designs.minimal_trunk(material=MATERIAL).replace(loads=sr.Loads())
GAMMA = np.full((1, 3), -0.5)
TIP = sr.tip_positions(ARM, GAMMA)
BOX = sr.requirements.Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


@cache
def cloud():
    """64 samples."""
    return sr.compute_cloud(ARM, 64)


@cache
def exchanged():
    """That cloud as a file of the other program."""
    path = Path(mkdtemp()) / "cloud.csv"
    sr.exchange.activefilaments.write_cloud(cloud(), path)
    return path


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
def needs():
    """One place to reach."""
    return sr.Requirements(targets=[sr.requirements.Target(TIP)])


@cache
def judged():
    """That arm against them."""
    return sr.check(ARM, needs())


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


@cache
def searched():
    """A search of one design."""
    free = {"taper": (0.0, 0.02)}
    return sr.search(ARM, free, maximize="actuators", designs=1, accuracy=0.2, polish=False)


BENCH = hanging_tentacle()


@cache
def poses():
    """Measured poses of a tentacle."""
    return measured(BENCH, 6)


@cache
def runs():
    """The same in two runs."""
    return poses() | {"run": [k % 2 for k in range(len(next(iter(poses().values()))))]}


def calibration():
    """A calibration by them."""
    return sr.calibrate(BENCH, poses(), free=["pose.x"], rivals=False)


OF_COLUMNS = dict(inputs="mapping", markers="mapping", run="text", order="text")
OF_POSES = OF_COLUMNS | dict(
    free="words", prior="mapping", hold_out="number", robust="flag", noise="number", rivals="flag"
)

NAMES = {
    "arm": "arm base material rod space",
    "dataset": "ax cloud configuration distance equilibria figure grid hull mesh_or_hull",
    "array": """activation activation_bounds activations alphas box box_over_length bundles
        compliance direction near payloads places points quantiles queries shard start stations
        stations_over_length targets z""",
    "number": """accuracy alpha alpha_over_length at cell convex direction_weight exact force
        half_width high length memory radius radius_ratio residual_over_length revolution size
        taper thickness threshold tip_radius tol width""",
    "whole number": "bins cells count depth family n seed segments sides",
    "word": "color fiber frame method metric name quantity sampler unit view",
    "words": "metrics names panels parameters",
    "flag": """bias durable keep_clouds keep_extent key legend overwrite prove_least rest smallest
        warn""",
    "path": "atlas path store",
    "function": "executor progress",
    "text": "source text",
    "mapping": "clouds curves distances statistics values where",
}
"""Kinds of arguments, keys of `BAD`, with the names that have them unless a call says otherwise."""

KINDS = {name: kind for kind, names in NAMES.items() for name in names.split()}

FINE = {
    "progress": {"a function", "a class"},
    "color": {"a number"},
    "fiber": {"a number"},
    "alpha": {"infinity"},
}
"""Bad values of a kind that are right for an argument; None is so where it is the default."""


@dataclass(frozen=True)
class Call:
    """A function with arguments of which all are right."""

    good: Callable[[], Mapping[str, object]] = dict
    """The arguments that it must be given."""

    function: Callable | None = None
    """Where it is not the public one, such as a method of an arm."""

    kinds: Mapping[str, str] = field(default_factory=dict)
    """Kinds of arguments that mean something else here."""

    fine: Mapping[str, set[str]] = field(default_factory=dict)
    """As `FINE`, here."""

    said: str = ""
    """What errors may name instead of the argument."""

    def arguments(self, name: str) -> dict[str, tuple[str, set[str]]]:
        """Kind and fine values of every argument, of the function with this name."""
        signature = parameters(self.function or FUNCTIONS[name])
        found = {}
        for argument, parameter in signature.items():
            if parameter.kind is not parameter.VAR_KEYWORD:
                fine = self.fine.get(argument, FINE.get(argument, set()))
                fine = fine | {"none"} if parameter.default is None else fine
                found[argument] = self.kinds.get(argument) or KINDS[argument], fine
        return found | {
            name: (kind, set()) for name, kind in self.kinds.items() if name not in found
        }


MANY = {"seven dimensions", "seven columns"}
"""Arrays that count as lists of numbers."""

CALLS: dict[str, Call] = {
    "arm.describe": Call(lambda: dict(arm=ARM)),
    "arm.limit_shortening": Call(lambda: dict(arm=ARM, most=0.3), kinds=dict(most="number")),
    "arm.line_lengths": Call(lambda: dict(arm=ARM, activations=[[0.0] * ARM.bundles])),
    "arm.named_material": Call(lambda: dict(name="steel")),
    "arm.designs.minimal_trunk": Call(),
    "arm.designs.redundant_trunk": Call(),
    "arm.designs.three_tendon_robot": Call(),
    "arm.parameters.changed": Call(lambda: dict(arm=ARM, values={"taper": 0.01}), said="parameter"),
    "arm.parameters.find_parameter": Call(lambda: dict(arm=ARM, name="taper"), said="parameter"),
    "arm.parameters.find_parameters": Call(
        lambda: dict(arm=ARM, names=("taper",)), said="parameter"
    ),
    "arm.parameters.parameters": Call(lambda: dict(arm=ARM)),
    "arm.Manipulator.from_toml": Call(lambda: dict(text=ARM.to_toml())),
    "arm.Manipulator.load": Call(),
    "arm.Manipulator.save": Call(lambda: dict(path="missing/x.toml"), function=ARM.save),
    "arm.Manipulator.outline": Call(lambda: dict(z=[0.0]), function=ARM.outline),
    "arm.Manipulator.split": Call(lambda: dict(fiber="left", count=2), function=ARM.split),
    "arm.Manipulator.with_bounds": Call(
        lambda: dict(activation_bounds=(-1.0, 0.0)), function=ARM.with_bounds
    ),
    "arm.Profile.radius": Call(
        lambda: dict(z=[0.0]), function=ARM.profile.radius, fine={"z": MANY | {"NaN", "infinity"}}
    ),
    "calibration.calibrate": Call(
        lambda: dict(arm=BENCH, data=poses(), free=["pose.x"], rivals=False),
        kinds=dict(data="dataset", **OF_POSES),
        fine=dict(seed={"a number of 400 digits", "a number of 5000 digits"}),
        said="parameter",
    ),
    "calibration.read_measurements": Call(
        lambda: dict(arm=BENCH, data=poses()), kinds=dict(data="dataset", **OF_COLUMNS), said="data"
    ),
    "calibration.ladder": Call(
        lambda: dict(arm=BENCH, data=poses(), free=[["pose.x"]]),
        kinds=dict(data="dataset", free="words", hold_out=OF_POSES["hold_out"]),
        fine=dict(seed={"a number of 400 digits", "a number of 5000 digits"}),
        said="parameter",
    ),
    "calibration.leave_one_run_out": Call(
        lambda: dict(arm=BENCH, data=runs(), free=["pose.x"]),
        kinds=dict(data="dataset", free="words"),
        said="parameter",
    ),
    "calibration.profile": Call(
        lambda: dict(result=calibration(), name="pose.x", values=[0.0]),
        kinds=dict(result="dataset"),
        fine=dict(values={"a list", "a number"}),
    ),
    "calibration.plan_poses": Call(
        lambda: dict(arm=BENCH, free=["pose.x"], n=2, candidates=8),
        kinds=dict(free="words", markers="words", candidates="whole number"),
        said="parameter",
    ),
    "cloud.compute_cloud": Call(
        lambda: dict(arm=ARM, n=4), fine={"seed": {"a number of 400 digits"}}
    ),
    "cloud.design_of": Call(lambda: dict(cloud=cloud())),
    "cloud.tip_map_of": Call(lambda: dict(cloud=cloud())),
    "cloud.save_cloud": Call(lambda: dict(cloud=cloud(), path="missing/x.zarr")),
    "cloud.open_cloud": Call(),
    "cloud.curvature.curvature_statistics": Call(lambda: dict(cloud=cloud())),
    "cloud.curvature.stream_statistics": Call(
        lambda: dict(arm=ARM, activations=[GAMMA]),
        kinds=dict(activations="mapping"),
        fine={"activations": {"a list"}},
    ),
    "cloud.curvature.distal_stations": Call(lambda: dict(arm=ARM)),
    "cloud.dexterity.dexterity": Call(lambda: dict(cloud=cloud())),
    "cloud.dexterity.solution_measure": Call(lambda: dict(cloud=cloud())),
    "exchange.activefilaments.design_script": Call(lambda: dict(arm=ARM)),
    "exchange.activefilaments.gamma_path": Call(),
    "exchange.activefilaments.read_cloud": Call(
        lambda: dict(arm=ARM, path=exchanged()), said="file"
    ),
    "exchange.activefilaments.read_design": Call(),
    "exchange.activefilaments.write_cloud": Call(lambda: dict(cloud=cloud(), path="missing/x.csv")),
    "exchange.activefilaments.write_design": Call(
        lambda: dict(arm=sr.designs.filament(), path="missing/x.jl")
    ),
    "export.export_arm": Call(lambda: dict(arm=ARM, configuration=shape(), path="missing/x.stl")),
    "export.cloud_table": Call(lambda: dict(cloud=cloud())),
    "export.export_cloud": Call(lambda: dict(cloud=cloud(), path="missing/x.csv")),
    "export.export_mesh": Call(lambda: dict(mesh_or_hull=hull(), path="missing/x.stl")),
    "forces.blocked_force": Call(lambda: dict(arm=HEAVY, places=TIP, direction=(1.0, 0.0, 0.0))),
    "inverse.prepared_map": Call(lambda: dict(arm=ARM)),
    "inverse.solve_inverse": Call(lambda: dict(arm=ARM, targets=TIP)),
    "inverse.twin_hints": Call(lambda: dict(arm=ARM, targets=TIP)),
    "inverse.path.track_path": Call(lambda: dict(arm=ARM, path=TIP), kinds=dict(path="array")),
    "workspace.payload.payload_curve": Call(
        lambda: dict(arm=HEAVY, payloads=[0.1]), fine={"payloads": MANY}
    ),
    "plot.plot_3d": Call(
        lambda: dict(data=cloud()),
        kinds=dict(data="dataset", caption="text"),
        fine=dict(caption={"none"}),
    ),
    "plot.plot_arm": Call(lambda: dict(arm=ARM)),
    "plot.plot_calibration": Call(
        lambda: dict(calibration=calibration()), kinds=dict(calibration="dataset")
    ),
    "plot.plot_check": Call(
        lambda: dict(check=judged()), kinds=dict(check="dataset", poses="whole number")
    ),
    "plot.plot_cloud": Call(lambda: dict(cloud=cloud())),
    "plot.plot_compliance": Call(
        lambda: dict(arm=ARM, configuration=shape(), compliance=np.eye(3))
    ),
    "plot.plot_cross_section": Call(lambda: dict(arm=ARM), kinds=dict(z="number")),
    "plot.plot_curvature": Call(lambda: dict(statistics={"a": statistics()})),
    "plot.plot_designs": Call(lambda: dict(panels=[sr.plot.DesignPanel("a", ARM)])),
    "plot.plot_distance": Call(lambda: dict(cloud=cloud(), distance=distance())),
    "plot.plot_distance_histograms": Call(lambda: dict(distances={"a": distance()})),
    "plot.plot_equilibria": Call(lambda: dict(equilibria=equilibria())),
    "plot.plot_hull": Call(
        lambda: dict(hull=hull()), kinds=dict(color="array"), fine={"color": set()}
    ),
    "plot.plot_opposite_sides": Call(lambda: dict(clouds={"a": cloud()})),
    "plot.plot_redundancy": Call(
        lambda: dict(clouds={"a": cloud()}, distances={"a": distance()}),
        kinds=dict(bundles="mapping"),
        fine={"bundles": {"a dictionary"}},
    ),
    "plot.plot_search": Call(lambda: dict(search=searched()), kinds=dict(search="dataset")),
    "plot.plot_slab": Call(lambda: dict(cloud=cloud(), thickness=1.0)),
    "plot.plot_slice": Call(lambda: dict(grid=grid())),
    "plot.plot_slices": Call(lambda: dict(grid=grid()), kinds=dict(at="array")),
    "plot.plot_views": Call(lambda: dict(cloud=cloud())),
    "plot.plot_volume_curve": Call(lambda: dict(curves={"a": [1.0]}, alphas=[0.1]), said="radii"),
    "plot.save_figure": Call(lambda: dict(figure=figure(), path="missing/x.png")),
    "cloud.redundancy.activation_distance": Call(lambda: dict(cloud=cloud(), radius=0.1)),
    "cloud.redundancy.distance_map": Call(lambda: dict(cloud=cloud(), distance=distance())),
    "cloud.redundancy.redundancy_summary": Call(lambda: dict(cloud=cloud(), distance=distance())),
    "cloud.redundancy.tip_density": Call(lambda: dict(cloud=cloud())),
    "optimization.search": Call(
        lambda: dict(base=ARM, free={"taper": (0.0, 0.02)}, designs=1, accuracy=0.2, polish=False),
        kinds=dict(
            free="mapping",
            choices="mapping",
            tolerances="mapping",
            requirements="dataset",
            maximize="words",
            minimize="words",
            designs="whole number",
            polish="flag",
            robust="flag",
            storage="path",
            follow="function",
        ),
        fine=dict(follow={"a class", "a function"}),  # what they raise is theirs
        said="parameter",
    ),
    "optimization.sensitivity": Call(
        lambda: dict(of=searched(), n=0),
        kinds=dict(of="dataset", candidate="dataset"),
        fine=dict(seed={"a number of 400 digits", "a number of 5000 digits"}),
    ),
    "optimization.tolerance": Call(
        lambda: dict(arm=ARM, sigmas={"taper": 1e-3}, samples=100, checked=0, accuracy=0.1),
        kinds=dict(
            sigmas="mapping", requirements="dataset", samples="whole number", checked="whole number"
        ),
        fine=dict(seed={"a number of 400 digits", "a number of 5000 digits"}),
        said="parameter",
    ),
    "optimization.Search.save": Call(
        lambda: dict(folder="missing/x"),
        function=lambda **given: searched().save(**given),
        kinds=dict(folder="path"),
    ),
    "optimization.Search.save_report": Call(
        lambda: dict(path="missing/x.html"),
        function=lambda **given: searched().save_report(**given),
    ),
    "optimization.Search.save_table": Call(
        lambda: dict(path="missing/x.csv"), function=lambda **given: searched().save_table(**given)
    ),
    "requirements.check": Call(
        lambda: dict(arm=ARM, requirements=needs()), kinds=dict(requirements="dataset")
    ),
    "requirements.quick_excess": Call(
        lambda: dict(arm=ARM, requirements=needs()), kinds=dict(requirements="dataset")
    ),
    "requirements.Box.distance": Call(lambda: dict(points=TIP), function=BOX.distance),
    "requirements.Box.places": Call(lambda: dict(n=3), function=BOX.places),
    "requirements.Mesh.load": Call(lambda: dict(path="missing.stl")),
    "requirements.Requirements.load": Call(
        lambda: dict(path="missing.toml"), kinds=dict(length="number")
    ),
    "requirements.Requirements.from_toml": Call(
        lambda: dict(text=""), kinds=dict(folder="path", length="number")
    ),
    "requirements.Requirements.save": Call(
        lambda: dict(path="missing/x.toml"), function=sr.Requirements().save
    ),
    "rest.rest": Call(lambda: dict(arm=HEAVY)),
    "rod.configuration": Call(lambda: dict(arm=ARM, activation=GAMMA)),
    "rod.equilibria": Call(lambda: dict(arm=HEAVY, activations=GAMMA)),
    "rod.free_bundles": Call(lambda: dict(rod=sr.rod.tip_map(ARM))),
    "rod.marker_positions": Call(lambda: dict(arm=ARM, activations=GAMMA)),
    "rod.tip_jacobian": Call(lambda: dict(arm=ARM, activations=GAMMA)),
    "rod.tip_map": Call(lambda: dict(arm=ARM)),
    "rod.tip_positions": Call(lambda: dict(arm=ARM, activations=GAMMA)),
    "rod.TipMap.tips": Call(lambda: dict(activations=GAMMA), function=sr.rod.tip_map(ARM).tips),
    "rod.TipMap.frames": Call(
        lambda: dict(activations=GAMMA, stations=[0.5]),
        function=lambda activations, stations: sr.rod.tip_map(ARM).frames(activations, stations),
    ),
    "stiffness.cloud_compliance": Call(lambda: dict(cloud=cloud())),
    "stiffness.principal_compliances": Call(
        lambda: dict(compliance=np.eye(3)[None]), fine={"compliance": {"NaN"}}
    ),
    "stiffness.stiffness_along": Call(
        lambda: dict(compliance=np.eye(3)[None], direction=(0.0, 0.0, 1.0)),
        fine={"compliance": {"NaN"}},
    ),
    "stiffness.tip_compliance": Call(lambda: dict(arm=HEAVY, activations=GAMMA)),
    "cloud.volume.concave_hull": Call(lambda: dict(points=cloud().tip, alpha=0.5)),
    "cloud.volume.convex_hull": Call(lambda: dict(points=TIP)),
    "cloud.volume.unreachability": Call(lambda: dict(points=cloud().tip, alpha=0.5)),
    "cloud.volume.volume_curve": Call(
        lambda: dict(points=cloud().tip, alphas=[0.1]), fine={"alphas": MANY | {"infinity"}}
    ),
    "workspace.direction_spread": Call(lambda: dict(arm=ARM, n=64)),
    "workspace.reachable_set": Call(
        lambda: dict(arm=ARM, accuracy=0.2), kinds=dict(grid="whole number")
    ),
    "workspace.volume_gradient": Call(
        lambda: dict(arm=ARM, parameters="taper", accuracy=0.2), said="parameter"
    ),
    "workspace.ReachableSet.distance": Call(
        lambda: dict(points=TIP), function=lambda points: reached().distance(points)
    ),
    "workspace.ReachableSolid.contains": Call(
        lambda: dict(points=TIP), function=lambda points: reached().contains(points)
    ),
    "atlas.DesignSpace.grid": Call(
        lambda: dict(base=ARM, taper=[0.0, 0.02]),
        function=DesignSpace.grid,
        kinds=dict(taper="array"),
    ),
    "atlas.DesignSpace.listed": Call(
        lambda: dict(base=ARM, taper=[0.0, 0.02]),
        function=DesignSpace.listed,
        kinds=dict(taper="array"),
    ),
    "atlas.DesignSpace.sampled": Call(
        lambda: dict(base=ARM, count=4, taper=(0.0, 0.02)),
        function=DesignSpace.sampled,
        kinds=dict(taper="array"),
    ),
    "atlas.atlas_cloud": Call(
        lambda: dict(atlas=built(), taper=0.0),
        kinds=dict(taper="number"),
    ),
    "atlas.atlas_design": Call(
        lambda: dict(atlas=built(), taper=0.0),
        kinds=dict(taper="number"),
    ),
    "atlas.atlas_status": Call(lambda: dict(atlas=built())),
    "atlas.best_designs": Call(
        lambda: dict(atlas=built(), metric="z_max"),
        fine={"count": {"a number of 400 digits", "a number of 5000 digits"}},
    ),
    "atlas.build_atlas": Call(
        lambda: dict(space=family(), store={}, n=10, metrics=["extent"]),
    ),
    "atlas.open_atlas": Call(lambda: dict(store=stored())),
    "atlas.over_length": Call(
        lambda: dict(atlas=built(), metric="z_max"), kinds=dict(atlas="dataset")
    ),
    "atlas.verify_atlas": Call(lambda: dict(store=stored())),
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
