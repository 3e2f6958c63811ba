"""Actuators of an arm: a file for each family."""

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.actuators.fiber import FiberArchitecture, ObliqueMuscle, RadialMuscle
from softreach.arm.actuators.line import Chamber, LengthTendon, Tendon
from softreach.arm.actuators.sector import SectorActuator

__all__ = [
    "Actuator",
    "Chamber",
    "FiberArchitecture",
    "LengthTendon",
    "ObliqueMuscle",
    "Outline",
    "RadialMuscle",
    "Resultants",
    "SectorActuator",
    "Tendon",
]
