"""Design parameters: the numbers of an arm that a sweep, a slider or an optimizer varies.

Parameters of the whole arm have plain names: `taper`, `length`, `revolution`. An actuator's own
begin with its name: `left.offset`. What stands after the last dot is the field; names of actuators
are unique and fields hold no dot, so no two parameters of an arm share a name.
"""

from softreach.arm.parameters.of_arm import changed, find_parameter, parameters, unknown_parameter
from softreach.arm.parameters.parameter import Parameter

__all__ = ["Parameter", "changed", "find_parameter", "parameters", "unknown_parameter"]
