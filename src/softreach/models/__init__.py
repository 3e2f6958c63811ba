"""Arms for simulators, controllers and makers: models, kinematics, control steps, parts."""

from softreach.models.c_source import c
from softreach.models.elastica import ElasticaArm, pyelastica
from softreach.models.inverse_table import InverseTable, inverse_table
from softreach.models.local_model import LocalModel, local_model
from softreach.models.mjcf import mujoco
from softreach.models.pattern import pattern
from softreach.models.solids import solids
from softreach.models.tracker import Tracker, TrackingStep

__all__ = [
    "ElasticaArm",
    "InverseTable",
    "LocalModel",
    "Tracker",
    "TrackingStep",
    "c",
    "inverse_table",
    "local_model",
    "mujoco",
    "pattern",
    "pyelastica",
    "solids",
]
