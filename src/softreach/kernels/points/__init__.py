"""Clouds of points: triangulation, alpha shapes, neighbors."""
