# ruff: noqa: I001  (several names a line)
from . import designs as designs
from .actuators import Actuator as Actuator, Chamber as Chamber
from .actuators import FiberArchitecture as FiberArchitecture, LengthTendon as LengthTendon
from .actuators import ObliqueMuscle as ObliqueMuscle, Outline as Outline
from .actuators import RadialMuscle as RadialMuscle, Resultants as Resultants
from .actuators import SectorActuator as SectorActuator, Tendon as Tendon
from .base import Base as Base
from .body import RestShape as RestShape
from .drives import Drive as Drive
from .loads import Loads as Loads, PointLoad as PointLoad
from .manipulator import Manipulator as Manipulator
from .obstacles import Obstacle as Obstacle
from .part import Pieces as Pieces, Samples as Samples
from .profile import LinearTaper as LinearTaper, PiecewiseTaper as PiecewiseTaper
from .profile import Profile as Profile, SampledTaper as SampledTaper
from .section import Material as Material, Measured as Measured, Ring as Ring, Section as Section
from .section import material_names as material_names, named_material as named_material
from .stations import Marker as Marker, RigidPiece as RigidPiece
