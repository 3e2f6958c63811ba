"""Plots beside the scene: how they are computed, and charts."""
