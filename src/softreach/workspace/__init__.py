"""The reachable set as the image of the activation box: volume, multiplicity, folds, surface."""

from softreach.workspace.reach import reachable_set
from softreach.workspace.reachable import ReachableSet

__all__ = ["ReachableSet", "reachable_set"]
