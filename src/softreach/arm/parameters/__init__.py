"""Design parameters: the numbers of an arm that a sweep, a slider or an optimizer varies.

Each is called by its path. Those of the whole arm have plain names: `taper`, `length`,
`revolution`. Those of a part begin with the part: `profile.radii[1]`, `rings[0].inner_ratio`,
`rings[0].material.young_modulus`, `core.density`, and an actuator's own with its name:
`left.offset`, `left.helical_angle.values[2]`, `left.lower[1]`. Counting starts at 0; a ring that
has a name may be called by it: `rings[skin].inner_ratio`. What several parts share, such as
`lower`, has a value where theirs are equal; it can be set in any case, which makes them equal.

Files and the command line write the same names with the unit, which stands before the place in a
series, and angles in degrees: `taper_deg`, `left.helical_angle.values_deg[2]`.
"""

from softreach.arm.parameters.changes import changed, find_parameter, find_parameters
from softreach.arm.parameters.parameter import Parameter, parameters

__all__ = ["Parameter", "changed", "find_parameter", "find_parameters", "parameters"]
