"""Tabs beside the scene, one a file; what stands above all of them is in `status`."""
