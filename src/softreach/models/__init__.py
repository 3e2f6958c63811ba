"""Arms as models of other programs, which simulate them."""

from softreach.models.mjcf import mujoco, write_mujoco

__all__ = ["mujoco", "write_mujoco"]
