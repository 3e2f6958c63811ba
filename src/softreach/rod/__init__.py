"""The rod: activation box, tip map, and the kinematics that a user asks."""

from softreach.rod.activation_box import ActivationBox
from softreach.rod.kinematics import configuration, marker_positions, tip_jacobian, tip_positions
from softreach.rod.loaded.all_equilibria import AllEquilibria, equilibria
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.shapes import Shapes
from softreach.rod.loaded.shooting import Equilibria, Rung
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import Frames, StrainRange, Strains, TipMap, TipMotions, TipStatus
from softreach.rod.view import View, free_bundles

__all__ = [
    "ActivationBox",
    "AllEquilibria",
    "Equilibria",
    "Frames",
    "LoadedRod",
    "Rung",
    "Shapes",
    "StrainRange",
    "Strains",
    "TipMap",
    "TipMotions",
    "TipStatus",
    "View",
    "configuration",
    "equilibria",
    "free_bundles",
    "marker_positions",
    "tip_jacobian",
    "tip_map",
    "tip_positions",
]
