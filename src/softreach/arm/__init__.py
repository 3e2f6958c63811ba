"""An arm as a value: profile, section, actuators, and the tables that follow from them."""

from softreach.arm import designs
from softreach.arm.actuators import Actuator, FiberArchitecture, Outline, Resultants
from softreach.arm.manipulator import Manipulator
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.section import Material, Ring, Section, Stiffness
from softreach.arm.summary import DesignSummary, describe

__all__ = [
    "Actuator",
    "DesignSummary",
    "FiberArchitecture",
    "LinearTaper",
    "Manipulator",
    "Material",
    "Outline",
    "Profile",
    "Resultants",
    "Ring",
    "Section",
    "Stiffness",
    "describe",
    "designs",
]
