"""Numba kernels on plain arrays: no robots, no files, no printing."""
