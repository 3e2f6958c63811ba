"""Arms as models of other programs, which simulate them or run on controllers; control steps."""

from softreach.models.c_source import c
from softreach.models.inverse_table import InverseTable, inverse_table
from softreach.models.mjcf import mujoco, write_mujoco
from softreach.models.tracker import Tracker, TrackingStep

__all__ = [
    "InverseTable",
    "Tracker",
    "TrackingStep",
    "c",
    "inverse_table",
    "mujoco",
    "write_mujoco",
]
