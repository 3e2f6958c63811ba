"""Actuators of an arm: a file for each family."""

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.actuators.chamber import Chamber
from softreach.arm.actuators.fiber import FiberArchitecture
from softreach.arm.actuators.muscle import ObliqueMuscle, RadialMuscle
from softreach.arm.actuators.sector import SectorActuator
from softreach.arm.actuators.tendon import LengthTendon, Tendon

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
