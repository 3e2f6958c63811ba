"""How differently an arm must be activated to reach nearly the same place (section 5)."""

from softreach.redundancy.distance import activation_distance
from softreach.redundancy.maps import distance_map, tip_density
from softreach.redundancy.summary import RedundancySummary, redundancy_summary

__all__ = [
    "RedundancySummary",
    "activation_distance",
    "distance_map",
    "redundancy_summary",
    "tip_density",
]
