"""The reachable set as the image of the activation box: volume, multiplicity, folds, surface."""

import lazy_loader

from softreach.geometry.surface import Surface
from softreach.workspace.abstract_set import ReachableSet
from softreach.workspace.directions import direction_spread
from softreach.workspace.gradient import VolumeGradient, volume_gradient
from softreach.workspace.image import Image, Lattice
from softreach.workspace.reach import reachable_set
from softreach.workspace.sheets import Sheets
from softreach.workspace.solid import ReachableSolid
from softreach.workspace.thin import ReachableCurve, ReachablePoint, ReachableSurface

__all__ = [
    "Image",
    "Lattice",
    "ReachableCurve",
    "ReachablePoint",
    "ReachableSet",
    "ReachableSolid",
    "ReachableSurface",
    "Sheets",
    "Surface",
    "VolumeGradient",
    "direction_spread",
    "reachable_set",
    "volume_gradient",
]

__getattr__, _, _ = lazy_loader.attach(__name__, submodules=["payload"])
