"""Arms as models of other programs, which simulate them, and control steps."""

from softreach.models.mjcf import mujoco, write_mujoco
from softreach.models.tracker import Tracker, TrackingStep

__all__ = ["Tracker", "TrackingStep", "mujoco", "write_mujoco"]
