"""Loads as they are typed, and what is computed of a loaded arm."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import softreach as sr
from softreach import schema
from softreach.arm import designs
from softreach.rod.tip_map import TipStatus, has_tip
from softreach.studio.captions import legend_text, size_text
from softreach.studio.reach import (
    Quality,
    Reach,
    Size,
    cloud_points,
    shown_samples,
    stages,
    unstable_samples,
)
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.tabs.loads import (
    GRAVITIES,
    TypedLoads,
    base_field,
    gravity_name,
    other_loads,
    typed_loads,
    with_loads,
)
from softreach.studio.work import affordable_level
from softreach.support.errors import InvalidDesign, InvalidInput

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)
HANGING = GRAVITIES["up"]


@pytest.fixture(scope="module")
def lce():
    return designs.lce_arm()


def hanging(arm, grams: float):
    return with_loads(arm, TypedLoads(gravity=HANGING, payload=grams))


def test_what_is_typed_is_what_the_design_has(lce):
    typed = TypedLoads((0.0, 1.0, -9.81), 2.5, (1.0, 0.0, -3.0), (0.0, 0.01, 0.0))
    arm = with_loads(lce, typed)
    assert arm.loads.payload == pytest.approx(0.0025)
    np.testing.assert_allclose(arm.loads.payload_arm, (0.001, 0, -0.003))
    assert typed_loads(arm) == typed
    assert typed_loads(lce) == TypedLoads()


def test_without_any_load_an_arm_is_an_arm_without_loads(lce):
    assert with_loads(lce, TypedLoads()) == lce
    assert with_loads(hanging(lce, 5.0), TypedLoads()) == lce


def test_directions_are_known_by_name(lce):
    for name, gravity in GRAVITIES.items():
        assert gravity_name(gravity) == name
        assert typed_loads(with_loads(lce, TypedLoads(gravity=gravity))).gravity == gravity
    assert gravity_name((0.0, 0.0, -1.62)) == ""


def test_place_and_turn_of_the_base_are_typed_in_mm_and_degrees_and_the_rest_of_it_stays(lce):
    state = StudioState(design=lce.replace(base=sr.Base(points="down", position=(1 / 3, 0, 0))))
    place, turn = base_field("position"), base_field("turn")
    assert place.write(state, place.read(state)).design.base.position == (1 / 3, 0, 0)
    moved = turn.write(place.write(state, (10.0, 0.0, 250.0)), -30.0)
    assert (place.read(moved), turn.read(moved)) == ((10.0, 0.0, 250.0), -30.0)
    base = sr.Base(points="down", position=(0.01, 0.0, 0.25), turn=math.radians(-30))
    assert moved.design.base == base
    assert moved.design.replace(base=state.design.base) == state.design
    with pytest.raises(InvalidDesign, match="position"):
        place.write(state, (0.0, math.nan, 0.0))


def test_loads_without_a_field_stay(lce):
    twisted = lce.replace(loads=sr.Loads(gravity=HANGING, tip_moment=(0.0, 0.0, 1e-4)))
    assert other_loads(twisted) == ["tip moment"]
    changed = with_loads(twisted, TypedLoads(gravity=(0.0, 0.0, 0.0)))
    assert changed.loads.tip_moment == (0.0, 0.0, 1e-4)
    assert other_loads(lce) == []


def test_matter_that_lacks_what_loads_need_is_named_in_one_line(trunk):
    with pytest.raises(InvalidDesign) as caught:
        with_loads(trunk, TypedLoads(gravity=HANGING))
    line = str(caught.value)
    assert "\n" not in line
    assert "Young's modulus E and the density ρ of ring 0" in line
    assert "tab Parts" in line


@pytest.mark.parametrize("wrong", [-1.0, 1e9, math.nan, math.inf])
def test_a_payload_that_cannot_be_is_refused_in_grams(lce, wrong):
    with pytest.raises(InvalidInput, match=r"payload = .* g: must be 0 to 1,000,000 g"):
        hanging(lce, wrong)


@pytest.mark.parametrize("field", ["gravity", "payload_arm", "tip_force"])
@pytest.mark.parametrize("wrong", [1e9, -1e9, math.nan])
def test_a_vector_that_cannot_be_is_refused(lce, field, wrong):
    typed = TypedLoads()._replace(**{field: (0.0, wrong, 0.0)})
    with pytest.raises(InvalidInput, match=r"must be -1,000,000 to 1,000,000"):
        with_loads(lce, typed)


def test_a_state_keeps_its_loads(lce):
    state = StudioState(design=hanging(lce, 5.0))
    assert StudioState.from_json(state.to_json()) == state


def test_a_loaded_cloud_comes_before_its_volume(lce):
    first, second, fine = stages(hanging(lce, 5.0), 11, SMALL, lambda: None)
    assert (first.exact, first.fine, first.size) == (None, False, None)
    assert second.exact is not None
    assert fine.fine
    np.testing.assert_array_equal(first.cloud.tip, fine.cloud.tip[: first.samples])
    np.testing.assert_allclose(fine.volume, second.volume, rtol=0.01)


@pytest.fixture(scope="module")
def torn(lce) -> Reach:
    """With 30 g a few activations have no equilibrium."""
    *_, fine = stages(hanging(lce, 30.0), 13, SMALL, lambda: None)
    return fine


def test_samples_are_counted_by_status_and_those_without_a_tip_are_not_shown(torn):
    shares = [torn.share(status) for status in TipStatus]
    assert sum(shares) == pytest.approx(1.0)
    assert shares[TipStatus.STABLE] > 0.98
    assert shares[TipStatus.NO_EQUILIBRIUM] > 0
    points = cloud_points(torn, 13)
    assert np.isfinite(points).all()
    assert len(points) == has_tip(torn.status).sum()


def test_unstable_samples_are_those_of_the_cloud_that_are_shown(torn):
    """Random activations are hardly ever as symmetric as one that is unstable: some are marked."""
    status = np.where(np.arange(torn.samples) % 7 == 0, TipStatus.UNSTABLE, torn.status)
    marked = replace(torn, cloud=schema.with_status(torn.cloud, status.astype(np.int8)))
    shown = shown_samples(marked, 9)
    unstable = unstable_samples(marked, 9)
    assert 0 < unstable.sum() == (status[shown] == TipStatus.UNSTABLE).sum()
    text = "".join(str(part) for part in legend_text(marked, free=False))
    assert f"unstable: {100 * (status == TipStatus.UNSTABLE).mean():.2g} % of the samples" in text


@pytest.mark.filterwarnings("ignore:the load number is above")
def test_an_arm_loaded_beyond_what_can_be_computed_is_refused_and_remembered(lce):
    heavy = hanging(lce, 1000.0)
    for _ in range(2):
        with pytest.raises(InvalidInput, match="loads = too large"):
            solvable_rod(heavy)
    with pytest.raises(InvalidInput, match="loads = too large"):
        next(stages(heavy, 12, SMALL, lambda: None))


def test_a_cloud_has_no_more_samples_than_there_is_time_for(lce):
    rod = solvable_rod(hanging(lce, 5.0))
    assert affordable_level(rod, 1e6, 12) == 12
    assert affordable_level(rod, 0.0, 17) == 10
    hasty = Quality(coarse_level=12, fine_seconds=0.0, coarse_accuracy=0.1, fine_accuracy=0.1)
    *_, fine = stages(rod.arm, 14, hasty, lambda: None)
    assert (fine.samples, fine.wanted) == (1 << 10, 1 << 14)


@pytest.mark.parametrize(
    ("error", "text"),
    [(9e-5, "volume 0.25642 ± 0.00009 m³"), (4e-9, "volume 0.256423 ± 0.000001 m³")],
)
def test_digits_of_a_size_follow_its_error(error, text):
    assert size_text(Size("volume", 0.2564231, error, 3), designs.minimal_trunk()) == text
