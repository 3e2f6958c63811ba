"""Laws of profiles: the slender coordinate, its inverse, and the coordinate of the surface."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import softreach as sr
from softreach.arm import LinearTaper
from softreach.support.errors import InvalidDesign


@st.composite
def tapers(draw: st.DrawFn) -> LinearTaper:
    """Any linear taper that leaves a tip, as good as cylindrical ones among them."""
    length = draw(st.floats(1e-3, 1e3))
    radius = length * draw(st.floats(0.01, 1.0))
    loss = draw(st.floats(-1.0, 0.95) | st.sampled_from([0.0, 1e-300, -1e-15, 1e-9]))
    return LinearTaper(length=length, outer_radius=radius, taper=math.atan(loss * radius / length))


@given(profile=tapers())
def test_the_slender_coordinate_and_its_inverse_undo_each_other(profile):
    z = np.linspace(0, profile.length, 7)
    s = profile.slender_coordinate(z)
    np.testing.assert_allclose(profile.station(s), z, atol=1e-13 * profile.length)
    np.testing.assert_allclose(
        profile.slender_coordinate(profile.station(s)), s, atol=1e-12 * profile.slender_length
    )


@given(profile=tapers(), ratio=st.floats(0.1, 1.0))
def test_the_coordinates_are_the_integrals_that_define_them(profile, ratio):
    """S = ∫ dZ / R2, and ∫ dZ / (R cos φ) on the cone R = ratio R2 (Appendix B)."""
    slope = math.sqrt(1 + (ratio * math.tan(profile.taper)) ** 2)
    place = 0.7 * profile.length
    whole = quad(lambda z: 1 / profile.radius(z), 0, place, epsabs=0, epsrel=1e-12)[0]
    assert profile.slender_coordinate(place) == pytest.approx(whole, rel=1e-11)
    on_cone = profile.surface_coordinate(place, ratio)
    assert on_cone == pytest.approx(whole * slope / ratio, rel=1e-11)


@given(profile=tapers(), share=st.floats(0.05, 0.95))
def test_the_slender_coordinate_grows_by_one_over_the_radius(profile, share):
    z, step = share * profile.length, 1e-4 * profile.length
    far, near = (
        profile.slender_coordinate(z + k * step) - profile.slender_coordinate(z - k * step)
        for k in (2, 1)
    )
    rate = (8 * near - far) / (12 * step)  # fourth-order central difference
    assert rate == pytest.approx(1 / profile.radius(z), rel=1e-9)


@given(profile=tapers())
def test_the_slope_is_that_of_the_radius(profile):
    z = np.linspace(0, profile.length, 5)
    lost = profile.radius(0.0) - profile.radius(z)
    np.testing.assert_allclose(profile.slope(z) * z, lost, atol=1e-14 * profile.outer_radius)


@pytest.mark.parametrize("taper_deg", [-2, 1e-12, 1, 3])
def test_rotation_of_a_fiber_is_the_integral_of_appendix_b(taper_deg):
    phi, radius = math.radians(taper_deg), 1 / 16
    slope = math.sqrt(1 + math.tan(phi) ** 2)
    expected = quad(lambda z: slope / (radius - z * math.tan(phi)), 0, 1, epsabs=1e-12)[0]
    profile = LinearTaper(length=1.0, outer_radius=radius, taper=phi)
    np.testing.assert_allclose(profile.surface_coordinate(1.0), expected, rtol=1e-12)


def test_the_untapered_rotation_is_z_over_radius():
    profile = LinearTaper(length=1.0, outer_radius=1 / 16)
    assert profile.surface_coordinate(0.7) == pytest.approx(0.7 * 16, rel=1e-15)


def test_a_cone_may_be_given_by_the_radius_of_its_tip():
    cone = LinearTaper(length=0.3, outer_radius=0.02, tip_radius=0.005)
    assert cone.radius(0.3) == pytest.approx(0.005)
    assert cone.taper == math.atan(0.015 / 0.3)
    again = LinearTaper(length=0.3, outer_radius=0.02).replace(tip_radius=cone.tip_radius)
    assert again.taper == pytest.approx(cone.taper)
    assert sr.designs.minimal_trunk(tip_radius=0.03).profile.tip_radius == pytest.approx(0.03)
    with pytest.raises(InvalidDesign, match="left out beside a taper"):
        LinearTaper(length=0.3, outer_radius=0.02, taper=0.1, tip_radius=0.005)
    with pytest.raises(InvalidDesign, match=r"tip_radius = 0: must be a finite number > 0 m"):
        LinearTaper(length=0.3, outer_radius=0.02, tip_radius=0)


def test_numpy_scalars_are_taken_as_numbers():
    profile = LinearTaper(length=np.int64(1), outer_radius=np.float32(0.5), taper=np.float64(0.1))
    assert [type(value) for value in vars(profile).values()] == [float] * 3
    assert hash(profile) == hash(LinearTaper(length=1, outer_radius=0.5, taper=0.1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"length": 0.0}, "length = 0: .*> 0"),
        ({"length": "1"}, "length = '1'"),
        ({"length": None}, "length: must be a finite number > 0"),
        ({"length": True}, "length = True"),
        ({"outer_radius": math.inf}, "outer_radius = inf"),
        ({"taper": math.nan}, "taper = nan"),
        ({"taper": None}, "taper: must be a finite number"),
        ({"taper": 0.07}, r"taper = 0.07: leaves no tip.*must be a finite number < 0.0624188 rad"),
    ],
)
def test_an_impossible_taper_is_refused(change, message):
    with pytest.raises(InvalidDesign, match=message):
        LinearTaper(**({"length": 1.0, "outer_radius": 1 / 16} | change))
