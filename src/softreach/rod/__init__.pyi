# ruff: noqa: I001  (several names a line)
from . import rest as rest
from .clearance import compute_clearance as compute_clearance
from .inputs import ActivationBox as ActivationBox
from .kinematics import configuration as configuration, marker_positions as marker_positions
from .kinematics import tip_jacobian as tip_jacobian, tip_positions as tip_positions
from .loaded.all_equilibria import equilibria as equilibria
from .loaded.rod import LoadedRod as LoadedRod
from .loaded.solver import Equilibria as Equilibria
from .rods import ArmMap as ArmMap, as_tip_map as as_tip_map, free_bundles as free_bundles
from .summary import DesignSummary as DesignSummary, describe as describe
from .tip_map import TipMap as TipMap, TipStatus as TipStatus
