"""Laws across breakpoints: the integrator's order, the tolerance, stations and frames there."""

from __future__ import annotations

import itertools
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import softreach as sr
from softreach.arm import (
    Chamber,
    FiberArchitecture,
    Manipulator,
    Material,
    Pieces,
    PiecewiseTaper,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.tables import tables
from softreach.kernels.rod import tips as rod
from softreach.rod.free import FreeRod
from softreach.rod.rods import as_tip_map, in_steps
from tests.kinds import any_arms, driven
from tests.laws import in_box
from tests.rod.test_steps import tip_error

RUBBER = Material(young_modulus=1e6, poisson_ratio=0.45)
SECTION = Section(
    rings=(
        Ring(inner_ratio=0.8, material=RUBBER, name="outer"),
        Ring(inner_ratio=0.4, outer_ratio=0.7, material=RUBBER, name="inner"),
    ),
    core=Material(young_modulus=2e5),
)


def broken():
    """Breakpoints of every kind: profile, angles, routing, and the ends of segments."""
    parts = (
        FiberArchitecture(
            name="sampled",
            helical_angle=Samples(stations_over_length=(0, 0.2, 0.7, 1), values=(0, 0.3, 0.5, 0.2)),
            extent=0.8,
        ),
        FiberArchitecture(
            name="pieces",
            ring="inner",
            helical_angle=Pieces(stations_over_length=(0, 0.55, 1), values=(-0.3, 0.4)),
            extent=0.8,
            offset=2.0,
            end_over_length=0.83,
        ),
        FiberArchitecture(
            name="segment", revolution=1.0, extent=0.8, offset=4.0, start_over_length=0.41
        ),
        Tendon(
            name="tendon",
            distance_ratio=0.9,
            routing=Samples(
                stations_over_length=(0, 0.5, 1), values=(0, 1.5, 0), interpolation="linear"
            ),
            end_over_length=0.9,
            activation_bounds=(0, 1),
        ),
        Chamber(
            name="chamber",
            distance_ratio=0.5,
            radius_ratio=0.2,
            offset=1.0,
            start_over_length=0.1,
            end_over_length=0.3,
            activation_bounds=(0, 1),
        ),
    )
    profile = PiecewiseTaper(
        length=1.0, stations_over_length=(0, 0.37, 1), radii=(0.06, 0.05, 0.03)
    )
    return driven(Manipulator(profile=profile, section=SECTION, actuators=parts), sharpness=5.0)


BREAKS = (0.1, 0.2, 0.3, 0.37, 0.41, 0.5, 0.55, 0.7, 0.83, 0.9)


def walked(arm, gamma, ends):
    """Places and directors at the ends of pieces, by SciPy's eighth-order integrator.

    Each piece is walked on its own and takes its end from inside.
    """

    def rates(z, state, last):
        table = tables(arm, [min(z, last)])
        directors = state[3:].reshape(3, 3)
        zeta, eta = 1.0 + table.extension[0] @ gamma, 1.0 + table.rest_length_factor[0] @ gamma
        u = (table.curvature[0] @ gamma) @ directors
        return np.concatenate([zeta * directors[2], (eta * np.cross(u, directors)).ravel()])

    state = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    states = [state]
    for low, high in pairwise(ends):
        last = np.nextafter(high, low) if high < arm.length else high
        found = solve_ivp(
            rates, (low, high), state, method="DOP853", args=(last,), rtol=1e-12, atol=1e-13
        )
        state = found.y[:, -1]
        states.append(state)
    return np.array(states)


def tips(rule, edges, gamma):
    """Tips with these step boundaries."""
    out = np.empty((len(gamma), 3))
    rod.tips(rod.pack(*rule.nodes(edges)), gamma, out)
    return out


def halved(edges):
    middles = 0.5 * (edges[:-1] + edges[1:])
    return np.append(np.column_stack([edges[:-1], middles]).ravel(), edges[-1])


def orders(rule, edges, gamma, times):
    """How many times the error is halved with each halving of the steps."""
    found = []
    for _ in range(times + 2):
        found.append(tips(rule, edges, gamma))
        edges = halved(edges)
    apart = [np.abs(a - b).max() for a, b in pairwise(found)]
    return np.log2(np.array(apart[:-1]) / apart[1:])


def test_every_breakpoint_of_profile_angles_routing_and_segments_is_known():
    np.testing.assert_allclose(broken().breakpoints, BREAKS, rtol=1e-14)


def test_the_order_of_the_integrator_stays_across_breakpoints():
    arm = broken()
    rule = FreeRod(arm).rule
    found = orders(rule, rule.edges(20), in_box(arm, 20), times=2)
    np.testing.assert_allclose(found, 6.0, atol=0.3)


@pytest.mark.parametrize("gone", range(len(BREAKS)))
def test_no_breakpoint_can_be_left_out(gone):
    """Without any one of them as a boundary the error is larger many times."""
    arm = broken()
    rule, gamma = FreeRod(arm).rule, in_box(arm, 10)
    marks = rule.edges(1)
    assert len(marks) == len(BREAKS) + 2
    fewer = np.delete(marks, gone + 1)
    for _ in range(3):
        marks, fewer = halved(marks), halved(fewer)
    exact = tips(rule, rule.edges(400), gamma)
    kept, lost = (np.abs(tips(rule, edges, gamma) - exact).max() for edges in (marks, fewer))
    assert lost > 5 * kept


@pytest.fixture(scope="module")
def walk():
    """Where the walk is at the base, at every breakpoint, at 0.95 and at the tip."""
    arm = broken()
    ends = np.array([0.0, *arm.breakpoints, 0.95, arm.length])
    return ends, walked(arm, in_box(arm, 1)[0], ends)


@given(arm=any_arms(), tol=st.sampled_from([1e-4, 1e-6, 1e-8]))
def test_the_tolerance_is_met_for_arms_of_any_kind(arm, tol):
    """At corners of the box, inside it, and uphill from the worst of them."""
    corners = np.array(list(itertools.islice(itertools.product(*arm.bounds), 256)))
    error = tip_error(arm, tol)
    gamma = np.concatenate([corners, in_box(arm, 300)])
    rng, (low, high) = np.random.default_rng(0), arm.bounds.T
    for scale in (0.3, 0.1, 0.03):
        worst = gamma[np.argsort(error(gamma))[-10:]]
        nudged = np.repeat(worst, 20, axis=0) + scale * (high - low) * rng.normal(
            size=(200, arm.bundles)
        )
        gamma = np.concatenate([worst, np.clip(nudged, low, high)])
    assert error(gamma).max() <= tol


@settings(max_examples=8)
@given(arm=any_arms())
def test_the_tolerance_holds_along_arms_of_any_kind(arm):
    tol, gamma = 1e-6, in_box(arm, 20)
    z = np.union1d(np.linspace(0, arm.length, 7), arm.breakpoints)
    coarse, fine = (FreeRod(arm, t).frames(gamma, z).position for t in (tol, 1e-10))
    assert np.linalg.norm(coarse - fine, axis=-1).max() <= tol * arm.length


def test_stations_on_and_beside_breakpoints_have_the_places_and_frames_of_the_walk(walk):
    arm, (inner, states) = broken(), walk
    gamma = in_box(arm, 1)
    beside = [z + side for z in arm.breakpoints for side in (-1e-13, 0.0, 1e-13, 1e-6)]
    z = np.array(sorted([0.0, *beside, 0.95, arm.length]))
    places, directors = (found[0] for found in FreeRod(arm, 1e-11).frames(gamma, z))
    nearest = np.abs(z[:, None] - inner).argmin(axis=1)
    close = np.abs(z - inner[nearest]) < 1e-12
    assert close.sum() == 3 * len(BREAKS) + 3
    np.testing.assert_allclose(places[close], states[nearest[close], :3], atol=1e-10)
    turned = directors[close].reshape(-1, 9)
    np.testing.assert_allclose(turned, states[nearest[close], 3:], atol=1e-9)
    beyond = np.abs(z - inner[nearest] - 1e-6) < 1e-9
    zeta = 1.0 + tables(arm, z[beyond]).extension @ gamma[0]
    along = 1e-6 * zeta[:, None] * states[nearest[beyond], 9:]
    ahead = states[nearest[beyond], :3] + along
    np.testing.assert_allclose(places[beyond], ahead, atol=1e-10)


def test_strains_at_a_breakpoint_are_those_of_the_piece_that_begins_there():
    """At the base too; and at the tip those of the piece that ends."""
    arm = broken()
    z = np.array([0.0, *BREAKS])
    rod = FreeRod(arm, 1e-6)
    here, after, before = (
        rod.strains(in_box(arm, 1), places).curvature[0]
        for places in (z, z + 1e-12, z - 1e-12 * (z > 0))
    )
    np.testing.assert_allclose(here, after, rtol=1e-9, atol=1e-9)
    jumps = dict(zip(z, np.abs(here - before).max(axis=1), strict=True))
    assert min(jumps[end] for end in (0.1, 0.3, 0.41, 0.83, 0.9)) > 1e-3  # ends of segments
    assert min(jumps[end] for end in (0.5, 0.55)) > 1e-3  # kinks of routing and angle
    last = rod.strains(in_box(arm, 1), [1 - 1e-12, 1.0]).curvature[0]
    np.testing.assert_allclose(last[1], last[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("kind", "loads"),
    [(SampledTaper, None), (PiecewiseTaper, None), (SampledTaper, sr.Loads())],
    ids=["sampled", "piecewise", "loaded"],
)
def test_many_samples_of_a_radius_cost_no_more_steps_than_tips_need(kind, loads):
    """A step ends where a bundle does, but at no sample of a smooth profile."""
    stations = np.linspace(0.0, 1.0, 202)
    radii = 0.05 - 0.02 * stations + 0.002 * np.sin(9.0 * stations)
    profile = kind(
        length=1.0, stations_over_length=tuple(stations.tolist()), radii=tuple(radii.tolist())
    )
    fibers = [
        FiberArchitecture(revolution=1.0, extent=0.8, name="long"),
        FiberArchitecture(
            revolution=0.0, extent=0.8, offset=2.0, name="short", end_over_length=0.6123
        ),
    ]
    material = Material(young_modulus=1e7, poisson_ratio=0.5, density=1000.0)
    section = Section(rings=(Ring(inner_ratio=0.5, material=material),))
    arm = Manipulator(profile=profile, section=section, actuators=tuple(fibers), loads=loads)
    rod = as_tip_map(arm)
    assert rod.steps < 50
    assert arm.profile.slender_coordinate(0.6123) in FreeRod(arm, 1e-6).rule.edges(rod.steps)
    gamma = in_box(arm, 30)
    exact = in_steps(arm, 400, rod)
    np.testing.assert_allclose(rod.tips(gamma), exact.tips(gamma), rtol=0, atol=1e-6)
