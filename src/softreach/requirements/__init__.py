"""Requirements of an arm: places, regions, bounds; met or missed, and by how much."""

from softreach.geometry.meshes import Mesh
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.requirements.checks import Check, Coverage, check
from softreach.requirements.findings import Finding, quick_excess
from softreach.requirements.parts import Keep, Limits, Target
from softreach.requirements.requirements import Requirements

__all__ = [
    "Box",
    "Check",
    "Coverage",
    "Cylinder",
    "Finding",
    "HalfSpace",
    "Keep",
    "Limits",
    "Mesh",
    "Region",
    "Requirements",
    "Sphere",
    "Target",
    "Tube",
    "check",
    "quick_excess",
]
