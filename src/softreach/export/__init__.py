"""Clouds, hulls and arms in other programs' file formats; the suffix of the path chooses."""

from softreach.export.clouds import cloud_table, export_cloud
from softreach.export.surfaces import export_arm, export_mesh

__all__ = ["cloud_table", "export_arm", "export_cloud", "export_mesh"]
