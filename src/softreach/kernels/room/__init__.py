"""Kernels of arms among solids, and the kinds of solids that they know."""

HALF_SPACE, BOX, SPHERE, CYLINDER, TUBE, MESH = range(6)
NUMBERS = 9
"""Of a solid; those that a kind does not need are 0."""
