"""Arms for simulators, controllers and makers: models, kinematics, control steps, parts."""

from softreach.models.c_source import c as c
from softreach.models.elastica import ElasticaArm as ElasticaArm
from softreach.models.elastica import pyelastica as pyelastica
from softreach.models.inverse_table import InverseTable as InverseTable
from softreach.models.inverse_table import inverse_table as inverse_table
from softreach.models.local_model import LocalModel as LocalModel
from softreach.models.local_model import local_model as local_model
from softreach.models.mjcf import mujoco as mujoco
from softreach.models.pattern import pattern as pattern
from softreach.models.solids import solids as solids
from softreach.models.tracker import Tracker as Tracker
from softreach.models.tracker import TrackingStep as TrackingStep
