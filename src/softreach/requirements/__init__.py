"""Requirements of an arm: places, regions, bounds; met or missed, and by how much."""

from softreach.geometry.meshes import Mesh as Mesh
from softreach.geometry.regions import Box as Box
from softreach.geometry.regions import Cylinder as Cylinder
from softreach.geometry.regions import HalfSpace as HalfSpace
from softreach.geometry.regions import Region as Region
from softreach.geometry.regions import Sphere as Sphere
from softreach.geometry.regions import Tube as Tube
from softreach.requirements.checks import Check as Check
from softreach.requirements.checks import Coverage as Coverage
from softreach.requirements.checks import check as check
from softreach.requirements.findings import Finding as Finding
from softreach.requirements.findings import quick_excess as quick_excess
from softreach.requirements.parts import Keep as Keep
from softreach.requirements.parts import Limits as Limits
from softreach.requirements.parts import Target as Target
from softreach.requirements.requirements import Requirements as Requirements
