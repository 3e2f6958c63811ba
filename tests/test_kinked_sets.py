"""Sets of maps with kinks, by laws: drives with dead zones, tendons that go slack."""

import itertools

import numpy as np
import pytest

from softreach.arm import (
    Chamber,
    FiberArchitecture,
    Loads,
    Manipulator,
    Material,
    Ring,
    Tendon,
)
from softreach.arm.actuators import LengthTendon
from softreach.arm.loads import PointLoad
from softreach.rod.rods import as_tip_map, effective, free_bundles, measured_bundles
from softreach.workspace import reachable_set, volume_gradient
from softreach.workspace.sheets import _zero
from tests.made_arms import antagonists, one_ring_arm

RUBBER = Material(young_modulus=1e6, poisson_ratio=0.5, density=1000.0)
RINGS = (Ring(inner_ratio=0.5, material=RUBBER),)
CHAMBER = Chamber(name="ch", distance=0.0, radius=0.003, activation_bounds=(0.0, 3e5))


def arm_of(*actuators, **changes) -> Manipulator:
    return one_ring_arm(*actuators, radius=0.01, rings=RINGS).replace(**changes)


def driven(bounds, dead_zone=0.0, offset=0.0, pairs=2, chamber=True) -> Manipulator:
    """Antagonistic pairs of tendons, and a chamber that lengthens the arm."""
    tendon = Tendon(distance=0.008, activation_bounds=(0.0, 5.0))
    places = range(0, 4, 3 - pairs)
    used = (tendon.replace(name=f"t{k}", offset=k * np.pi / 2) for k in places)
    ends = np.broadcast_to(bounds, (2, 2))
    acts = {"gain": 2.0, "dead_zone": dead_zone, "offset": offset}
    drives = tuple(
        antagonists(name, f"t{k}", f"t{k + 2}", bounds=tuple(ends[k]), **acts)
        for k, name in enumerate("xy"[:pairs])
    )
    return arm_of(*used, *([CHAMBER] if chamber else []), drives=drives)


def by_length(count: int, bounds, **numbers) -> Manipulator:
    tendon = LengthTendon(distance=0.008, activation_bounds=bounds, **numbers)
    turn = 2.0 * np.pi / count
    return arm_of(*(tendon.replace(name=f"l{k}", offset=k * turn) for k in range(count)))


@pytest.mark.parametrize("zone", [0.05, 0.3])
def test_a_dead_zone_leaves_the_set_of_the_arm_without_it(zone):
    kinked = reachable_set(driven((-1.0, 1.0), zone))
    plain = reachable_set(driven((-(1.0 - zone), 1.0 - zone)))
    assert kinked.dimension == 3
    assert kinked.volume == pytest.approx(plain.volume, rel=1e-9)
    assert kinked.volume_error < 1e-3 * kinked.volume
    known = {0.05: 2.40334903e-4, 0.3: 1.33132731e-4}[zone]  # composite Gauss rules, nine digits
    assert kinked.volume == pytest.approx(known, rel=1e-7)
    assert kinked.volume_error > abs(kinked.volume - known)


def test_drives_of_unequal_ranges_keep_what_lies_beyond_their_dead_zones():
    zone = 0.2
    kinked = reachable_set(driven(((-0.1, 1.0), (-0.7, 0.4)), zone))
    plain = reachable_set(driven(((0.0, 0.8), (-0.5, 0.2))))
    assert kinked.volume == pytest.approx(plain.volume, rel=1e-9)
    held = reachable_set(driven(((-0.1, 0.1), (-0.7, 0.4)), zone))
    assert held.dimension == 2  # the first drive never acts


@pytest.mark.parametrize("zone", [0.05, 0.3])
def test_lengths_and_areas_do_not_feel_a_dead_zone(zone):
    for pairs, size in ((1, "curve_length"), (2, "area")):
        kinked = reachable_set(driven((-1.0, 1.0), zone, pairs=pairs, chamber=False))
        plain = reachable_set(driven((zone - 1.0, 1.0 - zone), pairs=pairs, chamber=False))
        assert kinked.dimension == pairs
        value, error = getattr(kinked, size), getattr(kinked, f"{size}_error")
        assert value == pytest.approx(getattr(plain, size), rel=1e-9)
        assert error < 1e-4 * value
        if zone == 0.05:
            known = {"curve_length": 0.173324428, "area": 0.02930923}[size]
            assert value == pytest.approx(known, abs=error + 1e-8)


def test_derivatives_of_a_set_with_dead_zones_are_those_of_the_arm_without():
    found = volume_gradient(driven((-1.0, 1.0), 0.05), ["x.upper", "x.gain", "length"])
    known = np.array([1.21064e-4, 1.15010e-4, 3.946346e-3])  # differences of composite rules
    assert (np.abs(found.volume - known) < found.volume_error).all()
    assert (found.volume_error < 1e-2 * known).all()
    zone = volume_gradient(driven((-1.0, 1.0), 0.05), ["x.dead_zone"])
    plain = volume_gradient(driven((-0.95, 0.95)), ["x.lower", "x.upper"])
    both = plain.volume[0] - plain.volume[1]  # the range shrinks at both ends
    assert zone.volume[0] == pytest.approx(both, rel=1e-3)


@pytest.mark.large
def test_a_pretension_that_drives_use_up_adds_the_parts_between_the_kinks():
    # beyond |u| = offset / gain one tendon of the pair is slack: nine boxes without a kink inside
    whole = reachable_set(driven((-0.9, 0.9), offset=0.7))
    ends = [(-0.9, -0.35), (-0.35, 0.35), (0.35, 0.9)]
    parts = [reachable_set(driven(pair, offset=0.7)) for pair in itertools.product(ends, ends)]
    total = sum(part.volume for part in parts)
    error = whole.volume_error + sum(part.volume_error for part in parts)
    assert abs(whole.volume - total) < error < 5e-3 * total


def test_tendons_by_length_that_go_slack_sweep_what_composite_rules_say():
    found = reachable_set(by_length(3, (-0.01, 0.03), tendon_stiffness=500.0))
    assert abs(found.volume - 8.714575e-4) < found.volume_error < 2e-3 * found.volume


@pytest.mark.large
def test_four_tendons_by_length_reach_circular_arcs():
    found = reachable_set(by_length(4, (-0.01, 0.02)), accuracy=1e-2)
    assert abs(found.volume - 1.22166e-3) < found.volume_error < 1e-2 * found.volume


def test_a_tip_map_knows_whether_it_is_smooth_through_every_wrapper():
    kinked, slack = as_tip_map(driven((-1.0, 1.0), 0.1)), as_tip_map(by_length(3, (0, 0.02)))
    plain = as_tip_map(driven((-0.2, 0.2), offset=1.0))
    for rod, smooth in ((kinked, False), (plain, True), (slack, False)):
        placed = as_tip_map(rod.arm.replace(base=rod.arm.base.replace(points="down")))
        for each in (rod, placed, free_bundles(rod), measured_bundles(rod), effective(rod)):
            assert each.is_smooth == smooth, each
    taut = by_length(3, (0.0, 0.004), tendon_stiffness=500.0, pretension=10.0)
    assert as_tip_map(taut).is_smooth
    assert effective(plain) is plain
    beyond = effective(kinked)
    inputs = beyond.inputs.driving.with_dead_zones(np.array([[0.4, -0.3, 1e5], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(inputs, [[0.5, -0.4, 1e5], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(kinked.tips(inputs), beyond.tips([[0.4, -0.3, 1e5], [0] * 3]))


def test_sheets_are_cut_in_the_middle_where_nothing_tells_a_zero():
    zero = np.zeros(2)
    np.testing.assert_array_equal(_zero(zero, zero), [0.5, 0.5])
    assert _zero(np.array([1.0]), np.array([-3.0]))[0] == 0.25


def loaded(station: float, *others) -> Manipulator:
    lengths = by_length(3, (0.0, 0.03)).actuators
    load = PointLoad(station=station, moment=(0.0, 0.01, 0.0))
    loads = Loads(gravity=(0.0, 0.0, 0.0), point_loads=(load,))
    return arm_of(*lengths, *others, loads=loads)


def test_tips_move_evenly_with_the_place_where_a_moment_acts():
    pulled = [[0.02, 0.0, 0.0]]
    stations = np.linspace(0.138, 0.15, 7)  # the piece of integrals ends at the last
    tips = np.array([as_tip_map(loaded(z), 1e-8).tips(pulled)[0] for z in stations])
    assert np.abs(np.diff(tips, 4, axis=0)).max() < 1e-9  # jumps of 3e-4 m where a piece is cut


def test_a_fiber_given_by_its_angle_may_lie_beside_a_tendon_by_length_under_loads():
    bounds = {"extent": 0.5, "activation_bounds": (-0.1, 0.0)}
    straight = FiberArchitecture(helical_angle=0.0, **bounds)
    turned = FiberArchitecture(revolution=0.0, **bounds)
    rods = (as_tip_map(loaded(0.14, each)) for each in (straight, turned))
    one, other = (rod.tips([[0.02, 0, 0, -0.05]]) for rod in rods)
    np.testing.assert_allclose(one, other, atol=1e-9)
