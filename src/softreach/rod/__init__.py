"""The rod: activation box, tip map, and the kinematics that a user asks."""

from softreach.rod.activation_box import ActivationBox
from softreach.rod.kinematics import configuration, tip_jacobian, tip_positions
from softreach.rod.tip_map import Frames, StrainRange, Strains, TipMap, TipStatus, tip_map

__all__ = [
    "ActivationBox",
    "Frames",
    "StrainRange",
    "Strains",
    "TipMap",
    "TipStatus",
    "configuration",
    "tip_jacobian",
    "tip_map",
    "tip_positions",
]
