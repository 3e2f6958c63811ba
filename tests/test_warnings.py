"""Warnings name the line of whoever called softreach, and are silenced on one thread only."""

from __future__ import annotations

import threading
import warnings

import numpy as np
import pytest

import softreach as sr
from softreach.rod import tip_map
from softreach.sampling import sample_cube
from softreach.support.errors import SoftreachWarning, no_warnings, warn
from tests.bodies import rubber


def too_soft() -> sr.Manipulator:
    return rubber(sr.designs.minimal_trunk(), sr.Loads(gravity=(0.0, 0.0, -9.81)), young=3e4)


def sparse_hull() -> None:
    cloud = sr.compute_cloud(sr.designs.minimal_trunk(), 500)
    sr.concave_hull(cloud.tip.values, alpha=0.01)


CAUSES = {"loads": lambda: tip_map(too_soft()), "hull": sparse_hull}


@pytest.mark.parametrize("cause", CAUSES.values(), ids=CAUSES.keys())
def test_a_warning_names_the_line_of_the_caller(cause):
    with pytest.warns(SoftreachWarning) as caught:
        cause()
    assert {warning.filename for warning in caught} == {__file__}


def test_what_one_thread_silences_another_still_says():
    silenced, said = threading.Event(), threading.Event()

    def silent() -> None:
        with no_warnings():
            silenced.set()
            said.wait()
            warn("silent")

    thread = threading.Thread(target=silent)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        thread.start()
        silenced.wait()
        warn("loud")
        said.set()
        thread.join()
    assert [str(warning.message) for warning in caught] == ["loud"]


def test_sobol_points_in_blocks_are_those_of_one_draw_without_a_warning():
    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        points = sample_cube("sobol", 64, 3, 5)
    expected = qmc.Sobol(3, scramble=True, rng=np.random.default_rng(5)).random(64)
    np.testing.assert_array_equal(points, expected)
