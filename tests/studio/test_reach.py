"""What a design can reach, coarse and fine, and how points are colored, thinned, cut and picked."""

import math
from dataclasses import replace

import numpy as np
import pytest

import softreach as sr
from softreach import schema
from softreach.arm import designs
from softreach.arm.loads import GRAVITIES, Loads
from softreach.picture.gltf import ColoredSkin
from softreach.plot.coloring import BundleKey, ScalarKey
from softreach.rod.tip_map import TipStatus, has_tip
from softreach.studio import reach as reaching
from softreach.studio.captions import legend_text, size_text
from softreach.studio.reach import Quality, Reach, shown_samples, stages
from softreach.studio.scene import colors
from softreach.studio.scene.scene import Scene, in_slice, sliced
from softreach.studio.state import Appearance, Slice, StudioState, solvable_rod
from softreach.studio.tabs import design
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.studio.test_scene import Meshes

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)


@pytest.fixture(scope="module")
def both(trunk) -> list[Reach]:
    return list(stages(trunk, 11, SMALL, lambda: None))


def test_the_coarse_cloud_is_the_beginning_of_the_fine_one_which_has_what_is_shown(both, trunk):
    coarse, fine = both
    assert (coarse.fine, fine.fine) == (False, True)
    assert (coarse.samples, fine.samples) == (1 << 10, 1 << 12)
    np.testing.assert_array_equal(coarse.cloud.tip, fine.cloud.tip[: coarse.samples])
    assert coarse.volume == pytest.approx(fine.volume, rel=0.02)
    *_, shown = stages(trunk, 14, SMALL, lambda: None)
    assert shown.samples == 1 << 14


def test_every_color_that_is_offered_colors_every_point_that_is_shown(both):
    fine = both[1]
    for color in colors.color_names(fine.arm):
        coloring = colors.sample_colors(fine, 10, color)
        assert coloring.rgb.shape == (1 << 10, 3)
        assert "url(" not in colors.key_html(coloring.key)
    multiplicity = colors.sample_colors(fine, 10, "multiplicity").key
    assert isinstance(multiplicity, BundleKey)
    assert multiplicity.names[0].startswith("1: ")
    names = colors.color_names(designs.redundant_trunk())
    assert "multiplicity" not in names  # where it is not finite
    unknown, plain = (colors.sample_colors(fine, 10, color).rgb for color in ("bundle 9", "rgb"))
    np.testing.assert_array_equal(unknown, plain)


def test_a_slice_shows_what_lies_within_its_thickness(rng):
    points = rng.uniform(-1, 1, (1000, 3))
    assert in_slice(points, Slice()).all()
    kept = in_slice(points, Slice(axis="y", center=0.2, thickness=0.3))
    np.testing.assert_array_equal(kept, np.abs(points[:, 1] - 0.2) <= 0.15)


def test_a_slice_cuts_a_surface_at_its_planes_and_its_colors_with_it():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 3.0]])
    skin = ColoredSkin(vertices, np.array([[0, 1, 2], [0, 1, 3]]), 100.0 * vertices)
    cut = Slice(axis="z", center=0.25, thickness=0.5)
    part = sliced(skin, cut)
    corners = part.vertices[part.faces]
    assert corners[..., 2].min() == 0.0
    assert corners[..., 2].max() == pytest.approx(0.5)
    area = np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1).sum() / 2
    assert area == pytest.approx(0.5 + 1.5 * (1 - (5 / 6) ** 2))
    np.testing.assert_allclose(part.colors, 100 * part.vertices)
    assert sliced(skin, Slice()) is skin


def test_a_surface_is_colored_by_its_own_activations_with_the_key_of_that_color(both):
    reach = both[1]
    effort = colors.surface_colors(reach, "effort")
    assert isinstance(effort.key, ScalarKey)
    pulls = np.abs(reach.sheets.activation / reach.arm.bounds[:, 0]).mean(axis=1)
    brightest = np.all(effort.rgb == effort.rgb[pulls.argmax()], axis=1)
    assert pulls[brightest].min() > pulls.max() - 0.01
    multiplicity = colors.surface_colors(reach, "multiplicity").key
    assert isinstance(multiplicity, BundleKey)
    assert multiplicity.names[0] == "1"
    *_, four = stages(designs.redundant_trunk(), 11, SMALL, lambda: None)
    for each in (reach, four):
        for color in colors.color_names(each.arm):
            assert colors.surface_colors(each, color).rgb.shape == each.sheets.vertices.shape


def test_samples_without_a_tip_tell_nothing_of_a_boundary():
    *_, reach = stages(designs.redundant_trunk(), 11, SMALL, lambda: None)
    lost = np.arange(reach.samples) % 3 == 0
    status = np.where(lost, TipStatus.NO_EQUILIBRIUM, TipStatus.STABLE).astype(np.int8)
    marked = replace(reach, cloud=schema.with_status(reach.cloud, status))
    others = replace(reach, cloud=reach.cloud.isel(sample=~lost))
    wanted = others.boundary.cloud.activation.values
    np.testing.assert_array_equal(marked.boundary.cloud.activation.values, wanted)


# Loads as they are typed, and what is computed of a loaded arm

HANGING = GRAVITIES["up"]
LOADS = ("gravity", "payload", "payload_arm", "tip_force")
NOTHING = dict.fromkeys(LOADS, (0.0, 0.0, 0.0)) | {"payload": 0.0}


@pytest.fixture(scope="module")
def lce():
    return designs.lce_arm()


def loaded(arm, **typed):
    """The arm under loads that are typed one after another."""
    state = StudioState(design=arm)
    for name, value in typed.items():
        state = design.load_field(name).write(state, value)
    return state.design


def typed_loads(arm):
    return {name: design.load_field(name).read(StudioState(design=arm)) for name in LOADS}


def hanging(arm, grams: float):
    return loaded(arm, gravity=HANGING, payload=grams)


def test_what_is_typed_is_what_the_design_has(lce):
    values = (0.0, 1.0, -9.81), 2.5, (1.0, 0.0, -3.0), (0.0, 0.01, 0.0)
    typed = dict(zip(LOADS, values, strict=True))
    arm = loaded(lce, **typed)
    assert arm.loads.payload == pytest.approx(0.0025)
    np.testing.assert_allclose(arm.loads.payload_arm, (0.001, 0, -0.003))
    assert typed_loads(arm) == typed
    assert typed_loads(lce) == NOTHING
    assert loaded(lce, **NOTHING) == lce
    assert loaded(hanging(lce, 5.0), **NOTHING) == lce


def test_directions_are_known_by_name(lce):
    for name, gravity in (GRAVITIES | {"": (0.0, 0.0, -1.62)}).items():
        arm = loaded(lce, gravity=gravity)
        assert design.gravity_name(StudioState(design=arm)) == name
        assert typed_loads(arm)["gravity"] == gravity


def test_place_and_turn_of_the_base_are_typed_in_mm_and_degrees_and_the_rest_of_it_stays(lce):
    state = StudioState(design=lce.replace(base=sr.Base(points="down", position=(1 / 3, 0, 0))))
    place, turn = design.base_field("position"), design.base_field("turn")
    moved = turn.write(place.write(state, (10.0, 0.0, 250.0)), -30.0)
    assert (place.read(moved), turn.read(moved)) == ((10.0, 0.0, 250.0), -30.0)
    base = sr.Base(points="down", position=(0.01, 0.0, 0.25), turn=math.radians(-30))
    assert moved.design.base == base
    assert moved.design.replace(base=state.design.base) == state.design
    with pytest.raises(InvalidDesign, match="position"):
        place.write(state, (0.0, math.nan, 0.0))


def test_loads_without_a_field_stay(lce):
    twisted = lce.replace(loads=sr.Loads(gravity=HANGING, tip_moment=(0.0, 0.0, 1e-4)))
    changed = loaded(twisted, gravity=(0.0, 0.0, 0.0))
    assert changed.loads.tip_moment == (0.0, 0.0, 1e-4)


def test_matter_that_lacks_what_loads_need_is_named_in_one_line(trunk):
    line = r"^.*the modulus and the density of ring 0.*tab Parts.*\Z"
    with pytest.raises(InvalidDesign, match=line):
        loaded(trunk, gravity=HANGING)


@pytest.mark.parametrize("wrong", [-1e9, 1e9, math.nan, math.inf])
def test_loads_that_cannot_be_are_refused_in_their_unit(lce, wrong):
    for grams in (wrong, -1.0):
        with pytest.raises(InvalidInput, match=r"payload = .* g: must be 0 to 1,000,000 g"):
            hanging(lce, grams)
    for name in ("gravity", "payload_arm", "tip_force"):
        with pytest.raises(InvalidInput, match=r"must be -1,000,000 to 1,000,000"):
            loaded(lce, **{name: (0.0, wrong, 0.0)})


def test_a_loaded_cloud_comes_before_its_volume(lce):
    first, second, fine = stages(hanging(lce, 5.0), 11, SMALL, lambda: None)
    assert (first.exact, first.fine, first.size) == (None, False, None)
    assert second.exact is not None
    assert fine.fine
    np.testing.assert_array_equal(first.cloud.tip, fine.cloud.tip[: first.samples])
    np.testing.assert_allclose(fine.volume, second.volume, rtol=0.01)


@pytest.fixture(scope="module")
def torn(lce) -> Reach:
    """Held aside with 5 g it snaps at a few activations."""
    aside = lce.replace(loads=Loads(gravity=(9.81, 0.0, 0.0), payload=0.005))
    *_, fine = stages(aside, 13, SMALL, lambda: None)
    return fine


def test_samples_are_counted_by_status_and_those_without_a_tip_are_not_shown(torn):
    shares = [torn.share(status) for status in TipStatus]
    assert sum(shares) == pytest.approx(1.0)
    assert shares[TipStatus.STABLE] > 0.98
    assert shares[TipStatus.SNAPS] > 0
    points = reaching.cloud_points(torn, 13)
    assert np.isfinite(points).all()
    assert len(points) == has_tip(torn.status).sum()


def test_unstable_samples_are_those_of_the_cloud_that_are_shown(torn):
    """Random activations are hardly ever as symmetric as one that is unstable: some are marked."""
    status = np.where(np.arange(torn.samples) % 7 == 0, TipStatus.UNSTABLE, torn.status)
    marked = replace(torn, cloud=schema.with_status(torn.cloud, status.astype(np.int8)))
    meshes, shown = Meshes(), shown_samples(marked, 12)
    Scene(meshes).draw_cloud(marked, Appearance(level=12, cloud=True))
    drawn = len(meshes.added["/unstable"].points)
    assert 0 < drawn == (status[shown] == TipStatus.UNSTABLE).sum()
    text = "".join(str(part) for part in legend_text(marked, free=False))
    assert f"unstable: {100 * (status == TipStatus.UNSTABLE).mean():.2g} % of the samples" in text


@pytest.mark.filterwarnings("ignore:the load number is above")
def test_an_arm_loaded_beyond_what_can_be_computed_is_refused_and_remembered(lce):
    heavy = hanging(lce, 1e6)
    for _ in range(2):
        with pytest.raises(InvalidInput, match="loads = too large"):
            solvable_rod(heavy)
    with pytest.raises(InvalidInput, match="loads = too large"):
        next(stages(heavy, 12, SMALL, lambda: None))


def test_a_cloud_has_no_more_samples_than_there_is_time_for(lce):
    rod = solvable_rod(hanging(lce, 5.0))
    assert reaching.affordable_level(rod, 1e6, 12) == 12
    assert reaching.affordable_level(rod, 0.0, 17) == 10
    hasty = Quality(coarse_level=12, fine_seconds=0.0, coarse_accuracy=0.1, fine_accuracy=0.1)
    *_, fine = stages(rod.arm, 14, hasty, lambda: None)
    assert (fine.samples, fine.wanted) == (1 << 10, 1 << 14)


def test_digits_of_a_size_follow_its_error(trunk):
    for error, text in ((9e-5, "0.25642 ± 0.00009"), (4e-9, "0.256423 ± 0.000001")):
        assert size_text(reaching.Size("volume", 0.2564231, error, 3), trunk) == f"volume {text} m³"
