"""What the studio says of the numbers of an atlas."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.atlas import DesignSpace, build_atlas, open_atlas
from softreach.studio.atlas_map import nearest_numbers
from softreach.support.errors import SoftreachWarning


def atlas_of(path, n, metrics):
    space = DesignSpace.grid(designs.minimal_trunk(), revolution=[1.0, 2.0], taper=[0.0, 0.02])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)  # too few samples for the radius
        build_atlas(space, path, n=n, metrics=metrics, progress=lambda _: None)
    return open_atlas(path)


@pytest.fixture(scope="module")
def atlas(tmp_path_factory):
    return atlas_of(tmp_path_factory.mktemp("few") / "a.zarr", 500, ("exact", "concave"))


@pytest.mark.parametrize("metric", ["volume", "exact_volume"])
def test_both_volumes_of_the_nearest_design_are_told_and_why_they_differ(atlas, metric):
    design = changed(designs.minimal_trunk(), {"revolution": 1.9, "taper": 0.018})
    text = nearest_numbers(atlas, metric, design)
    here = {"revolution": 1, "taper": 1}
    assert "revolution 114.6 deg, taper 1.146 deg" in text
    assert f"{float(atlas.exact_volume.isel(here)):.4g} exact" in text
    assert f"{float(atlas.volume.isel(here)):.4g} of the α-shape of 500 samples" in text
    assert "too few" in text


def test_an_unreachability_is_told_in_percent(atlas):
    text = nearest_numbers(atlas, "unreachability", designs.minimal_trunk())
    exact = atlas.exact_unreachability.isel(revolution=1, taper=1)
    assert f"UNR {100 * float(exact):.4g} % exact" in text


@pytest.mark.large
def test_enough_samples_are_not_called_too_few(tmp_path):
    dense = atlas_of(tmp_path / "a.zarr", 200_000, ("exact", "concave"))
    text = nearest_numbers(dense, "volume", designs.minimal_trunk())
    assert "too few" not in text
    assert "bridges gaps and hollows narrower than 0.1 L" in text


def test_a_metric_without_a_counterpart_is_told_alone(atlas):
    text = nearest_numbers(atlas, "fold_volume", designs.minimal_trunk())
    assert np.isfinite(float(text.removesuffix(".").rsplit(" ", 1)[1]))


def test_the_nearest_design_is_near_to_all_parts(atlas):
    design = changed(designs.minimal_trunk(), {"left.revolution": -1.0, "right.revolution": 2.4})
    assert "revolution 114.6 deg" in nearest_numbers(atlas, "volume", design)
