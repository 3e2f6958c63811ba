"""Laws of the volume against the payload."""

from __future__ import annotations

import json

import numpy as np
import pytest

import softreach as sr
from softreach import plot
from softreach.arm.loads import Loads
from softreach.cli.app import run
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.workspace.payload import payload_curve

HANGING = sr.designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81)))


@pytest.fixture(scope="module")
def curve():
    return payload_curve(HANGING, [0.002, 0.001], accuracy=0.02)


def test_a_curve_has_the_exact_volumes_and_begins_without_payload(curve):
    np.testing.assert_array_equal(curve.payloads, [0.0, 0.001, 0.002])
    for mass, volume in zip(curve.payloads, curve.volumes, strict=True):
        carrying = HANGING.replace(loads=HANGING.loads.replace(payload=float(mass)))
        assert volume == sr.reachable_set(carrying, accuracy=0.02).volume
    assert curve.shares[0] == 1.0
    assert (np.diff(curve.shares) < 0).all()


def test_the_payload_of_the_design_itself_does_not_count(curve):
    laden = HANGING.replace(loads=HANGING.loads.replace(payload=0.001))
    np.testing.assert_array_equal(
        payload_curve(laden, [0.002], accuracy=0.02).volumes, curve.volumes[[0, 2]]
    )


def test_the_largest_payload_keeps_just_the_share(curve):
    found = curve.largest_payload(0.85)
    assert found.payload_error <= 0.02 * found.payload
    for sign in (-1, 1):
        mass = found.payload + sign * (found.payload_error + 1e-5)
        carrying = HANGING.replace(loads=HANGING.loads.replace(payload=mass))
        share = sr.reachable_set(carrying, accuracy=0.02).volume / curve.volumes[0]
        assert (share < 0.85) == (sign > 0)


def test_a_share_below_those_of_the_curve_is_looked_for_under_heavier_payloads():
    short = payload_curve(HANGING, [0.0005], accuracy=0.02)
    assert short.largest_payload(0.85).payload == pytest.approx(0.0015, abs=2e-4)


def test_numbers_of_a_curve_are_stored_with_their_errors_and_units(curve):
    stored = curve.to_dataset()
    assert stored.payload.attrs["units"] == "kg"
    np.testing.assert_array_equal(stored["share"], curve.shares)
    assert (stored["share_error"][1:] > 0).all()
    assert "without payload" in repr(curve)


def test_what_has_no_such_curve_is_refused_in_one_line(curve):
    with pytest.raises(InvalidInput, match="loads = None: must be Loads with gravity"):
        payload_curve(sr.designs.lce_arm())
    with pytest.raises(InvalidInput, match="payloads"):
        payload_curve(HANGING, [-1.0])
    with pytest.raises(InvalidInput, match="free bundles = 2"):
        payload_curve(HANGING.with_bounds([(-5, 0), (-5, 0), (-1, -1)]))
    with pytest.raises(InvalidInput, match="share = 1"):
        curve.largest_payload(1.0)
    with pytest.raises(InvalidDesign, match="young_modulus"):
        payload_curve(sr.designs.minimal_trunk().replace(loads=Loads()))


def test_the_figure_has_the_shares_and_the_largest_payload(curve):
    pytest.importorskip("matplotlib")
    largest = curve.largest_payload(0.85)
    ax = plot.plot_payload_curve(curve, largest=[largest])
    line = ax.lines[0].get_xydata()
    assert [largest.payload, 0.85] in line.tolist()
    for point in zip(curve.payloads, curve.shares, strict=True):
        assert list(point) in line.tolist()


def test_the_command_says_the_largest_payload(capsys):
    command = "payload lce_arm --gravity up --payloads 1g,2g --share 0.85"
    assert run([*command.split(), "--accuracy", "0.02", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["largest_payload_kg"] == pytest.approx(0.0015, abs=2e-4)
    assert found["payloads_kg"] == [0.0, 0.001, 0.002]
    assert found["shares_percent"][0] == 100.0
    assert 0 < found["share_errors_percent"][1] < 5
    rough = ["--gravity", "up", "--payloads", "1g", "--accuracy", "0.1"]
    assert run(["payload", "lce_arm", "--payload", "3g", *rough]) == 0
    assert "take the place of the design's own payload, 0.003 kg" in capsys.readouterr().out
    assert run(["payload", "lce_arm"]) == 2
    assert "gravity = None" in capsys.readouterr().err
