"""Laws of the pictures of designs: sectors where the bundles are, one scale, curves in L."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.plot import DesignPanel, plot_cross_section, plot_designs, plot_volume_curve
from softreach.support.errors import InvalidInput
from softreach.support.palette import bundle_color

plt = pytest.importorskip("matplotlib.pyplot")


def sectors(ax):
    from matplotlib.patches import Wedge

    wedges = [patch for patch in ax.patches if isinstance(patch, Wedge)]
    return [wedge for wedge in wedges if not wedge.get_hatch()]  # not what sectors share


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_sectors_stand_where_the_bundles_are_at_that_station(share):
    arm = designs.redundant_trunk(length=2.0)
    ax = plot_cross_section(arm, share * arm.length)
    angles = np.degrees(arm.outline(share * arm.length).center[0])
    assert len(sectors(ax)) == arm.bundles
    for k, wedge in enumerate(sectors(ax)):
        assert (wedge.theta1 + wedge.theta2) / 2 == pytest.approx(angles[k])
        assert wedge.theta2 - wedge.theta1 == pytest.approx(48)
        assert wedge.r == pytest.approx(float(arm.profile.radius(share * arm.length)) / arm.length)
        assert wedge.width == pytest.approx(0.25 * wedge.r)
        assert wedge.get_facecolor()[:3] == bundle_color(k)


def test_some_bundles_keep_their_colors(trunk):
    (wedge,) = sectors(plot_cross_section(trunk, bundles=[2]))
    assert wedge.get_facecolor()[:3] == bundle_color(2)


def test_designs_and_their_sections_share_one_scale():
    panels = [
        DesignPanel(name, getattr(designs, f"{name}_trunk")()) for name in ("minimal", "redundant")
    ]
    figure = plot_designs(panels, stations_over_length=(0.0, 0.5))
    arms, base, middle = np.array(figure.axes).reshape(3, 2)
    assert [ax.get_title() for ax in arms] == ["minimal", "redundant"]
    assert len({(*ax.get_xlim(), *ax.get_ylim()) for ax in arms}) == 1
    assert len({(*ax.get_xlim(), *ax.get_ylim()) for ax in (*base, *middle)}) == 1
    assert [len(sectors(ax)) for ax in base] == [3, 4]


def test_stations_off_the_arm_are_refused(trunk):
    with pytest.raises(InvalidInput, match=r"z = 1.5: must be within \[0, 1\] m"):
        plot_cross_section(trunk, 1.5)


def test_volume_curves_are_drawn_in_lengths():
    ax = plot_volume_curve({"a": [0.8, 1.6]}, [0.1, 0.2], length=2.0, exact=4.0)
    curve, exact = ax.lines
    np.testing.assert_allclose(curve.get_xydata(), [[0.05, 0.1], [0.1, 0.2]])
    np.testing.assert_allclose(exact.get_ydata(), 0.5)


def test_volumes_of_other_radii_are_refused():
    with pytest.raises(InvalidInput, match=r"a = \(3,\): must be volumes of \(2,\) radii"):
        plot_volume_curve({"a": [1, 2, 3]}, [0.1, 0.2])
