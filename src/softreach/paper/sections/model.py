"""Section 2: the model and the minimal design (figures 1b to 1d)."""

from __future__ import annotations

from typing import Any

import numpy as np

from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, judged
from softreach.plot import DesignPanel, plot_designs
from softreach.rod.kinematics import tip_positions
from softreach.rod.summary import describe


def computed(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """The design, its angles, its symmetry."""
    arm = minimal_trunk(taper=np.radians(3))
    _draw(arm, notes)
    facts = describe(arm)
    # between the right-handed bundle and the longitudinal one at the tip
    angles = arm.outline(arm.length).center[0]
    apart = (angles[1] - angles[2] + np.pi) % (2 * np.pi) - np.pi
    gap = abs(apart) - arm.outline(0.0).extent[1:].mean()
    corners = [minimal_trunk(np.radians(o), np.radians(p)) for o in (0, 108) for p in (0, 3)]
    return {
        "narrowing": facts.taper_ratio,
        "helical_angle_deg": float(np.degrees(facts.helical_angles[1])),
        "gap_deg": float(np.degrees(gap)),
        "asymmetry": max(_asymmetry(corner, settings.seed) for corner in corners),
    }


def meeting(n: Numbers) -> Finding:
    words = f"at Z = L the edges of the sectors are {abs(n.gap_deg):.2g}° apart"
    return judged(words, abs(n.gap_deg) < 1.0)


def narrowing(n: Numbers) -> Finding:
    return judged(f"{n.narrowing:.2f}-fold", round(n.narrowing, 1) == 6.2)


def symmetry(n: Numbers) -> Finding:
    words = f"exchanging the helical activations mirrors the tip to within {n.asymmetry:.1e} L"
    return judged(words, n.asymmetry < 1e-9)


def _asymmetry(arm: Manipulator, seed: int) -> float:
    """Distance of tips of exchanged helical activations from mirror images [L]."""
    low, high = arm.bounds.T
    gamma = np.random.default_rng(seed).uniform(low, high, (2_000, 3))
    tips, others = tip_positions(arm, gamma), tip_positions(arm, gamma[:, [1, 0, 2]])
    return float(np.abs(tips * [-1, 1, 1] - others).max() / arm.length)


def _draw(arm: Manipulator, notes: Notebook) -> None:
    words = "A helical fiber of the tapered arm, and its cross-section at the base and halfway."
    helix = [DesignPanel("Ω = 108°, left", arm, "left", [1])]
    figure = plot_designs(helix, stations_over_length=(0.0, 0.5), width=1.8)
    notes.draw("1b", "figure_1b_fiber", words, figure)
    words = "The three architectures alone, each above its bundle's place in the cross-section."
    sides = enumerate(("back", "back", "front"))
    singles = [DesignPanel(f"{arm.bundle_names[k]}, {side}", arm, side, [k]) for k, side in sides]
    notes.draw("1c", "figure_1c_architectures", words, plot_designs(singles))
    words = "The minimal design from the front and the back, above its cross-section at the base."
    both = [DesignPanel("front", arm), DesignPanel("back", arm, "back")]
    notes.draw("1d", "figure_1d_design", words, plot_designs(both))
