"""The rod: activation box, tip map, and the kinematics that a user asks."""

from softreach.rod.activation_box import ActivationBox
from softreach.rod.all_equilibria import AllEquilibria
from softreach.rod.equilibria_by_degree import equilibria
from softreach.rod.found_equilibria import Equilibria
from softreach.rod.kinematics import configuration, tip_jacobian, tip_positions
from softreach.rod.loaded import LoadedRod
from softreach.rod.rods import tip_map
from softreach.rod.search import Rung
from softreach.rod.tip_map import Frames, StrainRange, Strains, TipMap, TipMotions, TipStatus
from softreach.rod.view import View, free_bundles

__all__ = [
    "ActivationBox",
    "AllEquilibria",
    "Equilibria",
    "Frames",
    "LoadedRod",
    "Rung",
    "StrainRange",
    "Strains",
    "TipMap",
    "TipMotions",
    "TipStatus",
    "View",
    "configuration",
    "equilibria",
    "free_bundles",
    "tip_jacobian",
    "tip_map",
    "tip_positions",
]
