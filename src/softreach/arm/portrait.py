"""A small picture of an arm at rest, for notebooks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softreach.geometry.tube import grid_faces, tube_surface
from softreach.palette import BODY, bundle_color
from softreach.picture import Skin, html_card

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["arm_card"]

_STATIONS, _ACROSS = 41, 9


def arm_card(arm: Manipulator) -> str:
    """HTML with a picture of the arm and its bundles above its numbers."""
    return html_card(repr(arm), *_skins(arm))


def _skins(arm: Manipulator) -> Iterator[Skin]:
    z = np.linspace(0.0, arm.length, _STATIONS)
    radius, outline = arm.profile.radius(z), arm.outline(z)
    along = np.column_stack([0 * z, 0 * z, z])
    d1, d2 = (np.tile(axis, (_STATIONS, 1)) for axis in np.eye(3)[:2])
    body = tube_surface(along, d1, d2, radius)
    yield Skin(body.vertices, body.faces, BODY)
    for bundle, extent in enumerate(outline.extent):
        angle = outline.center[:, bundle, None] + np.linspace(-0.5, 0.5, _ACROSS) * extent
        reach = 1.01 * radius[:, None]
        band = [
            reach * np.cos(angle),
            reach * np.sin(angle),
            np.broadcast_to(z[:, None], angle.shape),
        ]
        points = np.stack(band, axis=-1).reshape(-1, 3)
        yield Skin(points, grid_faces(_STATIONS, _ACROSS), bundle_color(bundle))
