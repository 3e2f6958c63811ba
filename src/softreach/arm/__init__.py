"""An arm as a value: profile, section, actuators, and the tables that follow from them."""

from softreach.arm import designs
from softreach.arm.actuators import (
    Actuator,
    Chamber,
    FiberArchitecture,
    LengthTendon,
    ObliqueMuscle,
    Outline,
    RadialMuscle,
    Resultants,
    SectorActuator,
    Tendon,
)
from softreach.arm.actuators.sector import RingIntegrals
from softreach.arm.along import AlongArm, Pieces, Samples
from softreach.arm.base import Base
from softreach.arm.body import RestShape
from softreach.arm.drives import Drive
from softreach.arm.lines import limit_shortening, line_lengths
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material, material_names, named_material
from softreach.arm.profile import LinearTaper, PiecewiseTaper, Profile, SampledTaper
from softreach.arm.section import Layer, Measured, Ring, Section, Stiffness
from softreach.arm.stations import Marker, RigidPiece

__all__ = [
    "Actuator",
    "AlongArm",
    "Base",
    "Chamber",
    "Drive",
    "FiberArchitecture",
    "Layer",
    "LengthTendon",
    "LinearTaper",
    "Loads",
    "Manipulator",
    "Marker",
    "Material",
    "Measured",
    "ObliqueMuscle",
    "Outline",
    "Pieces",
    "PiecewiseTaper",
    "PointLoad",
    "Profile",
    "RadialMuscle",
    "RestShape",
    "Resultants",
    "RigidPiece",
    "Ring",
    "RingIntegrals",
    "SampledTaper",
    "Samples",
    "Section",
    "SectorActuator",
    "Stiffness",
    "Tendon",
    "designs",
    "limit_shortening",
    "line_lengths",
    "material_names",
    "named_material",
]
