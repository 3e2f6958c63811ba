"""Pixels from points and triangles in NumPy alone: views, light, a z-buffer, small PNG pictures."""

from softreach.picture.thumbnail import Dots, Skin, html_card, thumbnail

__all__ = ["Dots", "Skin", "html_card", "thumbnail"]
