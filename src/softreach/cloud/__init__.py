"""Reachability clouds, and everything asked of their samples."""

from softreach.cloud.clouds import (
    compute_cloud,
    design_of,
    open_cloud,
    save_cloud,
    tip_map_of,
)

__all__ = ["compute_cloud", "design_of", "open_cloud", "save_cloud", "tip_map_of"]
