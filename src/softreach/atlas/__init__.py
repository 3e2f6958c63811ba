"""Reachability clouds of whole families of designs: built, resumed, opened, asked."""

from softreach.atlas.best import best_designs
from softreach.atlas.build import build_atlas
from softreach.atlas.executor import worker_processes
from softreach.atlas.metrics import METRICS
from softreach.atlas.reading import (
    AtlasStatus,
    atlas_cloud,
    atlas_design,
    atlas_status,
    open_atlas,
)
from softreach.atlas.space import DesignSpace
from softreach.atlas.store import StoreFailed

__all__ = [
    "METRICS",
    "AtlasStatus",
    "DesignSpace",
    "StoreFailed",
    "atlas_cloud",
    "atlas_design",
    "atlas_status",
    "best_designs",
    "build_atlas",
    "open_atlas",
    "worker_processes",
]
