"""Laws of the arm in the scene of the studio: a mesh for each part, moved and not made anew."""

import inspect
import io
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from softreach.arm import Marker, designs
from softreach.arm.parameters import changed
from softreach.inverse.path import PathStatus
from softreach.rod.kinematics import marker_positions
from softreach.studio.found import Found
from softreach.studio.reach import Size, stages
from softreach.studio.scene.camera import NumberedBox
from softreach.studio.scene.scene import Scene
from softreach.studio.state import Appearance, Slice, StudioState, TipPath
from softreach.studio.tabs import JOBS
from softreach.studio.tabs.compare import compared, comparison_html
from tests.made_arms import MADE_ARMS
from tests.studio.conftest import SMALL


class Meshes:
    """Takes the place of viser's scene and keeps what is added."""

    def __init__(self):
        self.added = {}

    def __getattr__(self, method):  # of those that add something
        from viser import SceneApi

        def add(*given, **style):
            fields = inspect.signature(getattr(SceneApi, method)).bind(self, *given, **style)
            self.added[given[0]] = SimpleNamespace(**fields.arguments)
            return self.added[given[0]]

        return add

    def _at(self, path):
        return [each for each in self.added if each == path or each.startswith(f"{path}/")]

    def remove_by_name(self, path):
        for each in self._at(path):
            del self.added[each]

    def get_handle_by_name(self, path):  # viser has nodes above those that are added
        return next((self.added[each] for each in self._at(path)), None)


def test_a_path_ends_in_a_ball_where_the_arm_follows_it_no_further():
    points, meshes = np.linspace([0.0, 0.0, 1.0], [0.5, 0.0, 1.0], 11), Meshes()
    job = next(job for job in JOBS if job.name == "path")
    state, end = StudioState(design=TRUNK, path=TipPath.through(points)), [0.17, 0.0, 1.0]

    def drawn(followed: int) -> dict:
        status = np.where(np.arange(11) < followed, PathStatus.FOLLOWED, PathStatus.FOLD)
        activation = ("point", "bundle"), np.zeros((11, 3))
        values = {"status": ("point", status), "activation": activation}
        track = xr.Dataset(values | {"end_position": ("axis", end)})
        job.draw(SimpleNamespace(state=state, found=Found(track=track), scene=Scene(meshes)))
        return meshes.added

    np.testing.assert_array_equal(drawn(4)["/path/end"].position, end)
    assert len(drawn(4)["/path/followed"].points) == 4
    assert "/path/end" not in drawn(11)


@pytest.mark.parametrize(("unit", "size"), [("mm", 1e-3), ("cm", 1e-2), ("L", 0.2)])
def test_numbers_along_the_axes_are_places_in_the_unit_of_the_design(unit, size):
    arm, drawn = MADE_ARMS["fiber"]().replace(display_unit=unit), Meshes()
    arm = changed(arm, {"length": 0.2})
    corners = np.array([[-0.5, -0.7, 0.1], [0.6, 0.5, 1.1]])
    box = NumberedBox(drawn)
    box.draw(corners, arm=arm)
    labels = [node for path, node in drawn.added.items() if path.startswith("/axes/label")]
    names = [label.text for label in labels if label.text[0] in "xyz"]
    assert names == [arm.length_unit.label(axis) for axis in "xyz"]
    low, high = box.corners
    assert (low <= corners[0] + 1e-12).all()
    assert (high >= corners[1] - 1e-12).all()
    axis = 0
    for label in labels:
        if label.text in names:
            axis += 1
        else:
            number = float(label.text.replace("\N{MINUS SIGN}", "-"))
            assert number * size == pytest.approx(label.position[axis] * arm.length, abs=1e-12)


@pytest.mark.parametrize("kind", MADE_ARMS)
def test_every_kind_of_arm_is_drawn_and_moves(kind):
    arm, meshes = MADE_ARMS[kind](), Meshes()
    scene = Scene(meshes)
    low, high = arm.bounds.T
    scene.draw_arm(arm, np.zeros(arm.bundles).tolist())
    assert len(meshes.added) == 1 + arm.bundles
    at_rest = {path: mesh.vertices for path, mesh in meshes.added.items()}
    scene.draw_arm(arm, (0.2 * (low + high)).tolist())
    for path, mesh in meshes.added.items():
        assert mesh.vertices.shape == at_rest[path].shape
        assert not np.allclose(mesh.vertices, at_rest[path], atol=1e-6)


def test_a_body_is_clear_only_where_it_hides_a_bundle():
    def opacity(kind):
        meshes, arm = Meshes(), MADE_ARMS[kind]()
        Scene(meshes).draw_arm(arm, np.zeros(arm.bundles).tolist())
        return [meshes.added[path].opacity for path in sorted(meshes.added)]

    body, *bundles = opacity("chamber")
    assert 0 < body < 1
    assert bundles == [None] * 3
    assert opacity("fiber") == [None] * 4


def test_markers_are_dots_in_a_body_that_is_clear():
    offset = Marker(name="camera", station=0.03, offset=(0.0, 0.01, 0.002))
    arm, meshes = MADE_ARMS["fiber"]().replace(markers=(offset, Marker(name="tip"))), Meshes()
    scene, pulled = Scene(meshes), 0.2 * arm.bounds.sum(axis=1)
    for activation in (np.zeros(arm.bundles), pulled):
        tip = scene.draw_arm(arm, activation.tolist())
        places = marker_positions(arm, activation)[0] / arm.length
        np.testing.assert_allclose(meshes.added["/arm/markers"].points, places, atol=1e-4)
        np.testing.assert_allclose(places[1], tip, atol=1e-4)
    assert 0 < meshes.added["/arm/0"].opacity < 1


@pytest.fixture(scope="module")
def whole(trunk):
    return [*stages(trunk, 12, SMALL, lambda: None)][-1]


def test_the_exact_surface_is_shown_first_and_points_only_where_there_is_none_or_on_demand(whole):
    meshes, look = Meshes(), Appearance()
    scene = Scene(meshes)

    def drawn(reach, look):
        keys = scene.draw_surface(reach, look), scene.draw_cloud(reach, look)
        return keys, {path for path in meshes.added if path in ("/surface", "/cloud")}

    (of_surface, none), nodes = drawn(whole, look)
    assert (none, nodes) == (None, {"/surface"})
    (_, of_cloud), nodes = drawn(replace(whole, exact=None), look)
    assert nodes == {"/cloud"}
    assert None not in (of_surface, of_cloud)
    both = (None, of_cloud), {"/surface", "/cloud"}
    assert drawn(whole, replace(look, cloud=True)) == both
    assert drawn(whole, replace(look, surface=False))[1] == set()


def test_a_reach_beside_is_a_faint_surface(whole):
    meshes = Meshes()
    scene = Scene(meshes)
    scene.draw_beside("/free", whole, Slice())
    trimesh = pytest.importorskip("trimesh")
    loaded = trimesh.load_scene(io.BytesIO(meshes.added["/free"].glb_data), file_type="glb")
    (free,) = loaded.geometry.values()
    np.testing.assert_allclose(free.vertices, whole.sheets.vertices / whole.arm.length, atol=1e-6)
    assert free.visual.vertex_attributes["color"][:, 3].max() < 0.3 * 255
    scene.draw_beside("/free", None, Slice())
    assert not meshes.added


# Two designs compared, without a server


TRUNK = designs.minimal_trunk()


def reach(volume, error=1e-4, unr=0.3):
    return SimpleNamespace(size=Size("volume", volume, error, 3), unreachability=unr)


def test_only_parameters_that_differ_have_rows_with_their_change_where_both_are_known():
    flat = changed(TRUNK, {"taper": 0.0})
    for now, change in ((reach(0.5), pytest.approx(-0.2)), (None, None)):
        rows = compared((TRUNK, reach(0.7)), (flat, now))
        assert rows[0].change == change
        assert rows[-1].change == pytest.approx(-2)
        assert [row.title for row in rows] == ["volume [m³]", "UNR [%]", "taper φ [deg]"]


def test_digits_of_volumes_and_of_their_change_follow_the_errors():
    kept, now = reach(0.691648, 2e-5, 0.311592), reach(0.6926257, 3e-4, 1.311592)
    table = comparison_html((TRUNK, kept), (TRUNK, now))
    texts = re.sub("<[^>]*>", " ", table).split()
    assert {"0.69165", "0.6926", "+0.0010", "(+0.14", "31.16", "131.16", "+100"} <= {*texts}
