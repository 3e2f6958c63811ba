"""Requirements of an arm: places, regions, bounds; met or missed, and by how much."""

from softreach.requirements.checks import Check, Coverage, check
from softreach.requirements.findings import Finding, quick_excess
from softreach.requirements.parts import Keep, Limits, Target
from softreach.requirements.regions import Box, HalfSpace, Mesh, Region, Sphere
from softreach.requirements.requirements import Requirements

__all__ = ["Box", "Check", "Coverage", "Finding", "HalfSpace", "Keep", "Limits", "Mesh", "Region"]
__all__ += ["Requirements", "Sphere", "Target", "check", "quick_excess"]
