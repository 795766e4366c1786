"""Named arguments of services that take more than a trigger.

They are of type ``rcl_interfaces/SetParametersAtomically``, the one standard service with names, values of any type, and a reason
in its answer.
"""

from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python

Request = SetParametersAtomically.Request


class ArgumentError(ValueError):
    """Arguments that make no sense; the message names the one."""


def read_arguments(request: Request, needed: dict[str, Parameter.Type], optional: dict[str, Parameter.Type]) -> dict[str, Any]:
    """The arguments of a request by name.

    Whole numbers are taken where others are asked for.

    Raises:
        ArgumentError: if one is missing, unknown, given twice, or of another type.
    """
    kinds, found = needed | optional, {}
    for parameter in request.parameters:
        name = parameter.name
        if name not in kinds:
            raise ArgumentError(f"unknown argument '{name[:50]}'; known are {', '.join(kinds)}")
        try:
            kind = Parameter.Type(parameter.value.type)
        except ValueError:
            raise ArgumentError(f"argument '{name}': there is no type {parameter.value.type}, see ParameterType") from None
        if name in found:
            raise ArgumentError(f"argument '{name}' is given twice")
        if kind != kinds[name] and (kind, kinds[name]) not in _WIDENED:
            raise ArgumentError(f"argument '{name}': must be {_shown(kinds[name])}, not {_shown(kind)}")
        found[name] = parameter_value_to_python(parameter.value)
    if missing := [name for name in needed if name not in found]:
        raise ArgumentError(f"argument '{missing[0]}' is missing; give {_shown(needed[missing[0]])}")
    return found


_WIDENED = {
    (Parameter.Type.INTEGER, Parameter.Type.DOUBLE),
    (Parameter.Type.INTEGER_ARRAY, Parameter.Type.DOUBLE_ARRAY),
}


def _shown(kind: Parameter.Type) -> str:
    return kind.name.lower().replace("_", " ")
