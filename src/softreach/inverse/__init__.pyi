from . import path as path
from .path import PathStatus as PathStatus
from .prepared import PreparedMap as PreparedMap
from .prepared import prepared_map as prepared_map
from .solutions import Solution as Solution
from .solutions import Solutions as Solutions
from .solutions import Status as Status
from .solve import solve_inverse as solve_inverse
