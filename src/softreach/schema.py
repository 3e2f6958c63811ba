"""Schema of every dataset that is stored or passed on: names, dimensions, units and version."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from softreach.arm.driving import inner_arm
from softreach.arm.manipulator import Manipulator
from softreach.arm.number import as_numbers
from softreach.geometry.lattice import CellGrid
from softreach.support.arguments import POSITIVE, as_dataset, as_given, as_number
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.quantity import five_digits
from softreach.support.versions import SCHEMA_VERSION, versions

if TYPE_CHECKING:
    import xarray as xr

AXES = ("x", "y", "z")

_CELL = 1 / 20  # of the arm's length
EDGES = POSITIVE._replace(unit="m")

# variable -> (dimensions, unit, meaning); that of an activation follows from the arm
_ACTIVATION = (("sample", "bundle"), None, "activation of each bundle; negative γ contracts")
_CLOUD = {"tip": (("sample", "axis"), "m", "tip position"), "activation": _ACTIVATION}
_CONFIGURATION = {
    "position": (("sample", "station", "axis"), "m", "centerline r"),
    "directors": (("sample", "station", "director", "axis"), "1", "directors d1, d2, d3"),
    "curvature": (("sample", "station", "component"), "1/m", "Darboux vector u in the directors"),
    "extension": (("sample", "station"), "1", "axial extension ζ"),
    "radius": (("station",), "m", "outer radius R2 before activation"),
    "activation": _ACTIVATION,
}
_OTHERS = {  # where they are asked for
    "line_length": (("sample", "line"), "m", "length of the middle line of each bundle"),
    "bundle_activation": (("sample", "line"), None, "activation that drives and lengths lead to"),
    "marker_position": (("sample", "marker", "axis"), "m", "place of each marker"),
}
_STATUS = "0=stable 1=unstable 2=no_equilibrium 3=undecided 4=snaps"
_KINDS = {"tip": np.float64, "activation": np.float64, "status": np.int8}
_ATTRIBUTES = {
    "design": (str, "the text of a design file"),
    "softreach_version": (str, "a text"),
    "sampler": (str, "the name of a sampler"),
    "tol": ((int, float), "a number"),
    "seed": (int, "a whole number"),  # a cloud of another program has none
}
_SYMBOLS = {"1": "γ", "N": "τ", "Pa": "P", "m": "q"}


def cloud_dataset(
    arm: Manipulator,
    activation: Array,
    tip: Array,
    *,
    seed: int,
    sampler: str,
    tol: float,
    frame: str = "world",
    device: str = "cpu",
) -> xr.Dataset:
    """A reachability cloud: tips and activations with everything needed to make them again."""
    import xarray as xr

    attrs = {
        **provenance(arm, frame),
        "seed": seed,
        "sampler": sampler,
        "tol": tol,
        "device": device,
    }
    variables = _variables(_CLOUD, arm, {"tip": tip, "activation": activation})
    cloud = xr.Dataset(variables, {"axis": list(AXES), **bundle_coordinates(arm)}, attrs)
    cloud.tip.attrs["length"] = arm.length
    return cloud


def with_status(cloud: xr.Dataset, status: NDArray[np.int8]) -> xr.Dataset:
    """The cloud, with a coordinate that says whether each tip is a stable equilibrium."""
    about = {"units": "1", "long_name": "status of the tip", "meanings": _STATUS}
    return cloud.assign_coords(status=("sample", status, about))


def is_stable(data: xr.Dataset | xr.DataArray) -> Mask:
    """Mask of the samples at a stable equilibrium; all, of an arm without loads."""
    if "status" not in data.coords:
        return np.ones(data.sizes["sample"], bool)
    return np.asarray(data.coords["status"].values == 0)


def configuration_dataset(
    arm: Manipulator,
    activation: Array,
    z: Array,
    *,
    names: Sequence[str] | None = None,
    frame: str = "world",
    **arrays: Array,
) -> xr.Dataset:
    """Shapes of an arm at stations Z, and its markers, one for each row of `activation`.

    `names` are those of the bundles with a column there, all by default; `frame` is of the arrays.
    """
    import xarray as xr

    others = {name: about for name, about in _OTHERS.items() if name in arrays}
    arrays["activation"] = activation
    variables = _variables(_CONFIGURATION | others, arm, arrays, names)
    if "bundle_activation" in variables:
        units = inner_arm(arm).bundle_units
        listed = units[0] if len(set(units)) == 1 else ", ".join(units)
        variables["bundle_activation"][2]["units"] = listed
    coordinates = {
        "Z": ("station", z, {"units": "m", "long_name": "station before activation"}),
        "axis": list(AXES),
        "director": ["d1", "d2", "d3"],
        "component": ["u1", "u2", "u3"],
        **({"marker": [each.name for each in arm.markers]} if "marker_position" in others else {}),
        **({"line": list(arm.bundle_names)} if "line_length" in others else {}),
        **bundle_coordinates(arm, names),
    }
    return xr.Dataset(variables, coordinates, provenance(arm, frame))


def a_cloud(name: str, value: object) -> xr.Dataset:
    """A dataset that looks like a cloud; `check_cloud` looks closer."""
    cloud = as_dataset(name, value, "tip", "activation", what="a cloud")
    labels = tuple(map(str, cloud["axis"].values)) if "axis" in cloud.coords else AXES
    if labels != AXES:
        raise InvalidInput(f"{name}.axis", ", ".join(labels), "x, y, z in this order")
    return cloud


def a_configuration(name: str, value: object) -> xr.Dataset:
    """A dataset that looks like a configuration."""
    variables = "position", "directors", "extension", "Z"
    return as_dataset(name, value, *variables, what="a configuration")


def check_cloud(cloud: xr.Dataset) -> xr.Dataset:
    """The dataset itself, if it is a cloud of this schema."""
    a_cloud("cloud", cloud)
    for name, (dims, _, _) in _CLOUD.items():
        if cloud[name].dims != dims:
            raise InvalidInput(f"cloud.{name}", cloud[name].dims, f"a variable over {dims}")
    if (version := cloud.attrs.get("schema_version")) != SCHEMA_VERSION:
        raise InvalidInput("cloud.attrs['schema_version']", version, str(SCHEMA_VERSION))
    return cloud


def check_stored_cloud(cloud: xr.Dataset) -> xr.Dataset:
    """The dataset itself, if it is a cloud that agrees with its own design."""
    check_cloud(cloud)
    for what, given, allowed in _faults(cloud):
        raise InvalidInput(f"cloud.{what}", given, allowed)
    return cloud


def _faults(cloud: xr.Dataset) -> Iterator[tuple[str, Any, Any]]:
    """What is wrong, what is there, and what is allowed; each needs that those before are right."""
    for name, values in cloud.variables.items():
        if values.dtype != (kind := np.dtype(_KINDS.get(str(name), values.dtype))):
            yield str(name), f"of type {values.dtype}", f"of {kind}"
        if values.dtype.kind not in "biufUOT":  # texts may be objects
            yield str(name), f"of type {values.dtype}", "of numbers or of texts"
    for name, (types, allowed) in _ATTRIBUTES.items():
        value = cloud.attrs.get(name, 0 if name == "seed" else None)
        if not isinstance(value, types) or isinstance(value, bool):
            yield f"attrs['{name}']", repr(value), allowed
    if not 0 < cloud.attrs["tol"] < np.inf:
        yield "attrs['tol']", cloud.attrs["tol"], "a finite number > 0"
    frame_of(cloud)
    if "status" in cloud.coords and not np.isin(cloud["status"].values, np.arange(5)).all():
        yield "status", "another number", f"one of {_STATUS}"
    try:
        arm = Manipulator.from_toml(cloud.attrs["design"], source="the cloud's design")
    except InvalidDesign as error:
        if all(fault.path.endswith(".kind") for fault in error.faults):
            return  # classes that are not imported: the points can be used without them
        raise
    for what, given, wanted in _disagreements(cloud, arm):
        yield what, given, f"{wanted}, as its design says"


def _disagreements(cloud: xr.Dataset, arm: Manipulator) -> Iterator[tuple[str, Any, Any]]:
    """What of a cloud is not as its design has it: what is there, and what should be."""
    for name, wanted in (("axis", AXES), ("bundle", arm.input_names), ("unit", arm.input_units)):
        labels = cloud.get(name)
        if labels is not None and tuple(map(str, labels.values)) != tuple(wanted):
            yield name, ", ".join(map(str, labels.values)), ", ".join(wanted)
    for name, size in (("axis", len(AXES)), ("bundle", arm.inputs)):
        if cloud.sizes[name] != size:
            yield f"sizes['{name}']", cloud.sizes[name], size
    length = cloud.tip.attrs.get("length")
    if not isinstance(length, int | float) or not math.isclose(length, arm.length):
        yield "tip.attrs['length']", repr(length), f"{arm.length} m"
    for name, wanted in _pose(arm).items():
        values = as_numbers(cloud.attrs.get(name, ()))
        if values.shape != (len(wanted),) or not np.allclose(values, wanted):
            yield f"attrs['{name}']", as_given(cloud.attrs.get(name)), wanted


def bundle_coordinates(arm: Manipulator, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Names of the bundles, of all or of some; units if they differ, symbols if units tell none."""
    names = list(arm.input_names if names is None else names)
    of_name = dict(zip(arm.input_names, input_symbols(arm), strict=True))
    units, symbols = _units(arm, names), tuple(of_name[name] for name in names)
    coordinates: dict[str, Any] = {"bundle": names}
    if len(set(units)) > 1:
        coordinates["unit"] = ("bundle", list(units))
    if symbols != _symbols_of(units):
        coordinates["symbol"] = ("bundle", list(symbols))
    return coordinates


def _units(arm: Manipulator, names: Sequence[str] | None) -> tuple[str, ...]:
    of_name = dict(zip(arm.input_names, arm.input_units, strict=True))
    return tuple(of_name[name] for name in (of_name if names is None else names))


def _symbols_of(units: Iterable[str]) -> tuple[str, ...]:
    return tuple(_SYMBOLS.get(unit, "a") for unit in units)


def input_symbols(arm: Manipulator) -> tuple[str, ...]:
    """The symbol of each input: that of the bundle's actuator, or that of the drive's unit."""
    alone = (arm.bundle_actuators[k].symbol for k in arm.undriven)
    return (*_symbols_of(drive.unit for drive in arm.drives), *alone)


def activation_symbols(activation: xr.DataArray) -> tuple[str, ...]:
    """The symbol of each bundle of a cloud; those of its units if it names none."""
    if "symbol" in activation.coords:
        return tuple(map(str, activation["symbol"].values))
    return _symbols_of(activation_units(activation))


def activation_units(activation: xr.DataArray) -> tuple[str, ...]:
    """The unit of each bundle of a cloud."""
    count = activation.sizes[next(dim for dim in activation.dims if dim != "sample")]
    if "unit" in activation.coords:
        return tuple(str(unit) for unit in activation["unit"].values)
    return (str(activation.attrs.get("units", "1")),) * count


def activation_text(
    arm: Manipulator, values: Iterable[float], names: Sequence[str] | None = None
) -> str:
    """Activations with the names and units of their bundles: "left -1, right 0.5 N"."""
    texts = []
    for name, value, unit in zip(names or arm.input_names, values, _units(arm, names), strict=True):
        text = five_digits(round(value, 6) + 0.0) if unit == "1" else f"{five_digits(value)} {unit}"
        texts.append(f"{name} {text}")
    return ", ".join(texts)


def activation_attributes(arm: Manipulator, names: Sequence[str] | None = None) -> dict[str, str]:
    """The unit of activations if all bundles share it; else the coordinate `unit` has each."""
    units = set(_units(arm, names))
    return {"units": units.pop()} if len(units) == 1 else {}


def _variables(
    table: Mapping[str, tuple[tuple[str, ...], str | None, str]],
    arm: Manipulator,
    arrays: Mapping[str, Array],
    names: Sequence[str] | None = None,
) -> dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]:
    activation = activation_attributes(arm, names)
    return {
        name: (dims, arrays[name], ({"units": unit} if unit else activation) | {"long_name": about})
        for name, (dims, unit, about) in table.items()
    }


def provenance(arm: Manipulator, frame: str = "world") -> dict[str, object]:
    """Attributes that say which design and version a dataset was computed from, and its frame.

    What is at p in the frame of the base is at `base_position` + `base_rotation` p in the world;
    the rotation is there row by row.
    """
    return {"design": arm.to_toml(), **versions(), "frame": frame, **_pose(arm)}


def _pose(arm: Manipulator) -> dict[str, list[float]]:
    rotation = arm.base.rotation.ravel().tolist()
    return {"base_position": list(arm.base.position), "base_rotation": rotation}


def frame_of(data: xr.Dataset) -> Literal["world", "base"]:
    """The frame of the places in a dataset, which it must name."""
    if (frame := data.attrs.get("frame")) in ("world", "base"):
        return frame
    raise InvalidInput("attrs['frame']", as_given(frame), "world or base")


def base_of(data: xr.Dataset) -> Array:
    """Position of the clamped end of the arm, in the frame of the dataset [m], shape (3,)."""
    place = data.attrs.get("base_position", (0.0, 0.0, 0.0))
    return np.array(place if frame_of(data) == "world" else (0.0, 0.0, 0.0), float)


def storable(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset with its names as variable-length strings, which Zarr v3 specifies."""
    names = {name: each for name, each in dataset.coords.items() if each.dtype.kind == "U"}
    texts = np.dtypes.StringDType()
    return dataset.assign_coords({name: each.astype(texts) for name, each in names.items()})


def stored_names(dataset: xr.Dataset) -> xr.Dataset:
    """The inverse of `storable`: names that xarray can fill, join and pickle."""
    named = {name: x for name, x in dataset.coords.items() if x.dtype.kind == "T"}
    texts = {name: np.array(x.values.tolist(), dtype=str) for name, x in named.items()}
    return dataset.assign_coords({k: (x.dims, texts[k], x.attrs) for k, x in named.items()})


def tip_cells(cloud: xr.Dataset, edge: float | None = None) -> CellGrid:
    """The tips of a cloud sorted into cubes of an edge [m], by default L/20; unstable in none."""
    tip = check_cloud(cloud)["tip"]
    points = tip.values
    if "status" in cloud.coords:
        points = np.where(is_stable(cloud)[:, None], points, np.nan)
    default = _CELL * float(tip.attrs["length"])
    return CellGrid.around(points, default if edge is None else as_number("cell", edge, EDGES))


def cell_dataset(grid: CellGrid, **variables: tuple[NDArray[Any], dict[str, str]]) -> xr.Dataset:
    """Variables, each with its attributes, over the centers x, y, z [m] of cubes."""
    import xarray as xr

    pairs = zip(AXES, grid.centers(), strict=True)
    centers = {axis: (axis, places, {"units": "m"}) for axis, places in pairs}
    data = {name: (AXES, *content) for name, content in variables.items()}
    return xr.Dataset(data, centers, {"cell": grid.edge})
