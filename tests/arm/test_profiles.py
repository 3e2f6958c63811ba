"""Laws of profiles given at stations: in pieces, and as a curve through samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import softreach as sr
from softreach.arm import LinearTaper, PiecewiseTaper, Profile, SampledTaper, designs
from softreach.arm.number import number
from softreach.arm.parameters import changed, parameters
from softreach.support.errors import InvalidDesign
from tests.kinds import profiles, stations
from tests.laws import in_box

GIVEN = (PiecewiseTaper, SampledTaper)


@given(profile=profiles())
def test_the_slender_coordinate_and_its_inverse_undo_each_other(profile):
    places = [0.0, *profile.breakpoints, profile.length]
    z = np.union1d(np.linspace(0, profile.length, 9), places)
    s = profile.slender_coordinate(z)
    assert (np.diff(s) > 0).all()
    np.testing.assert_allclose(profile.station(s), z, atol=1e-12 * profile.length)
    assert profile.slender_length == pytest.approx(s[-1], rel=1e-13)


@given(profile=profiles(), ratio=st.floats(0.1, 1.0), share=st.floats(0.0, 1.0))
def test_the_coordinates_are_the_integrals_that_define_them(profile, ratio, share):
    """S = ∫ dZ / R2, and ∫ dZ / (R cos φ) on the cone R = ratio R2, across breakpoints."""
    place = share * profile.length

    def integral(f):
        inside = [0.0, *(z for z in profile.breakpoints if z < place), place]
        return sum(quad(f, *pair, epsabs=0, epsrel=1e-12)[0] for pair in pairwise(inside))

    def on_cone(z):
        return math.hypot(1.0, ratio * profile.slope(z)) / (ratio * profile.radius(z))

    assert profile.slender_coordinate(place) == pytest.approx(
        integral(lambda z: 1 / profile.radius(z)), rel=1e-10, abs=1e-14
    )
    found = profile.surface_coordinate(place, ratio)
    assert found == pytest.approx(integral(on_cone), rel=1e-10, abs=1e-14)


@given(profile=profiles(), share=st.floats(0.01, 0.99))
def test_the_slope_is_what_the_radius_loses_along_z(profile, share):
    z, step = share * profile.length, 1e-5 * profile.length
    if any(abs(z - place) < 3 * step for place in profile.breakpoints):
        return
    lost = profile.radius(z - step) - profile.radius(z + step)
    assert lost / (2 * step) == pytest.approx(
        float(profile.slope(z)), abs=1e-5 * float(profile.radius(0.0)) / profile.length
    )


@dataclass(frozen=True, kw_only=True)
class Bulge(Profile):
    """A cylinder with a bulge, of which only the radius and its slope are said."""

    end_radius: float = number("R", "m", "radius at both ends", low=0.0, default=1 / 16)
    bulge: float = 0.5

    def radius(self, z):
        """R (1 + b sin πZ/L)."""
        return self.end_radius * (1 + self.bulge * np.sin(np.pi * np.asarray(z) / self.length))

    def slope(self, z):
        """-R2'(Z)."""
        rise = self.end_radius * self.bulge * np.pi / self.length
        return -rise * np.cos(np.pi * np.asarray(z) / self.length)


class TestAProfileOfOnesOwn:
    arm = designs.minimal_trunk().replace(profile=Bulge(length=1.0))

    def test_without_its_bulge_it_is_the_cylinder(self):
        cylinder = self.arm.replace(profile=LinearTaper(length=1.0, outer_radius=1 / 16))
        straight = changed(self.arm, {"bulge": 0.0})
        gamma = in_box(cylinder, 20)
        np.testing.assert_allclose(
            sr.tip_positions(straight, gamma), sr.tip_positions(cylinder, gamma), atol=2e-6
        )

    @pytest.mark.parametrize("bulge", [-0.6, 0.1, 2.0])
    def test_its_coordinates_follow_from_its_radius(self, bulge):
        own = Bulge(length=0.7, bulge=bulge)
        z = np.linspace(0, 0.7, 9)
        s = [quad(lambda z: 1 / own.radius(z), 0, end, epsrel=1e-12)[0] for end in z]
        np.testing.assert_allclose(own.slender_coordinate(z), s, rtol=1e-12)
        np.testing.assert_allclose(own.station(s), z, atol=1e-12)

    def test_it_survives_a_file_and_its_fields_are_parameters(self):
        assert 'kind = "Bulge"' in self.arm.to_toml()
        assert sr.Manipulator.from_toml(self.arm.to_toml()) == self.arm
        assert {"length", "bulge", "end_radius"} <= parameters(self.arm).keys()
        wide = changed(self.arm, {"bulge": 1.0, "end_radius": 0.05})
        assert wide.profile == Bulge(length=1.0, bulge=1.0, end_radius=0.05)

    def test_numbers_of_a_sequence_are_called_by_their_places(self):
        @dataclass(frozen=True, kw_only=True)
        class Waved(Bulge):
            waves: tuple[float, ...] = (1.0, 2.0)

        arm = self.arm.replace(profile=Waved(length=1.0))
        assert changed(arm, {"profile.waves[1]": 3.0}).profile.waves == (1.0, 3.0)
        with pytest.raises(InvalidDesign, match=r"profile.waves\[0\] = nan: must be a finite"):
            changed(arm, {"profile.waves[0]": math.nan})

    def test_it_is_refused_where_its_radius_is_not_positive(self):
        with pytest.raises(InvalidDesign, match=r"radius = -0.03125: must be above 0 m all along"):
            Bulge(length=1.0, bulge=-1.5)


@given(places=stations(), taper=st.floats(-0.03, 0.05), kind=st.sampled_from(GIVEN))
def test_radii_on_a_straight_line_make_the_linear_taper(places, taper, kind):
    line = LinearTaper(length=1.0, outer_radius=1 / 16, taper=taper)
    radii = tuple(line.radius(places).tolist())
    same = kind(length=1.0, stations_over_length=places, radii=radii)
    z = np.linspace(0, 1, 11)
    for name in ("radius", "slope", "slender_coordinate", "surface_coordinate"):
        np.testing.assert_allclose(
            getattr(same, name)(z), getattr(line, name)(z), rtol=1e-11, atol=1e-13, err_msg=name
        )
    s = line.slender_coordinate(z)
    np.testing.assert_allclose(same.station(s), line.station(s), atol=1e-12)


@given(
    length=st.floats(0.1, 5.0),
    places=stations(),
    radii=st.lists(st.floats(0.01, 0.2), min_size=5, max_size=5),
)
def test_a_curve_through_samples_is_no_wider_and_no_thinner_than_they_are(length, places, radii):
    radii = tuple(radii[: len(places)])
    profile = SampledTaper(length=length, stations_over_length=places, radii=radii)
    np.testing.assert_allclose(profile.radius(length * np.array(places)), radii, rtol=1e-13)
    between = profile.radius(np.linspace(0, length, 201))
    assert min(radii) * (1 - 1e-12) <= between.min()
    assert between.max() <= max(radii) * (1 + 1e-12)


@pytest.mark.parametrize("kind", GIVEN)
def test_breakpoints_are_the_stations_between_base_and_tip(kind):
    profile = kind(length=2.0, stations_over_length=(0, 0.25, 1), radii=(0.1, 0.08, 0.05))
    assert profile.breakpoints == (0.5,)
    assert designs.minimal_trunk().profile.breakpoints == ()


def test_at_a_breakpoint_the_slope_is_that_of_the_piece_that_begins_there():
    profile = PiecewiseTaper(length=1.0, stations_over_length=(0, 0.5, 1), radii=(0.1, 0.1, 0.05))
    np.testing.assert_allclose(profile.slope([0.5, np.nextafter(0.5, 0), 1.0]), [0.1, 0.0, 0.1])


@pytest.mark.parametrize("kind", GIVEN)
def test_a_profile_is_a_value(kind):
    fields = {"stations_over_length": [0, np.float32(0.5), 1], "radii": np.array([0.1, 0.08, 0.05])}
    profile = kind(length=np.int64(1), **fields)
    assert profile == profile.replace() == kind(length=1.0, **fields)
    assert hash(profile) == hash(profile.replace(length=1))
    assert profile.replace(length=2.0).breakpoints == (1.0,)


@pytest.mark.parametrize("kind", GIVEN)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stations_over_length": (0, 5e-324, 1)}, r"rise from 0 .* each by 1e-12 or more"),
        ({"stations_over_length": (0.1, 1)}, "rise from 0"),
        ({"radii": (0.1, 0.1)}, r"radii = .*must be 3 finite numbers, one for each station"),
    ],
)
def test_an_impossible_profile_is_refused(kind, change, message):
    fields = {"length": 1.0, "stations_over_length": (0, 0.5, 1), "radii": (0.1, 0.08, 0.05)}
    with pytest.raises(InvalidDesign, match=message):
        kind(**(fields | change))


# Laws of profiles: the slender coordinate, its inverse, and the coordinate of the surface


@st.composite
def tapers(draw: st.DrawFn) -> LinearTaper:
    """Any linear taper that leaves a tip, as good as cylindrical ones among them."""
    length = draw(st.floats(1e-3, 1e3))
    radius = length * draw(st.floats(0.01, 1.0))
    loss = draw(st.floats(-1.0, 0.95) | st.sampled_from([0.0, 1e-300, -1e-15, 1e-9]))
    return LinearTaper(length=length, outer_radius=radius, taper=math.atan(loss * radius / length))


@given(profile=tapers())
def test_the_slender_coordinate_and_its_inverse_undo_each_other_on_a_cone(profile):
    z = np.linspace(0, profile.length, 7)
    s = profile.slender_coordinate(z)
    np.testing.assert_allclose(profile.station(s), z, atol=1e-13 * profile.length)
    np.testing.assert_allclose(
        profile.slender_coordinate(profile.station(s)), s, atol=1e-12 * profile.slender_length
    )


@given(profile=tapers(), ratio=st.floats(0.1, 1.0))
def test_the_coordinates_are_the_integrals_that_define_them_on_a_cone(profile, ratio):
    """S = ∫ dZ / R2, and ∫ dZ / (R cos φ) on the cone R = ratio R2 (Appendix B)."""
    slope = math.sqrt(1 + (ratio * math.tan(profile.taper)) ** 2)
    place = 0.7 * profile.length
    whole = quad(lambda z: 1 / profile.radius(z), 0, place, epsabs=0, epsrel=1e-12)[0]
    assert profile.slender_coordinate(place) == pytest.approx(whole, rel=1e-11)
    on_cone = profile.surface_coordinate(place, ratio)
    assert on_cone == pytest.approx(whole * slope / ratio, rel=1e-11)


def test_a_cone_may_be_given_by_the_radius_of_its_tip():
    cone = LinearTaper(length=0.3, outer_radius=0.02, tip_radius=0.005)
    assert cone.radius(0.3) == pytest.approx(0.005)
    assert cone.taper == math.atan(0.015 / 0.3)
    again = LinearTaper(length=0.3, outer_radius=0.02).replace(tip_radius=cone.tip_radius)
    assert again.taper == pytest.approx(cone.taper)
    with pytest.raises(InvalidDesign, match="left out beside a taper"):
        LinearTaper(length=0.3, outer_radius=0.02, taper=0.1, tip_radius=0.005)
    with pytest.raises(InvalidDesign, match=r"tip_radius = 0: must be a finite number > 0 m"):
        LinearTaper(length=0.3, outer_radius=0.02, tip_radius=0)


def test_numpy_scalars_are_taken_as_numbers():
    profile = LinearTaper(length=np.int64(1), outer_radius=np.float32(0.5), taper=np.float64(0.1))
    assert [type(value) for value in vars(profile).values()] == [float] * 3
    assert hash(profile) == hash(LinearTaper(length=1, outer_radius=0.5, taper=0.1))


def test_a_taper_that_leaves_no_tip_is_refused():
    said = r"taper = 0.07: leaves no tip.*must be a finite number < 0.0624188 rad"
    with pytest.raises(InvalidDesign, match=said):
        LinearTaper(length=1.0, outer_radius=1 / 16, taper=0.07)
