"""What drives an arm: one file for each kind of actuator."""

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.actuators.fiber import FiberArchitecture

__all__ = ["Actuator", "FiberArchitecture", "Outline", "Resultants"]
