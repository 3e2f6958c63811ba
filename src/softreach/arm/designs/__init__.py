"""Named designs, each with its source; one file for each family."""

from softreach.arm.designs.chamber import three_chamber_arm
from softreach.arm.designs.filament import filament
from softreach.arm.designs.laboratory import lce_arm
from softreach.arm.designs.muscle import elephant_trunk
from softreach.arm.designs.paper import minimal_trunk, redundant_trunk
from softreach.arm.designs.tendon import helical_tendon_robot, three_tendon_robot

__all__ = [
    "elephant_trunk",
    "filament",
    "helical_tendon_robot",
    "lce_arm",
    "minimal_trunk",
    "redundant_trunk",
    "three_chamber_arm",
    "three_tendon_robot",
]
