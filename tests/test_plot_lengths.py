"""One law for all figures: what an axis says it counts in is what it counts in, at L = 0.3 m."""

import re
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

import softreach as sr
from softreach import plot
from softreach.arm.skin import arm_surface
from softreach.cloud.redundancy import activation_distance
from softreach.picture.projection import project, view_axes
from softreach.rod.kinematics import rest_configuration
from softreach.support.errors import InvalidInput

plt = pytest.importorskip("matplotlib.pyplot")
LENGTH = 0.3
OBLIQUE = "oblique"

Shown = tuple[str, object, object]
"""A label, the numbers drawn beside it, and what they show in powers of m."""


def si(label: str, numbers: object) -> np.ndarray:
    """Numbers on an axis in powers of m, as its label says: "x / L", "V [m³]", "0.1 L", "κL"."""
    numbers = np.asarray(numbers, float)
    if label in ("κL", "u₃L"):
        return numbers / LENGTH
    if label == "" or "[1/m]" in label:
        return numbers
    said = re.search(r"(/ L|\[m|\d L$|\d m$)(³?)", label)
    assert said, f"{label!r} does not say what it counts in"
    return numbers * (LENGTH if "L" in said[1] else 1.0) ** (3 if said[2] else 1)


def ends(values: object) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))


def plane(ax, points) -> Iterator[Shown]:
    """Both axes of a panel that looks along an axis."""
    for label, limits in ((ax.get_xlabel(), ax.get_xlim()), (ax.get_ylabel(), ax.get_ylim())):
        if label:  # columns share the one at the left
            name = label.split("\n")[-1]
            yield name, limits, points[:, "xyz".index(name[0])]


def space(ax, points, view=OBLIQUE) -> Iterator[Shown]:
    """A box in space: its three labels, each for what the image shows."""
    labels = [text.get_text() for text in ax.texts if text.get_text()[0] in "xyz"]
    assert [label[0] for label in labels] == list("xyz")
    seen = project(points, view)
    for label in labels:
        yield label, ax.get_xlim(), seen[:, 0]
        yield label, ax.get_ylim(), seen[:, 1]


def image_axes(figure) -> list:
    return [ax for ax in figure.axes if ax.images]


@pytest.fixture(scope="module")
def everything(tmp_path_factory) -> SimpleNamespace:
    """Data of arms of that length: clouds, shapes, sets, hulls, statistics, an atlas."""
    arm = sr.designs.minimal_trunk(length=LENGTH)
    cloud = sr.compute_cloud(arm, n=3000, seed=1)
    space = sr.DesignSpace.grid(arm, length=[LENGTH, 2 * LENGTH], taper=np.radians([0.0, 1.0]))
    store = tmp_path_factory.mktemp("lengths") / "atlas.zarr"
    metrics = ("extent", "concave")
    atlas = sr.build_atlas(space, store, n=500, metrics=metrics, alpha_over_length=0.5)
    return SimpleNamespace(
        known=True,
        length=LENGTH,
        arm=arm,
        cloud=cloud,
        tips=cloud.tip.values,
        rest=arm_surface(arm, rest_configuration(arm)).vertices,
        distance=activation_distance(cloud, LENGTH / 10),
        grid=sr.reachable_set(arm, accuracy=3e-2).grid,
        hull=sr.convex_hull(cloud.tip),
        curvature=sr.curvature.curvature_statistics(cloud),
        atlas=atlas,
    )


@pytest.fixture
def ignorant(everything) -> SimpleNamespace:
    """The same data without the length of the arm."""
    found = SimpleNamespace(**vars(everything))
    found.known, found.length = False, None
    found.cloud = everything.cloud.copy(deep=True)
    del found.cloud.tip.attrs["length"]
    for name in ("grid", "curvature"):
        data = getattr(everything, name).copy()
        data.attrs = {k: v for k, v in data.attrs.items() if k != "length"}
        setattr(found, name, data)
    return found


def plot_cloud(of):
    yield from plane(plot.plot_cloud(of.cloud, view="back"), of.tips)
    yield from space(plot.plot_cloud(of.cloud, view=OBLIQUE), of.tips)
    box = np.array([of.tips.min(axis=0), of.tips.max(axis=0)])
    yield from plane(plot.plot_cloud(of.cloud, view="top", box=box), of.tips)


def plot_slab(of):
    ax = plot.plot_slab(of.cloud, view="side", at=0.03, thickness=0.05)
    yield from plane(ax, of.tips)
    note = ax.texts[-1].get_text()
    middle, half = re.findall(r"[\d.]+ [Lm]", note)
    yield middle, (0, float(middle[:-2])), (0, 0.03)
    yield half, (0, float(half[:-2])), (0, 0.025)


def plot_distance(of):
    tips = of.tips[of.distance.sample]
    yield from plane(plot.plot_distance(of.cloud, of.distance, view="left"), tips)


def plot_redundancy(of):
    figure = plot.plot_redundancy({"one": of.cloud}, {"one": of.distance}, thickness=0.05)
    for ax in image_axes(figure):
        yield from plane(ax, of.tips)


def plot_views(of):
    arm = of.arm if of.known else None
    *planes, oblique = image_axes(plot.plot_views(of.cloud, arm))
    for ax in planes:
        yield from plane(ax, of.tips)
    yield from space(oblique, of.tips)


def plot_slice(of):
    ax = plot.plot_slice(of.grid, view="top", at=0.1)
    half = of.grid.cell / 2
    for label, limits in ((ax.get_xlabel(), ax.get_xlim()), (ax.get_ylabel(), ax.get_ylim())):
        centers = of.grid[label[0]].values
        yield label, limits, (centers[0] - half, centers[-1] + half)
    title = ax.get_title()
    yield title, (0, float(re.search(r"[\d.]+", title)[0])), (0, 0.1)


def plot_slices(of):
    for ax in image_axes(plot.plot_slices(of.grid, at=(0.01, 0.0, 0.1))):
        points = np.stack(np.broadcast_arrays(*np.ix_(*(ends(of.grid[a]) for a in "xyz"))), -1)
        yield from plane(ax, points.reshape(-1, 3))


def plot_hull(of):
    yield from plane(plot.plot_hull(of.hull, length=of.length), of.hull.vertices)
    yield from space(plot.plot_hull(of.hull, length=of.length, view=OBLIQUE), of.hull.vertices)


def plot_curvature(of):
    for quantity in ("bending", "torsion"):
        ax = plot.plot_curvature({"one": of.curvature}, quantity=quantity)
        places = [float(text.get_text()) for text in ax.get_xticklabels()]
        yield ax.get_xlabel(), places, of.curvature.Z
        medians = of.curvature[f"{quantity}_quantile"].sel(quantile=0.5)
        yield ax.get_ylabel(), ax.lines[-1].get_ydata(), medians


# From here on data always know the length, as they hold the arm.


def plot_arm(of):
    yield from plane(plot.plot_arm(of.arm, view="side"), of.rest)
    yield from space(plot.plot_arm(of.arm, view=OBLIQUE), of.rest)


def checked(of):
    """The arm at rest, inside a box around it, and that box."""
    needs = sr.requirements
    box = needs.Box(*(of.rest.min(axis=0) - 0.01, of.rest.max(axis=0) + 0.01))
    target = needs.Target([0.0, 0.0, LENGTH])
    return sr.check(of.arm, sr.Requirements(targets=[target], keeps=[needs.Keep(box, True)])), box


def plot_check(of):
    check, box = checked(of)
    yield from plane(plot.plot_check(check, view="side", unit="L"), box.bounds)
    yield from space(plot.plot_check(check, unit="L"), box.bounds)


def plot_equilibria(of):
    ax = plot.plot_equilibria(sr.equilibria(of.arm, [0.0, 0.0, 0.0]), view="side")
    yield "z / L", ax.get_ylim(), of.rest[:, 2]


def plot_cross_section(of):
    radius = float(of.arm.profile.radius(0.1))
    circle = np.outer([-1, 1], [radius] * 3)
    yield from plane(plot.plot_cross_section(of.arm, 0.1), circle)
    yield from plane(plot.plot_cross_section(of.arm, 0.1, half_width=1.1 * radius), circle)


def plot_designs(of):
    long = sr.designs.minimal_trunk(length=2 * LENGTH)
    panels = [plot.DesignPanel("a", of.arm), plot.DesignPanel("b", long)]
    arm, _, section, _ = plot.plot_designs(panels).axes
    yield from plane(arm, of.rest)
    circle = np.outer([-1, 1], [float(of.arm.profile.radius(0.0))] * 3)
    yield from plane(section, circle)


def plot_opposite_sides(of):
    view = (0.3, 0.2)
    above, below = image_axes(plot.plot_opposite_sides({"one": of.cloud}, view=view))
    yield from space(above, of.tips, view)
    yield from space(below, of.tips, (0.3 + np.pi, 0.2))


def sheet(of, draw) -> Iterator[Shown]:
    """Panels of one design, of the length LENGTH, and the bar of half a length in the margin."""
    figure = draw(of.atlas.isel(length=[0], taper=[0]))
    (panel,) = image_axes(figure)
    at = {"length": LENGTH, "taper": 0.0}
    seen = project(sr.atlas.atlas_cloud(of.atlas, **at).tip.values, OBLIQUE)
    yield "x / L", panel.get_xlim(), seen[:, 0]
    yield "y / L", panel.get_ylim(), seen[:, 1]
    margin = figure.axes[-1]
    (bar,) = margin.lines
    assert margin.texts[0].get_text() == "L/2"
    ends = bar.get_xdata()
    ends = np.clip(ends, *margin.get_xlim()) if bar.get_clip_on() else ends  # as far as it shows
    inches = np.ptp(ends) / np.ptp(margin.get_xlim()) * margin.get_position().width
    drawn = inches / panel.get_position().width * np.ptp(panel.get_xlim())
    yield "x / L", (0, drawn), (0, LENGTH / 2)


def plot_cloud_sheet(of):
    yield from sheet(of, plot.plot_cloud_sheet)


def plot_hull_sheet(of):
    yield from sheet(of, plot.plot_hull_sheet)


def plot_metric_map(of):
    atlas = of.atlas
    ax = plot.plot_metric_map(atlas, "reach_height")
    bar = ax.figure.axes[-1]
    # every design in its own length, of which there are two
    yield bar.get_ylabel(), bar.get_ylim(), atlas.reach_height * LENGTH / atlas.length
    assert ax.get_xlabel() == "L (m)"
    yield "", ax.get_xlim(), atlas.length


CASES = {name: case for name, case in globals().items() if name.startswith("plot_")}
"""Each figure, drawn with data that know L."""
MAY_NOT_KNOW = [*CASES][: [*CASES].index("plot_arm")]  # and with data that do not


def test_every_figure_of_the_product_is_held_to_this():
    # Without lengths; held to this in test_figure_3d.py and in test_outputs.py of both folders.
    others = {"plot_payload_curve", "plot_3d", "plot_calibration", "plot_search"}
    drawn = {name for name in plot.__all__ if name.startswith("plot_")}
    assert set(CASES) == drawn - others


@pytest.mark.parametrize("name", CASES)
def test_axes_count_in_what_they_say_where_data_know_the_length(name, everything):
    check(CASES[name](everything))
    assert not any("[m" in text for text in texts())


@pytest.mark.parametrize("name", MAY_NOT_KNOW)
def test_axes_count_in_meters_where_data_do_not_know_the_length(name, ignorant):
    check(CASES[name](ignorant))
    assert not any(re.search(r"/ L|\dL|\d L\b|κL", text) for text in texts())


def check(shown: Iterator[Shown]) -> None:
    count = 0
    for label, drawn, data in shown:
        low, high = ends(si(label, drawn))
        first, last = ends(data)
        slack = 2e-2 * (last - first)  # notes and ticks are rounded
        assert low <= first + slack
        assert last - slack <= high
        assert last - first > 0.4 * (high - low)  # a third, L, is not between
        count += 1
    assert count


def texts() -> list[str]:
    from matplotlib.text import Text

    figures = map(plt.figure, plt.get_fignums())
    return [text.get_text() for figure in figures for text in figure.findobj(Text)]


def test_a_check_is_drawn_in_the_unit_that_its_design_is_shown_in(everything):
    plt.close("all")
    ax = plot.plot_check(checked(everything)[0], view="side")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y [mm]", "z [mm]")
    assert ax.get_ylim()[1] > 1e3 * LENGTH
    assert not any(re.search(r"\bL\b", text) for text in texts())


def test_numbers_along_a_box_stand_where_they_say(everything):
    ax = plot.plot_cloud(everything.cloud, view=OBLIQUE)
    axis, ticks = 0, []
    for text in ax.texts:
        if text.get_text()[0] in "xyz":
            values = np.array([float(t.get_text().replace("\N{MINUS SIGN}", "-")) for t in ticks])
            places = np.array([t.xy for t in ticks])
            step = np.diff(places, axis=0)
            wanted = np.outer(np.diff(values), view_axes(OBLIQUE)[:2, axis])
            np.testing.assert_allclose(step, wanted, atol=1e-9)
            axis, ticks = axis + 1, []
        else:
            ticks.append(text)
    assert axis == 3


def test_data_in_meters_do_not_go_over_data_in_lengths(everything):
    ax = plot.plot_cloud(everything.cloud)
    with pytest.raises(InvalidInput, match="ax = counted in L: must be in m"):
        plot.plot_hull(everything.hull, ax=ax)
    plot.plot_hull(everything.hull, ax=ax, length=LENGTH)
    assert ax.get_xlabel() == "x / L"


def test_rows_take_no_mixture_of_lengths_and_stations(everything, ignorant):
    both = {"a": everything.cloud, "b": ignorant.cloud}
    distances = dict.fromkeys(both, everything.distance)
    with pytest.raises(InvalidInput, match="some with and some without"):
        plot.plot_redundancy(both, distances)
    with pytest.raises(InvalidInput, match="some with and some without"):
        plot.plot_views(ignorant.cloud, everything.arm)
    other = sr.curvature.curvature_statistics(everything.cloud, [0.1, 0.2])
    with pytest.raises(InvalidInput, match="stations"):
        plot.plot_curvature({"a": everything.curvature, "b": other})


def test_boxes_and_points_of_another_shape_are_refused(everything):
    with pytest.raises(InvalidInput, match="a lower and an upper corner"):
        plot.plot_cloud(everything.cloud, box=[[0, 0, 0], [1, 1, 0]])
    with pytest.raises(InvalidInput, match=r"a point \(x, y, z\)"):
        plot.plot_slices(everything.grid, at=(0.0, 0.0))
    with pytest.raises(InvalidInput, match=r"at = 1\.0: must be between"):
        plot.plot_slice(everything.grid, at=1.0)


def test_slices_go_through_the_middle_of_the_set_unless_a_place_is_given(everything):
    z = everything.grid.z.values
    away = everything.grid.assign_coords(z=z + 9.0)  # misses the plane z = 0
    reached = away.z.values[(away["count"] > 0).any(["x", "y"])]
    middle = (reached[0] + reached[-1]) / 2
    title = plot.plot_slice(away, view="top").get_title()
    assert float(title.split()[2]) == pytest.approx(middle / everything.length, rel=1e-2)
    assert plot.plot_slices(away).axes[2].get_title() == title
    with pytest.raises(InvalidInput, match="along z"):
        plot.plot_slices(away, at=(0.0, 0.0, 0.0))


def test_a_single_row_of_designs_is_drawn_as_cells_and_an_empty_atlas_stays_white(everything):
    row = everything.atlas.isel(length=[0])
    (cells,) = plot.plot_metric_map(row, "reach_height").collections
    np.testing.assert_allclose(np.ravel(cells.get_array()), row.reach_height[0] / LENGTH)
    nothing = everything.atlas.assign(reach_height=np.nan * everything.atlas.reach_height)
    (cells,) = plot.plot_metric_map(nothing, "reach_height").collections
    assert cells.get_array().mask.all()
