"""Actuators of an arm: a file for each family."""

from softreach.arm.actuators.actuator import Actuator as Actuator
from softreach.arm.actuators.actuator import Outline as Outline
from softreach.arm.actuators.actuator import Resultants as Resultants
from softreach.arm.actuators.fiber import FiberArchitecture as FiberArchitecture
from softreach.arm.actuators.fiber import ObliqueMuscle as ObliqueMuscle
from softreach.arm.actuators.fiber import RadialMuscle as RadialMuscle
from softreach.arm.actuators.fiber import SectorActuator as SectorActuator
from softreach.arm.actuators.line import Chamber as Chamber
from softreach.arm.actuators.line import LengthTendon as LengthTendon
from softreach.arm.actuators.line import Tendon as Tendon
