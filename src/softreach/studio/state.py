"""What a tab of the studio shows, as a value."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.studio.rod import design_of_text, rod_of
from softreach.studio.settings import PlotSettings, TipPath
from softreach.studio.sight import CUTS
from softreach.support.errors import InvalidInput, Range

__all__ = [
    "LEVELS",
    "Appearance",
    "Camera",
    "MapView",
    "Slice",
    "StudioState",
    "Vector",
    "vector",
]

VERSION = 1
LEVELS = range(14, 22)
"""The cloud has 2^level points: in a Sobol sequence every such prefix is an even subsample."""

Vector = tuple[float, float, float]

_AXES = ("none", "x", "y", "z")
_FAR = 1e3  # [L], beyond which there is nothing to see


@dataclass(frozen=True, kw_only=True)
class Slice:
    """A slab across the cloud; the rest is hidden."""

    axis: str = "none"
    """"x", "y" or "z" across the slab, or "none"."""
    center: float = 0.0
    """[L]."""
    thickness: float = 0.05
    """[L]."""

    def __post_init__(self) -> None:
        if self.axis not in _AXES:
            raise InvalidInput("slice.axis", self.axis, f"one of {', '.join(_AXES)}")
        _check_number("slice.center", self.center, -_FAR, _FAR)
        _check_number("slice.thickness", self.thickness, 0.0, _FAR)


@dataclass(frozen=True, kw_only=True)
class MapView:
    """What the map of an atlas shows; "" is the first there is."""

    metric: str = ""
    right: str = ""
    """The parameter to the right."""
    up: str = ""
    shown: bool = True

    def __post_init__(self) -> None:
        _check_plain("map", self)


@dataclass(frozen=True, kw_only=True)
class Appearance:
    """What is drawn and how."""

    level: int = 17
    color: str = "effort"
    """One of `colors.color_names`."""
    point_size: float = 0.007
    """[L]."""
    slice: Slice = field(default_factory=Slice)
    cut: str = "window"
    """What of the cloud is cut away in front of the arm: one of `sight.CUTS`."""
    lit: bool = True
    """Whether a lamp shines on the points."""
    orthographic: bool = False
    """Whether parallels stay parallel."""
    dark: bool = False
    """Whether the page is dark."""
    cloud: bool = True
    arm: bool = True
    axes: bool = True
    surface: bool = False
    """The exact boundary of the reachable set."""
    alpha_shape: bool = False
    trail: bool = False
    """Where the tip has been."""
    free: bool = True
    """The cloud without loads, faint, around that of a loaded arm."""
    ghosts: bool = True
    """The shapes of all solutions of the inverse problem at once."""
    handle: bool = True
    """The ball on the tip that is dragged."""
    map: MapView = field(default_factory=MapView)
    plots: PlotSettings = field(default_factory=PlotSettings)

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise InvalidInput("level", self.level, f"{LEVELS[0]} to {LEVELS[-1]}")
        if self.cut not in CUTS:
            raise InvalidInput("cut", self.cut, f"one of {', '.join(CUTS)}")
        _check_number("point_size", self.point_size, 0.0, 1.0)
        _check_plain("appearance", self)


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Where the eye is and what it looks at [L]."""

    position: Vector
    look_at: Vector

    def __post_init__(self) -> None:
        for value in (*self.position, *self.look_at):
            _check_number("camera", value, -_FAR, _FAR)


@dataclass(frozen=True, kw_only=True)
class StudioState:
    """Everything that a tab shows follows from this value.

    Raises:
        InvalidInput: Activations or appearance out of range.
        InvalidDesign: A design that some activation within its bounds would shorten to nothing.
    """

    design: Manipulator
    activation: tuple[float, ...] = ()
    """Of each bundle in its unit, within the bounds; rest, or what is nearest to it, by default."""
    appearance: Appearance = field(default_factory=Appearance)
    target: Vector | None = None
    """Where the tip should go [m]."""
    reference: Manipulator | None = None
    """A design kept for comparison."""
    side_by_side: bool = False
    camera: Camera | None = None
    path: TipPath | None = None
    """What the tip follows."""

    def __post_init__(self) -> None:
        if self.reference is not None:
            rod_of(self.reference)
        within = _within(rod_of(self.design).box, self.activation)
        object.__setattr__(self, "activation", within)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; activations are moved into the bounds."""
        return replace(self, **changes)

    def showing(self, **changes: Any) -> Self:
        """A copy that looks different."""
        return replace(self, appearance=replace(self.appearance, **changes))

    def to_json(self) -> str:
        """The state as text, from which `from_json` makes an equal one."""
        values = {name: getattr(self, name) for name in _PLAIN}
        values["appearance"] = asdict(self.appearance)
        values["camera"] = self.camera and asdict(self.camera)
        values["path"] = self.path and asdict(self.path)
        values["design"] = self.design.to_toml()
        values["reference"] = self.reference and self.reference.to_toml()
        return json.dumps({"softreach_studio": VERSION, **values}, indent=1, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """The state that `to_json` wrote.

        Raises:
            InvalidInput: The text is no such state.
            InvalidDesign: A design in it cannot exist.
        """
        values = _parsed(text)
        try:
            return cls(**_fields(values))
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            if type(error).__module__.startswith("softreach"):
                raise
            raise InvalidInput("state file", str(error), "one that the studio saved") from None


_PLAIN = ("activation", "target", "side_by_side")


def _parsed(text: str | bytes) -> dict[str, Any]:
    allowed = f"a state that the studio saved, version {VERSION}"
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidInput("state file", str(error), allowed) from None
    found = values.pop("softreach_studio", None) if isinstance(values, dict) else None
    if found != VERSION:
        raise InvalidInput("state file", f"version {found}", allowed)
    return values


def _fields(values: dict[str, Any]) -> dict[str, Any]:
    look = dict(values["appearance"])
    look["slice"], look["map"] = Slice(**look["slice"]), MapView(**look["map"])
    look["plots"] = PlotSettings.from_fields(look.get("plots", {}))
    camera, reference, path = values["camera"], values["reference"], values.get("path")
    return {
        "design": design_of_text(values["design"], "state file"),
        "activation": tuple(map(float, values["activation"])),
        "appearance": Appearance(**look),
        "target": values["target"] and vector(values["target"]),
        "reference": reference and design_of_text(reference, "state file"),
        "side_by_side": bool(values["side_by_side"]),
        "camera": camera and Camera(**{name: vector(v) for name, v in camera.items()}),
        "path": path and TipPath.from_fields(path),
    }


def vector(values: Iterable[float]) -> Vector:
    """Three plain numbers."""
    x, y, z = map(float, values)
    return x, y, z


def _check_number(name: str, value: object, low: float, high: float) -> None:
    if not Range(low, high).admits(value):
        raise InvalidInput(name, value, f"{low:g} to {high:g}")


def _check_plain(name: str, value: Appearance | MapView) -> None:
    """Texts are texts and switches are switches, in a state that came from elsewhere too."""
    for one in fields(value):
        held = getattr(value, one.name)
        kind = {"bool": bool, "str": str}.get(str(one.type))
        if kind is not None and not isinstance(held, kind):
            raise InvalidInput(f"{name}.{one.name}", held, f"a {kind.__name__}")


def _within(box: ActivationBox, activation: Sequence[float]) -> tuple[float, ...]:
    """As many activations as there are bundles, each within its bounds."""
    wanted = np.zeros(box.bundles)
    count = min(len(activation), box.bundles)
    wanted[:count] = np.asarray(activation, float)[:count]
    if not np.isfinite(wanted).all():
        raise InvalidInput("activation", tuple(activation), "finite numbers")
    return tuple(box.clip(wanted).tolist())
