"""`vector` for `strict` kernels: the same functions, each operation rounded as written."""

from __future__ import annotations

from softreach.kernels import vector
from softreach.kernels.compiler import strict

row = strict(vector.row)
difference = strict(vector.difference)
minus = strict(vector.minus)
times = strict(vector.times)
cross = strict(vector.cross)
dot = strict(vector.dot)
