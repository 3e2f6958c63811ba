"""Figures in space that turn in a browser: clouds, surfaces, arms and equilibria together."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.arm.skin import arm_surface, bundle_skins, inside, marker_points
from softreach.cloud.clouds import design_of
from softreach.geometry.surface import compact_surface, simplified, tube_surface
from softreach.picture.page import (
    ColorScale,
    Dots,
    Figure3D,
    PagePart,
    Skin,
    Swatches,
    css_color,
    web_page,
)
from softreach.picture.projection import View, view_angles
from softreach.plot.arm import shapes_of
from softreach.plot.axes import bounding_box
from softreach.plot.coloring import BundleKey, ScalarKey, color_map, color_samples, key_entries
from softreach.plot.reach import drawn_tips, point_size
from softreach.plot.style import Unit, a_surface, unit_for
from softreach.rod.kinematics import rest_configuration
from softreach.rod.tip_map import TipStatus
from softreach.schema import a_cloud, a_configuration
from softreach.support.arguments import as_given, as_text
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, counted
from softreach.support.lazy import Dataset
from softreach.support.palette import BODY, STEEL, Color, bundle_color
from softreach.support.units import LengthUnit

_POINTS = 200_000  # of a cloud: 2.4 MB of the page
_STATIONS = 121  # of equilibria
_PALE = 0.62  # how far the colors of the arm at rest go toward white
_CLEAR = 0.4  # opacity of surfaces beside others or around a cloud
_BODY_CLEAR = 0.45  # of a body that has something inside
_LINE = 1 / 300  # radius of the centerline of an unstable arm, in L
_MARKER = 1 / 60  # diameter of the dot of a marker, in L
_UNSTABLE: Color = (0.45, 0.45, 0.45)
_SIZES = "", "curve_length", "area", "volume"  # of a reachable set, by its dimension
_SURFACES: tuple[Color, ...] = (STEEL, (0.88, 0.66, 0.42), (0.62, 0.76, 0.55))
HELP = "Drag to turn, wheel or pinch to zoom, Shift-drag or two fingers to move, "
HELP += "double-click for the first view."


def plot_3d(
    data: Any,
    *,
    color: str | int | ArrayLike | None = None,
    view: View = "oblique",
    unit: Unit = None,
    caption: str | None = None,
) -> Figure3D:
    """A figure that turns in a browser: one file, which asks nothing of a network.

    `save_figure` writes it as .html; a notebook shows it. Of more than 200,000 points a random part
    is shown, of more than 120,000 triangles a coarser surface; the page says so, and its `note`.

    Args:
        data: What to show, or a list of it: clouds, reachable sets, hulls or anything with vertices
            and faces, arms (as they are before activation), configurations, `AllEquilibria`.
        color: Of clouds, as in `plot_cloud`.
        view: At first, as in `plot_cloud`.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L if the data know one, else m.
        caption: Below the figure; None for what is shown.

    Raises:
        InvalidInput: Nothing of that, unknown view, color or unit, or nothing finite to show.
        MissingExtra: matplotlib is not installed, or scikit-image for the surface of a set.
    """
    things = list(data) if isinstance(data, list | tuple) else [data]
    kinds = [_kind(thing) for thing in things]
    view_angles(view)
    pairs = zip(kinds, things, strict=True)
    lengths = {_LENGTHS[kind](thing) for kind, thing in pairs if kind in _LENGTHS} - {None}
    shown_in = unit_for(lengths.pop() if len(lengths) == 1 else None, unit)
    scene = Scene(shown_in, color, kinds)
    scene.add(things)
    box = bounding_box(*scene.points())
    said = ". ".join(scene.captions) if caption is None else as_text("caption", caption)
    words = {"caption": said, "note": ". ".join([*scene.notes, HELP])}
    page = web_page(scene.parts, box, shown_in, keys=scene.keys, view=view, **words)
    return Figure3D(page, "; ".join(scene.notes))


class Detail(NamedTuple):
    """Fineness of surfaces on a page."""

    triangles: int = 120_000  # The most of a surface; so many take 1.4 MB of the page
    sides: int = 48  # Corners around an arm
    stations: int = 101  # Corners along one that is not activated


_DETAIL = Detail()


@dataclass
class Scene:
    """Parts of a page, with what explains them."""

    unit: LengthUnit
    color: Any = None
    kinds: Sequence[str] = ()
    detail: Detail = _DETAIL
    parts: list[PagePart] = field(default_factory=list)
    keys: list[Swatches | ColorScale] = field(default_factory=list)
    captions: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, things: Sequence[Any]) -> None:
        """Things to show, one after the other."""
        for thing in things:
            getattr(self, f"add_{_kind(thing)}")(thing)

    def points(self) -> list[ArrayLike]:
        """All places, one array for each part."""
        return [p.shape[0] for p in self.parts]

    def add_cloud(self, cloud: Dataset) -> None:
        """A cloud, of which a random part is enough."""
        tips, coloring = drawn_tips(cloud, self.unit), color_samples(cloud, self.color)
        chosen = np.flatnonzero(np.isfinite(tips).all(axis=1))
        of = f"{len(chosen):,}"
        self.captions.append(f"Cloud of {of} tips")
        self.notes.append(f"{of} points")
        if len(chosen) > _POINTS:
            chosen = np.sort(np.random.default_rng(0).choice(chosen, _POINTS, replace=False))
            self.notes[-1] = f"{_POINTS:,} of {of} points, at random"
        tips, rgb = tips[chosen], coloring.rgb[chosen]
        size = point_size(len(tips), np.array([tips.min(axis=0), tips.max(axis=0)]))
        self.parts.append(PagePart(self._name("cloud"), Dots(tips, rgb), size=size))
        self.keys += page_keys(coloring.key)

    def add_set(self, reached: Any) -> None:
        """A reachable set: its surface, or the points of a curve."""
        if word := _SIZES[reached.dimension]:
            value, error = getattr(reached, word), getattr(reached, f"{word}_error")
            size = self.unit.text(value, reached.dimension, error)
            self.captions.append(f"Reachable set: {word.removeprefix('curve_')} {size}")
        if reached.dimension > 1:
            self.add_surface(reached.sheets(), "reachable set")
            return
        points = self.unit.of(reached.mesh.vertices)
        size = 0.01 * float(self.unit.of(reached.arm.length))
        self.parts.append(PagePart(self._name("reachable set"), Dots(points), size=size))

    def add_hull(self, hull: Any) -> None:
        """A hull, whose volume is known."""
        kind = "convex hull" if np.isinf(hull.alpha) else "alpha shape"
        self.captions.append(f"{kind.capitalize()}: volume {self.unit.text(hull.volume, 3)}")
        self.add_surface(hull, kind)

    def add_surface(self, mesh: Any, word: str = "surface") -> None:
        """Triangles, fewer of them if they are many."""
        mesh = a_surface("data", mesh)
        vertices, faces = self.unit.of(mesh.vertices), np.asarray(mesh.faces)
        instead = f" instead of {len(faces):,}" if len(faces) > self.detail.triangles else ""
        if instead:
            vertices, faces = simplified(vertices, faces, self.detail.triangles)
        self.notes.append(f"{len(faces):,}{instead} triangles")
        name, number = self._name(word), sum(part.surface for part in self.parts)
        tint = _SURFACES[number % len(_SURFACES)]
        several = sum(kind in ("set", "hull", "surface") for kind in self.kinds) > 1
        opacity = _CLEAR if several or "cloud" in self.kinds else 1.0
        self.parts.append(PagePart(name, Skin(vertices, faces, tint), opacity, surface=True))
        if several:
            self.keys.append(Swatches([(name, css_color(tint))]))

    def add_arm(self, arm: Manipulator) -> None:
        """An arm before activation, pale beside configurations."""
        beside = "configuration" in self.kinds
        name = self._name("arm at rest" if beside else "arm")
        shape = rest_configuration(arm, self.detail.stations)
        self._add_body(arm, shape, name, _PALE if beside else 0.0)
        self._explain_bundles(arm)

    def add_configuration(self, configuration: Dataset) -> None:
        """The arm in one configuration or several."""
        arm, name = design_of(configuration), self._name("arm")
        for shape in shapes_of(configuration):
            self._add_body(arm, shape, name)
        self._explain_bundles(arm)

    def add_equilibria(self, equilibria: Any) -> None:
        """The arm in each; those that are unstable and lead nowhere as a line."""
        arm, shapes = equilibria.rod.arm, shapes_of(equilibria.configuration(_STATIONS))
        stable = equilibria.status == TipStatus.STABLE
        for k, shape in enumerate(shapes):
            if k == equilibria.followed:
                self._add_body(arm, shape, "posture" + ("" if stable[k] else ", unstable"))
            elif stable[k]:
                self._add_body(arm, shape, "other stable ones", _PALE)
            else:
                frame = shape["directors"].transpose("station", "director", "axis").values
                line = shape["position"].transpose("station", "axis").values
                tube = tube_surface(line, frame[:, 0], frame[:, 1], _LINE * arm.length, 8)
                self._add_skin("unstable ones", tube.vertices, tube.faces, _UNSTABLE)
        count = counted(len(shapes), "solution")
        self.captions.append(f"Equilibria: {count}, {int(stable.sum())} of them stable")
        self._explain_bundles(arm)

    def _add_body(self, arm: Manipulator, shape: Dataset, name: str, fade: float = 0.0) -> None:
        sides = self.detail.sides
        body, caps = arm_surface(arm, shape, sides), 2 * sides
        opacity = _BODY_CLEAR if any(inside(arm)) else 1.0
        for faces in (body.faces[:-caps], body.faces[-caps:]):  # so that light breaks at the rim
            vertices, faces = compact_surface(body.vertices, faces)
            self._add_skin(name, vertices, faces, _faded(BODY, fade), opacity)
        for index, skin in enumerate(bundle_skins(arm, shape, lift=0.01)):
            self._add_skin(name, skin.vertices, skin.faces, _faded(bundle_color(index), fade))
        if arm.markers:
            dots = Dots(self.unit.of(marker_points(arm.markers, shape)))
            size = _MARKER * float(self.unit.of(arm.length))
            self.parts.append(PagePart(name, dots, size=size, through=True))

    def _add_skin(
        self, name: str, vertices: Array, faces: Any, tint: Color, opacity: float = 1.0
    ) -> None:
        skin = Skin(self.unit.of(vertices), faces, tint)
        self.parts.append(PagePart(name, skin, opacity, through=True))

    def _explain_bundles(self, arm: Manipulator) -> None:
        key = Swatches([(x, css_color(bundle_color(k))) for k, x in enumerate(arm.bundle_names)])
        if "cloud" not in self.kinds and key not in self.keys:
            self.keys.append(key)

    def _name(self, word: str) -> str:
        number = 1 + len({p.name for p in self.parts if p.name.split(" #")[0] == word})
        return word if number == 1 else f"{word} #{number}"


_CLASSES = {"AllEquilibria": "equilibria", "ReachableSet": "set", "Hull": "hull"}
_LENGTHS = {
    "arm": attrgetter("length"),
    "set": attrgetter("arm.length"),
    "equilibria": attrgetter("rod.arm.length"),
    "cloud": lambda thing: thing["tip"].attrs.get("length"),
    "configuration": lambda thing: design_of(thing).length,
}
"""L [m] of the arm that a thing is of, by its kind."""


def _kind(thing: Any) -> str:
    """The kind of a thing to show, by its class, which need not be loaded, or by what it has."""
    bases = [base.__name__ for base in type(thing).__mro__]
    if isinstance(thing, Manipulator):
        return "arm"
    if known := [_CLASSES[name] for name in bases if name in _CLASSES]:
        return known[0]
    if "Dataset" in bases and "tip" in thing and "activation" in thing:
        a_cloud("data", thing)
        return "cloud"
    if "Dataset" in bases and "position" in thing and "design" in thing.attrs:
        a_configuration("data", thing)
        return "configuration"
    if not isinstance(thing, type) and hasattr(thing, "vertices") and hasattr(thing, "faces"):
        return "surface"
    allowed = "clouds, reachable sets, hulls, surfaces, arms, configurations or equilibria"
    raise InvalidInput("data", as_given(thing), allowed)


def page_keys(key: BundleKey | ScalarKey | None) -> list[Swatches | ColorScale]:
    """A key as pages have it: colors that stand for something each, and a scale of numbers."""
    marks = [(label, css_color(rgb)) for label, rgb in key_entries(key)]
    if not isinstance(key, ScalarKey):
        return [] if key is None else [Swatches(marks, key.title)]
    scale = color_map(key)
    colors = [css_color(rgb[:3]) for rgb in scale.cmap(np.linspace(0.0, 1.0, 17))]
    values = np.asarray(scale.norm.inverse(np.array([0.0, 0.5, 1.0])), float)
    low, middle, high = (f"{value:.3g}" for value in values)
    ends = (f"≤ {low}", middle, f"≥ {high}") if key.clipped else (low, middle, high)
    return [ColorScale(key.label, colors, ends), *([Swatches(marks)] if marks else [])]


def _faded(color: Color, fade: float) -> Color:
    red, green, blue = (channel + fade * (1.0 - channel) for channel in color)
    return red, green, blue
