"""Reachability clouds, and everything asked of their samples."""

import lazy_loader

from softreach.cloud.clouds import compute_cloud, design_of, open_cloud, save_cloud, tip_map_of

__all__ = ["compute_cloud", "design_of", "open_cloud", "save_cloud", "tip_map_of"]

__getattr__, _, _ = lazy_loader.attach(
    __name__, submodules=["cells", "curvature", "dexterity", "redundancy", "volume"]
)
