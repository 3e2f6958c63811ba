"""Laws of requirements as values and as files."""

import numpy as np
import pytest

import softreach as sr
from softreach.requirements import Box, HalfSpace, Keep, Limits, Mesh, Requirements, Sphere, Target
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible

NEEDS = """
version = 1
payloads = ["0g", "50g"]

[[reach]]
name = "shelf"
places_mm = [[0, 0, 298], [30, 20, 285]]
within = "1mm"

[[reach]]
file = "places.csv"

[[reach]]
name = "bin"
share = 0.8
box = { low_cm = [-5, -5, 10], high = ["5cm", "5cm", "0.2m"] }

[[stay_inside]]
box = { low_m = [-0.3, -0.3, 0], high_m = [0.3, 0.3, 0.4] }
clearance_mm = 2
of = "tip"

[[avoid]]
half_space = { point_m = [0, 0, -0.1], normal = [0, 0, 2] }
when = "always"

[[avoid]]
sphere = { center = "1m, 0m, 0m", radius_mm = 35 }

[limits]
actuators = 4
shortening = 0.3
force = "6N"
pressure_kpa = 50
stroke_mm = 20
mass = "300g"
bending = 0.9

[measures]
exact_volume = { at_least = 0.01 }
reach_height = { at_most = "40cm" }
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "places.csv").write_text("x_mm,y_mm,z_mm\n10,20,250\n")
    (tmp_path / "needs.toml").write_text(NEEDS)
    return tmp_path


def test_units_stand_in_keys_or_in_values(folder):
    needs = Requirements.load(folder / "needs.toml")
    shelf, cloud, bin = needs.targets
    assert shelf.places.tolist() == [[0.0, 0.0, 0.298], [0.03, 0.02, 0.285]]
    assert (shelf.name, shelf.within) == ("shelf", 0.001)
    assert (cloud.name, cloud.places.tolist()) == ("target 2", [[0.01, 0.02, 0.25]])
    assert (bin.region, bin.share) == (Box((-0.05, -0.05, 0.1), (0.05, 0.05, 0.2)), 0.8)
    inside, plane, ball = needs.keeps
    kept = inside.inside, inside.of, inside.when, inside.clearance
    assert kept == (True, "tip", "targets", 2e-3)
    assert (plane.region, plane.when) == (HalfSpace((0, 0, -0.1), (0, 0, 1)), "always")
    assert ball.region == Sphere((1, 0, 0), 0.035)
    assert needs.payloads == (0.0, 0.05)
    assert needs.limits == Limits(
        actuators=4, shortening=0.3, force=6.0, pressure=5e4, stroke=0.02, mass=0.3, bending=0.9
    )
    assert dict(needs.measures) == {"exact_volume": (0.01, None), "reach_height": (None, 0.4)}


def test_what_was_written_reads_back_equal(folder):
    needs = Requirements.load(folder / "needs.toml")
    tetrahedron = Mesh(np.eye(4, 3) + 1.0, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    needs = needs.replace(keeps=[*needs.keeps, Keep(tetrahedron, False)])
    needs.save(folder / "again.toml")
    again = Requirements.load(folder / "again.toml")
    assert again.to_toml() == needs.to_toml()
    for one, other in zip(needs.targets, again.targets, strict=True):
        assert np.array_equal(one.places, other.places)
        for name in ("region", "share", "within", "name"):
            assert getattr(one, name) == getattr(other, name)
    assert (again.limits, again.payloads) == (needs.limits, needs.payloads)
    assert np.array_equal(again.keeps[-1].region.vertices, tetrahedron.vertices)


def test_lengths_in_L_need_the_arm():
    text = '[[reach]]\nplaces = [["0L", "0L", "0.5L"]]\nwithin_over_length = 0.01\n'
    target = Requirements.from_toml(text, length=0.4).targets[0]
    assert target.places.tolist() == [[0.0, 0.0, 0.2]]
    assert target.within == 0.004
    with pytest.raises(InvalidDesign, match="L is not known") as caught:
        Requirements.from_toml(text)
    assert len(caught.value.faults) == 2


def test_all_faults_of_a_file_are_told_at_once_in_its_own_words():
    text = """
    payload = 3
    payloads = [0.1]
    [[reach]]
    places = [[1, 2, 3]]
    [[reach]]
    share = 0.5
    [[reach]]
    file = "none.csv"
    [[reach]]
    box = { low_mm = [0, 0, 0], high_mm = [1, 0, 1] }
    share = 1.5
    [[stay_inside]]
    sphere = { center_m = [0, 0, 0], radius_m = -1 }
    of = "hand"
    [[avoid]]
    mesh = "none.stl"
    [limits]
    shortening = 30
    weight = 3
    [measures]
    beauty = { at_least = 1 }
    exact_volume = { at_least = 2, at_most = "a" }
    """
    with pytest.raises(InvalidDesign) as caught:
        Requirements.from_toml(text, source="needs.toml")
    told = [fault.path for fault in caught.value.faults]
    assert told == [
        "payload",
        "payloads",
        "reach[0].places",
        "reach[1]",
        "reach[2].file",
        "reach[3].box.low_mm",
        "reach[3].share",
        "stay_inside[0].sphere.radius_m",
        "stay_inside[0].of",
        "avoid[0].mesh",
        "limits.weight",
        "limits.shortening",
        "measures.beauty",
        "measures.exact_volume.at_most",
    ]
    assert str(caught.value).startswith("needs.toml: 14 problems")
    assert 'did you mean "payloads"?' in str(caught.value)
    assert 'such as "5cm", or stand under places_m' in str(caught.value)


def test_requirements_that_contradict_each_other_are_named():
    box = Box((-1, -1, 0), (1, 1, 2))
    shelf = Target([[0, 0, 1], [0, 0, 3], [0, 0, -1]], name="shelf")
    ball = Keep(Sphere((0, 0, 1), 0.1), False, name="lamp", of="tip")
    with pytest.raises(InvalidDesign) as caught:
        Requirements(targets=[shelf], keeps=[Keep(box, True, name="cell"), ball])
    cell, lamp = map(str, caught.value.faults)
    assert cell.startswith("shelf, place 2 = (0.0, 0.0, 3.0): lies outside cell by 1 m")
    assert "1 more places" in cell
    assert lamp.startswith("shelf, place 1 = (0.0, 0.0, 1.0): lies inside lamp by 0.1 m")
    # Just on the boundary, or within the tolerance, nothing is wrong.
    Requirements(targets=[Target([0, 0, 2])], keeps=[Keep(box, True)])
    Requirements(targets=[Target([0, 0, 2.1], within=0.2)], keeps=[Keep(box, True)])
    half = Keep(HalfSpace((0, 0, 1), (0, 0, 1)), True)
    Requirements(targets=[Target(region=box, share=0.49)], keeps=[half])
    with pytest.raises(InvalidDesign, match=r"a share of 0\.6 cannot be reached"):
        Requirements(targets=[Target(region=box, share=0.6)], keeps=[half])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Box((0, 0, 0), (1, 0, 1)), "low along y"),
        (lambda: HalfSpace((0, 0, 0), (0, 0, 0)), "normal"),
        (lambda: Target(), "places = None"),
        (lambda: Target([[0, 0, 0]], share=0.5), "share"),
        (lambda: Target(region=HalfSpace((0, 0, 0), (0, 0, 1))), "bounded"),
        (lambda: Limits(actuators=10**30), "actuators = 10*: must be a whole number, from 0 to"),
        (lambda: Requirements(measures={"exact_volume": (2.0, 1.0)}), "least <= largest"),
        (lambda: Requirements(measures={"beauty": (2.0, None)}), "exact_volume"),
        (lambda: Requirements(targets=[Target([0, 0, 0], name="a")] * 2), "'a'"),
    ],
)
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


def test_a_mesh_with_holes_is_refused_with_their_number(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    with pytest.raises(NotPossible, match="the mesh has holes: close its 4 open edges"):
        Mesh(box.vertices, box.faces[2:])
    box.update_faces(np.arange(12) > 1)
    box.export(tmp_path / "open.stl")
    with pytest.raises(NotPossible, match=r"open\.stl has holes: close its 4 open edges"):
        Mesh.load(tmp_path / "open.stl", unit="m")
    with pytest.raises(InvalidInput, match="exists"):
        sr.requirements.Mesh.load(tmp_path / "none.stl")
