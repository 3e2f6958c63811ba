"""A small picture of an arm at rest, for notebooks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.skin import Centerline, body_skin, bundle_skins, inside
from softreach.picture import Skin, html_card
from softreach.support.palette import BODY, bundle_color

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["arm_card"]

_STATIONS, _STEP = 41, np.pi / 27


def arm_card(arm: Manipulator) -> str:
    """HTML with a picture of the arm and its bundles above its numbers."""
    return html_card(repr(arm), *_skins(arm))


def _skins(arm: Manipulator) -> Iterator[Skin]:
    line = Centerline.at_rest(np.linspace(0.0, arm.length, _STATIONS))
    line = line.with_stations(arm.breakpoints)
    body = body_skin(arm, line)
    yield Skin(body.vertices, body.faces, BODY, clear=any(inside(arm)))
    for bundle, skin in enumerate(bundle_skins(arm, line, lift=0.01, step=_STEP)):
        yield Skin(skin.vertices, skin.faces, bundle_color(bundle))
