"""Actuators of an arm: one file for each kind."""

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.actuators.chamber import Chamber
from softreach.arm.actuators.fiber import FiberArchitecture
from softreach.arm.actuators.length_tendon import LengthTendon
from softreach.arm.actuators.muscle import ObliqueMuscle, RadialMuscle
from softreach.arm.actuators.sector import SectorActuator
from softreach.arm.actuators.tendon import Tendon

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
