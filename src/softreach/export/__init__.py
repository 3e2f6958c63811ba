"""Clouds, hulls and arms in other programs' file formats; the suffix of the path chooses."""

from __future__ import annotations

from softreach.export.arm import export_arm
from softreach.export.cloud import export_cloud
from softreach.export.surface import export_mesh

__all__ = ["export_arm", "export_cloud", "export_mesh"]
