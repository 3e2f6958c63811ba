"""Thin shells, which slender tendon robots reach: volumes, corners, hulls, thickness."""

import itertools

import numpy as np
import pytest

from softreach.arm import (
    Drive,
    LinearTaper,
    Loads,
    Manipulator,
    Material,
    Ring,
    Section,
    Tendon,
    designs,
)
from softreach.cli.app import run
from softreach.inverse import solve_inverse
from softreach.inverse.solutions import Status
from softreach.rod.rods import as_tip_map
from softreach.support.errors import NotPossible
from softreach.workspace import ReachableSet, reachable_set, volume_gradient
from softreach.workspace.cells import cells_of
from tests.sets import is_closed, solid, tips_of_faces
from tests.test_kinked_sets import arm_of


def two_segments() -> Manipulator:
    """Six tendons on a thin backbone of nitinol: a shell of two millimeters."""
    niti = Material(young_modulus=60e9, poisson_ratio=0.33, density=6450.0)
    far = Tendon(name="dist", bundles=3, distance=0.007, activation_bounds=(0, 40))
    far = far.replace(offset=np.radians(150))
    near = far.replace(name="prox", offset=np.radians(90), end="mid")
    return Manipulator(
        profile=LinearTaper(length=0.2, outer_radius=0.001),
        section=Section(rings=(Ring(inner_ratio=0.0, material=niti),)),
        stations={"mid": 0.1},
        actuators=(near, far),
    )


def corners(found: ReachableSet) -> np.ndarray:
    box = found.tip_map.box
    return np.array(list(itertools.product([0.0, 1.0], repeat=box.dimension)))


@pytest.fixture(scope="module", params=[0.05, 0.01])
def shell(request) -> ReachableSet:
    found = reachable_set(two_segments(), accuracy=request.param)
    assert found.dimension == 3
    return found


def test_a_shell_has_its_volume_at_every_accuracy(shell):
    # 309.47 and 309.54 mL on 54 and 81 cells along the mean side
    assert abs(shell.volume - 309.5e-6) < shell.volume_error + 0.1e-6
    assert shell.volume_error < 0.05 * shell.volume


def test_the_mesh_of_a_shell_holds_all_corners_and_is_closed(shell):
    mesh, box = shell.surface(), shell.tip_map.box
    tips = shell.tip_map.tips(box.from_free_cube(corners(shell)))
    assert mesh.distance(tips).max() < 0.5 * shell.grid.attrs["cell"]
    assert is_closed(mesh.faces)


def test_a_shell_contains_its_own_tips(shell):
    tips = tips_of_faces(shell.tip_map, 3000, seed=0)
    assert shell.contains(tips).mean() > 0.997
    assert not shell.contains(tips + [0.5, 0.0, 0.0]).any()


def test_the_convex_volume_of_a_shell_lies_between_two_bounds(shell):
    # tips attain 4833.8 mL
    assert shell.convex_volume + shell.convex_volume_error > 4833.8e-6
    assert shell.convex_volume - shell.convex_volume_error < 4836.8e-6
    assert shell.convex_volume_error < 0.02 * shell.convex_volume


def test_derivatives_of_a_shell_are_those_of_differences():
    found = volume_gradient(two_segments(), ["prox.distance", "stations.mid"], accuracy=0.05)
    assert (np.abs(found.volume - [0.052, -0.0023]) < found.volume_error + [5e-4, 5e-5]).all()
    assert (found.volume_error < 0.2 * np.abs(found.volume)).all()


@pytest.mark.large
def test_four_tendons_under_a_payload_reach_a_quarter_more_than_lines_of_sight_say():
    tendon = Tendon(name="t", bundles=4, distance=0.008, activation_bounds=(0.0, 3.0))
    found = reachable_set(arm_of(tendon, loads=Loads(payload=0.005)), accuracy=0.05)
    assert abs(found.volume - 1.083e-3) < found.volume_error < 0.05 * found.volume


def test_a_sheet_of_microns_has_a_thickness_and_leads_with_it(printed):
    robot = designs.three_tendon_robot()
    found = solid(robot)
    assert found.shell is not None
    area, thickness = found.shell
    assert thickness.value == pytest.approx(found.volume / area.value)
    assert thickness.value == pytest.approx(19.5e-6, rel=1e-2)
    assert repr(found).startswith("ReachableSet: a shell of area 0.0572653 ")
    assert float(found.to_dataset().shell_thickness) == thickness.value
    assert solid(designs.minimal_trunk(), accuracy=0.1).shell is None
    assert next(iter(printed("reach", "three_tendon_robot"))).startswith("shell_area")
    # the wrap of the same set, which knows nothing of its faces, pushes tips to both sides
    wrap = cells_of(as_tip_map(robot), 0.2 / 24).wrap
    assert wrap.volume_of_tips.value == pytest.approx(found.volume, rel=5e-3)
    assert wrap.area / 2 == pytest.approx(area.value, rel=1e-3)


def test_a_sheet_of_four_tendons_is_known_to_the_accuracy_asked():
    robot = designs.three_tendon_robot()
    four = robot.replace(actuators=(robot.actuators[0].replace(bundles=4),))
    rough = reachable_set(four, accuracy=0.05)
    assert abs(rough.volume - 3.121e-6) < rough.volume_error < 0.05 * rough.volume


def test_kinks_leave_thin_sheets_a_mesh_that_holds_their_corners():
    robot = designs.three_tendon_robot()
    drives = tuple(
        Drive(name=f"m{k}", bounds=(-1.0, 1.0), gains={name: 8.0}, dead_zone=0.1)
        for k, name in enumerate(robot.bundle_names)
    )
    found = solid(robot.replace(drives=drives), accuracy=0.05)
    plain = reachable_set(robot.with_bounds((0.0, 7.2)))
    assert abs(found.volume - plain.volume) < found.volume_error < 0.05 * found.volume
    mesh = found.surface()
    tips = found.tip_map.tips(found.tip_map.box.from_free_cube(corners(found)))
    assert mesh.distance(tips).max() < 0.5 * found.grid.attrs["cell"]
    assert is_closed(mesh.faces)
    inside = np.random.default_rng(0).random((1000, 3))
    own = found.tip_map.tips(found.tip_map.box.from_free_cube(inside))
    assert found.contains(own).mean() > 0.99
    assert not found.contains(tips + [0.0, 0.0, 0.05]).any()


def test_a_tip_rounded_to_millimeters_is_reached_within_one(capsys):
    robot = designs.three_tendon_robot()
    rod = as_tip_map(robot)
    target = rod.tips(rod.box.from_cube(np.array([[0.3, 0.8, 0.1]])))[0].round(3)
    (strict,), (loose,) = (solve_inverse(robot, target, within=size) for size in (0.0, 1e-3))
    assert strict.status != Status.REACHED
    assert loose.status == Status.REACHED
    assert len(loose) >= 1
    assert loose.residuals[0] == pytest.approx(loose.gap)
    assert 1e-5 < loose.gap < 1e-3
    np.testing.assert_allclose(rod.tips(loose.activations)[0], loose.nearest, atol=1e-9)
    (far,) = solve_inverse(robot, target, within=1e-6)
    assert far.status != Status.REACHED
    text = ",".join(map(str, target))
    assert run(["solve", "three_tendon_robot", "--target", text, "--within", "1mm"]) == 0
    assert "reached within 0." in capsys.readouterr().out
    assert run(["solve", "three_tendon_robot", "--target", text, "--within", "-1mm"]) == 2


def test_a_set_without_inside_says_so():
    arm = designs.minimal_trunk().with_bounds(((-1.0, 0.0), (-1.0, 0.0), (-0.5, -0.5)))
    surface = reachable_set(arm)
    for ask in (lambda: surface.contains([[0.0, 0.0, 0.5]]), lambda: surface.grid):
        with pytest.raises(NotPossible, match=r"dimension 2 has no .*: ask for distances"):
            ask()
