"""Pixels from points and triangles in NumPy alone: views, light, a z-buffer, small PNG pictures.

A value shows itself in notebooks by

    def _repr_html_(self) -> str:
        return html_card(repr(self), Skin(self.vertices, self.faces))
"""

from softreach.picture.thumbnail import Dots, Skin, html_card, thumbnail

__all__ = ["Dots", "Skin", "html_card", "thumbnail"]
