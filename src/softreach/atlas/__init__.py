"""Reachability clouds of whole families of designs: build, resume, open, query."""

from softreach.atlas.build import build_atlas
from softreach.atlas.metrics import METRIC_GROUPS, Metric, MetricFailed, Need
from softreach.atlas.reading import (
    AtlasStatus,
    atlas_cloud,
    atlas_design,
    atlas_status,
    best_designs,
    open_atlas,
    over_length,
    verify_atlas,
)
from softreach.atlas.space import DesignSpace
from softreach.support.files.stores import DamagedStore, StoreFailed

__all__ = ["METRIC_GROUPS", "AtlasStatus", "DamagedStore", "DesignSpace", "Metric", "MetricFailed"]
__all__ += ["Need", "StoreFailed", "atlas_cloud", "atlas_design", "atlas_status", "best_designs"]
__all__ += ["build_atlas", "open_atlas", "over_length", "verify_atlas"]
