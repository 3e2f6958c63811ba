"""The rod: activation box, tip map, and the kinematics that a user asks."""

import lazy_loader

from softreach.rod.rods import tip_map as tip_map  # the function, not the module of that name

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
