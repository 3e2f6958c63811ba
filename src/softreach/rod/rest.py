"""The arm at rest under its loads: how far its tip sags, and whether it stays there."""

from dataclasses import dataclass

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.rod.tip_map import TipStatus
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput


@dataclass(frozen=True)
class Rest:
    """Equilibrium of an arm that nothing drives."""

    activation: Array
    """The activation of least size within the bounds, zero where these hold it [unit]."""
    tip: Array
    """Tip of the loaded arm in the world [m]; NaN without equilibrium."""
    sag: float
    """Distance by which the loads move the tip [m]; NaN without equilibrium."""
    sag_over_length: float
    """The same over the length of the arm [-]."""
    status: TipStatus
    """Status of the equilibrium: stable or not, or none found."""


def rest(arm: Manipulator) -> Rest:
    """The arm at rest under its loads.

    Args:
        arm: The design with its loads.

    Raises:
        InvalidInput: An arm without loads, or with loads too heavy to be followed along it.
        InvalidDesign: The activation at rest would shorten the arm to nothing.
    """
    arm = a_manipulator("arm", arm)
    if arm.loads is None:
        raise InvalidInput("loads", None, "given", "arm.replace(loads=Loads(...)) gives some")
    activation = np.clip(0.0, *arm.input_bounds.T)
    # Nothing but rest is asked for, and the steps need suit no other activation.
    plain = bool(arm.bundles) and not arm.drives
    held = arm.with_bounds(np.stack([activation, activation], axis=1)) if plain else arm
    held_map = with_unstable(as_tip_map(held, warn=False))
    (tip,), (status,) = held_map.tips_and_status(activation[None])
    free = as_tip_map(held.replace(loads=None)).tips(activation[None])[0]
    sag = float(np.linalg.norm(tip - free))
    return Rest(activation, tip, sag, sag / arm.length, TipStatus(int(status)))
