"""Kernels of arms among solids."""
