"""Widgets beside the scene, one concept a file."""
