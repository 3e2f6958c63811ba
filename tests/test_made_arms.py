"""Laws of pictures and files of arms of every kind: nothing is lost, everything has its size."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Chamber, FiberArchitecture, ObliqueMuscle, Tendon
from softreach.arm.skin import Centerline, arm_surface, bundle_skins, bundle_surfaces, inside
from softreach.export import export_arm
from softreach.picture.zbuffer import faces_to_eye, seen_through
from softreach.plot import DesignPanel, plot_arm, plot_cross_section, plot_designs
from softreach.rod.kinematics import rest_configuration
from softreach.support.palette import material_fill
from tests.cable import Cable
from tests.made_arms import FIRM, MADE_ARMS, SOFT, STIFF, Ring, mixed_arm, one_ring_arm
from tests.sets import mesh_of

pytest.importorskip("matplotlib.pyplot")
trimesh = pytest.importorskip("trimesh")

ASIDE = Chamber(distance=0.01, radius=0.004, offset=1.0, activation_bounds=(0, 1))


@pytest.fixture(params=MADE_ARMS)
def arm(request):
    return MADE_ARMS[request.param]()


def some_activation(arm):
    low, high = arm.bounds.T
    return 0.3 * np.where(abs(high) > abs(low), high, low)


def resting(arm, stations=11):
    line = Centerline.unactivated(np.linspace(0, arm.length, stations), arm.base)
    return line.with_stations(arm.breakpoints)


class TestEveryKind:
    def test_has_pictures_at_rest_and_deformed(self, arm):
        shape = sr.configuration(arm, some_activation(arm), stations=21)
        ax = plot_arm(arm, shape, view="oblique")
        assert len(ax.images) == 2
        figure = plot_designs([DesignPanel("one", arm)], stations_over_length=(0.0, 0.5))
        assert len(figure.axes) == 3

    @pytest.mark.parametrize("suffix", ["ply", "stl", "obj", "glb", "vtu"])
    def test_has_files(self, arm, suffix, tmp_path):
        shape = sr.configuration(arm, some_activation(arm), stations=21)
        export_arm(arm, shape, tmp_path / f"arm.{suffix}")
        assert (tmp_path / f"arm.{suffix}").stat().st_size > 1000
        if suffix == "glb":
            parts = trimesh.load(tmp_path / "arm.glb").geometry
            assert list(parts) == ["body", *arm.bundle_names]
            clear = parts["body"].visual.material.baseColorFactor[3] < 255
            assert clear == any(inside(arm))

    def test_is_made_of_closed_surfaces_around_a_volume(self, arm):
        shape = sr.configuration(arm, some_activation(arm), stations=51)
        for surface in (arm_surface(arm, shape), *bundle_surfaces(arm, shape)):
            mesh = mesh_of(surface)
            assert mesh.is_watertight
            assert mesh.is_winding_consistent
            assert mesh.volume > 0


class TestSkins:
    def test_bundles_end_where_they_end_to_act_between_stations(self):
        arm = mixed_arm()
        for skins in (bundle_skins(arm, resting(arm)), bundle_surfaces(arm, resting(arm))):
            ends = [(skin.vertices[:, 2].min(), skin.vertices[:, 2].max()) for skin in skins]
            for k, (first, last) in {0: (0, 0.62), 1: (0.21, 1), 5: (0.1, 0.8)}.items():
                np.testing.assert_allclose(ends[k], [first * 0.3, last * 0.3], atol=1e-15)

    def test_a_bundle_that_pauses_is_in_two_pieces(self):
        class Pausing(Cable):
            def acts(self, profile, z):
                return ((z < 0.1) | (z >= 0.2))[:, None]

            def breakpoints(self, profile):
                return (0.1, 0.2)

        arm = one_ring_arm(Pausing(name="cable", place=(0.01, 0.0)))
        (skin,) = bundle_surfaces(arm, resting(arm, 5))
        pieces = mesh_of(skin).split()
        heights = sorted((*piece.bounds[:, 2],) for piece in pieces)
        np.testing.assert_allclose(heights, [(0, 0.1), (0.2, 0.3)], atol=1e-12)

    def test_the_body_has_the_volume_of_its_cones_whatever_the_stations(self):
        arm = mixed_arm()
        edges = arm.length * np.array([0, 0.3, 0.45, 1])
        r = arm.profile.radius(edges)
        cones = np.pi / 3 * np.diff(edges) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2)
        body = mesh_of(arm_surface(arm, resting(arm, 4), sides=600))
        assert body.volume == pytest.approx(cones.sum(), rel=1e-4)

    def test_stations_between_others_lie_on_the_arm(self):
        arm = mixed_arm()
        gamma = some_activation(arm)
        z = np.linspace(0, arm.length, 61)
        whole, coarse = sr.configuration(arm, gamma, z), sr.configuration(arm, gamma, z[::2])
        frames = {name: coarse[name].values for name in ("position", "directors")}
        line = Centerline(z=z[::2], **frames)
        fine = line.with_stations(z[1::2])
        np.testing.assert_array_equal(fine.z, z)
        np.testing.assert_allclose(fine.position, whole.position, atol=2e-5 * arm.length)
        np.testing.assert_allclose(fine.directors, whole.directors, atol=5e-3)
        assert fine.with_stations(z) is fine

    def test_a_chamber_is_a_tube_of_its_radius_at_its_distance(self):
        arm = one_ring_arm(ASIDE)
        (skin,) = bundle_skins(arm, resting(arm))
        center = 0.01 * np.array([np.cos(1.0), np.sin(1.0)])
        rim = skin.vertices[:-2]  # without the middles of the caps
        np.testing.assert_allclose(np.linalg.norm(rim[:, :2] - center, axis=1), 0.004)

    def test_a_helical_tendon_is_as_thick_across_itself_as_a_straight_one(self):
        straight = Tendon(distance=0.02, activation_bounds=(0, 1))
        volumes = []
        for tendon in (straight, straight.replace(revolution=6.0)):
            arm = one_ring_arm(tendon, radius=0.01)
            (skin,) = bundle_skins(arm, resting(arm, 401))
            volumes.append(mesh_of(skin).volume)
        assert volumes[1] / volumes[0] == pytest.approx(np.hypot(1, 6.0 * 0.02 / 0.3), rel=2e-3)

    def test_what_lies_inside_shows_through_the_body(self):
        def hidden(**where):
            return inside(one_ring_arm(Tendon(activation_bounds=(0, 1), **where)))

        assert hidden(distance_ratio=0.9) == (True,)
        assert hidden(distance_ratio=1.0) == (False,)
        assert hidden(distance_ratio=1.2) == (False,)
        assert inside(mixed_arm()) == (False, False, True, True, True, True)
        assert inside(sr.designs.redundant_trunk()) == (False,) * 4

    def test_a_chamber_inside_is_seen_in_the_picture_of_the_arm(self):
        """Red shows, though the body covers it."""

        def redness(bundles):
            chamber = ASIDE.replace(radius=0.006, offset=0.0)
            ax = plot_arm(one_ring_arm(chamber), view="side", bundles=bundles)
            pixels = ax.images[0].get_array()
            opaque = pixels[pixels[..., 3] == 255].astype(int)
            return (opaque[:, 0] - opaque[:, 1]).max()

        assert redness([0]) > 60
        assert redness([]) < 20

    def test_tendons_outside_are_in_view(self):
        arm = MADE_ARMS["tendon"]()
        assert plot_arm(arm, view="front").get_xlim()[1] > 0.01 / arm.length


class TestSeeThrough:
    def test_half_of_a_ball_faces_the_eye(self):
        ball = trimesh.creation.icosphere(subdivisions=3)
        seen = faces_to_eye(ball.vertices, ball.faces, "side")
        assert (ball.vertices[seen].mean(axis=1)[:, 0] > 0).all()
        assert len(seen) == pytest.approx(len(ball.faces) / 2, rel=0.05)

    def test_what_covers_nothing_or_is_not_covered_shows_alone(self, rng):
        image = rng.integers(0, 256, (4, 5, 4), dtype=np.uint8)
        np.testing.assert_array_equal(seen_through(image, np.zeros_like(image)), image)
        np.testing.assert_array_equal(seen_through(np.zeros_like(image), image), image)

    def test_color_lies_between_both_where_both_are(self):
        front, back = np.full((1, 1, 4), 255, np.uint8), np.array([[[255, 0, 0, 255]]], np.uint8)
        red, green, _, opacity = seen_through(front, back)[0, 0]
        assert (red, opacity) == (255, 255)
        assert 0 < green < 255


class TestSection:
    def test_lumens_are_circles_of_their_radius_at_their_place(self):
        from matplotlib.patches import Circle

        arm = one_ring_arm(ASIDE.replace(bundles=2))
        ax = plot_cross_section(arm, 0.1)
        circles = (patch for patch in ax.patches if isinstance(patch, Circle))
        lumens = [circle for circle in circles if circle.radius == pytest.approx(0.004 / 0.3)]
        angles = [np.arctan2(p.center[1], p.center[0]) % (2 * np.pi) for p in lumens]
        np.testing.assert_allclose(angles, [1.0, 1.0 + np.pi])
        np.testing.assert_allclose([np.hypot(*p.center) for p in lumens], 0.01 / 0.3)

    def test_tendons_are_dots_at_their_distance_in_view(self):
        arm = MADE_ARMS["tendon"]()
        ax = plot_cross_section(arm, 0.1)
        dots = np.array([line.get_xydata()[0] for line in ax.lines])
        assert len(dots) == 6
        np.testing.assert_allclose(np.hypot(*dots.T), 0.01 / arm.length)
        assert ax.get_xlim()[1] > 0.01 / arm.length

    def test_what_does_not_act_is_left_out(self):
        arm = MADE_ARMS["tendon"]()
        assert len(plot_cross_section(arm, 0.49 * arm.length).lines) == 6
        assert len(plot_cross_section(arm, 0.51 * arm.length).lines) == 3

    def test_a_sector_fills_its_own_ring(self):
        from matplotlib.patches import Wedge

        arm = mixed_arm()
        ax = plot_cross_section(arm, 0.15)
        outer = float(arm.profile.radius(0.15)) / arm.length
        wedges = [patch for patch in ax.patches if isinstance(patch, Wedge)]
        found = [((w.r - (w.width or 0)) / outer, w.r / outer) for w in wedges]
        rings = [(0.85, 1.0), (0.85, 1.0), (0.45, 0.7), (0.6, 0.85)]
        np.testing.assert_allclose(found, rings)

    def test_oblique_muscles_lean_the_way_they_wind_and_radial_ones_do_not(self):
        def lean(name, **changes):
            arm = MADE_ARMS[name]()
            (actuator,) = arm.actuators
            strokes = plot_cross_section(arm.replace(actuators=(actuator.replace(**changes),)))
            (ends, *_) = strokes.collections[0].get_segments()
            inner, outer = np.arctan2(ends[:, 1], ends[:, 0])
            return outer - inner

        assert lean("oblique") > 0.05
        assert lean("oblique", helical_angle=-0.4) < -0.05
        assert lean("radial", extent=1.0) == pytest.approx(0)
        assert not plot_cross_section(MADE_ARMS["fiber"]()).collections
        straight = ObliqueMuscle(helical_angle=0.0, extent=1.0)
        assert not plot_cross_section(one_ring_arm(straight)).collections

    def test_every_material_has_its_own_color_and_a_name_in_the_key(self):
        ax = plot_cross_section(mixed_arm(), 0.15)
        texts = [text.get_text() for text in ax.get_legend().get_texts()]
        assert texts[:3] == ["stiff: E = 600 kPa", "middle: E = 200 kPa", "soft: E = 70 kPa"]
        assert "cable: τ [N]" in texts
        assert "channel: P [Pa]" in texts
        assert "oblique, left-handed: γ [-]" in texts
        assert len({material_fill(k) for k in range(6)}) == 6

    def test_fibers_in_one_material_need_no_key_and_long_ones_say_what_they_omit(self, trunk):
        assert plot_cross_section(trunk).get_legend() is None
        assert plot_cross_section(trunk, legend=True).get_legend() is not None
        assert plot_cross_section(mixed_arm(), legend=False).get_legend() is None
        tendons = Tendon(name="t", distance=0.01, bundles=30, activation_bounds=(0, 1))
        labels = plot_cross_section(one_ring_arm(tendons)).get_legend().get_texts()
        assert len(labels) == 12
        assert labels[-1].get_text().endswith("and 19 more")

    def test_bore_core_and_gap_are_drawn_where_they_are(self):
        from matplotlib.patches import Annulus, Circle

        inner = Ring(inner_ratio=0.3, outer_ratio=0.5, material=STIFF)
        rings = (inner, Ring(inner_ratio=0.8, material=FIRM))
        fiber = FiberArchitecture(ring=1, revolution=0, extent=0.5)
        arm = one_ring_arm(fiber, rings=rings, core=SOFT, bore_ratio=0.1)
        white = [p for p in plot_cross_section(arm).patches if p.get_facecolor() == (1, 1, 1, 1)]
        bore, gap = white
        outer = 0.02 / 0.3
        assert isinstance(bore, Circle)
        assert bore.radius == pytest.approx(0.1 * outer)
        assert isinstance(gap, Annulus)
        assert gap.get_radii()[0] == pytest.approx(0.8 * outer)
        assert gap.get_width() == pytest.approx(0.3 * outer)


def test_the_arm_at_rest_has_sections_at_kinks():
    arm = mixed_arm()
    body = arm_surface(arm, rest_configuration(arm, stations=2))
    assert set(np.round(body.vertices[:, 2], 9)) >= {0.09, 0.135}
