# ruff: noqa: I001  (several names a line)
from . import arm as arm, atlas as atlas, calibration as calibration, cloud as cloud
from . import exchange as exchange, export as export, forces as forces, inverse as inverse
from . import models as models, optimization as optimization, plot as plot
from . import requirements as requirements
from . import rod as rod, stiffness as stiffness, workspace as workspace
from .arm import Base as Base, Chamber as Chamber, FiberArchitecture as FiberArchitecture
from .arm import LinearTaper as LinearTaper, Loads as Loads, Manipulator as Manipulator
from .arm import Material as Material, PiecewiseTaper as PiecewiseTaper, Ring as Ring
from .arm import SampledTaper as SampledTaper, Section as Section, Tendon as Tendon
from .arm import designs as designs
from .atlas import DesignSpace as DesignSpace, build_atlas as build_atlas, open_atlas as open_atlas
from .calibration import calibrate as calibrate
from .cloud import compute_cloud as compute_cloud, curvature as curvature, dexterity as dexterity
from .cloud import open_cloud as open_cloud, redundancy as redundancy, save_cloud as save_cloud
from .cloud import volume as volume
from .cloud.cells import reached_cells as reached_cells
from .cloud.redundancy import activation_distance as activation_distance
from .cloud.volume import concave_hull as concave_hull, convex_hull as convex_hull
from .inverse import path as path, solve_inverse as solve_inverse
from .inverse.path import track_path as track_path
from .models import Tracker as Tracker
from .optimization import search as search
from .requirements import Requirements as Requirements, check as check
from .rod import configuration as configuration, describe as describe, equilibria as equilibria
from .rod import rest as rest, tip_jacobian as tip_jacobian, tip_positions as tip_positions
from .support import errors as errors
from .support.errors import InvalidDesign as InvalidDesign, InvalidInput as InvalidInput
from .support.errors import NotPossible as NotPossible
from .workspace import payload as payload, reachable_set as reachable_set
from .workspace import volume_gradient as volume_gradient
from .workspace.payload import payload_curve as payload_curve

__version__: str
