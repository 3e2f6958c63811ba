from . import payload as payload
from .free import free_set as free_set
from .gradient import VolumeGradient as VolumeGradient
from .gradient import volume_gradient as volume_gradient
from .reach import reachable_set as reachable_set
from .reachable import ReachableSet as ReachableSet
from .reachable import Surface as Surface
