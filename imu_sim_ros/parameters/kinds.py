# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of a parameter (kind, default, unit, range, text), and reading of its values."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias, TypedDict, TypeVar, cast

import numpy as np

from imu_sim_ros.core import gate
from imu_sim_ros.core.conventions import GRAVITY
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import short_repr, suggestion
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.parameters.yaml_text import parse_yaml

if TYPE_CHECKING:
    from typing_extensions import Unpack

_V = TypeVar("_V")
Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Value: TypeAlias = "float | int | bool | str | tuple[float, ...] | tuple[str, ...]"

IDENTITY_MATRIX: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO_MATRIX: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ZERO_VECTOR: Vector = (0.0, 0.0, 0.0)
EMPTY_LIST = "[]"
"""An empty list as a string, for ROS, which has no empty list of numbers or strings."""

SMALLEST = 1e-30
"""Smallest number other than 0 that a parameter may have."""
LARGEST = 1e30
"""No number of the field is smaller, but 0, or larger; beyond them products leave the range of
floats."""
_POSSIBLE = {
    "rad/s": gate.RATE,
    "(rad/s)/": gate.RATE,
    "m/s^": gate.FORCE,
    "m/s": gate.VELOCITY,
    "m": gate.POSITION,
    "T": gate.FIELD,
    "Pa": gate.PRESSURE,
    "degC": gate.TEMPERATURE,
}
"""Largest plausible values by the beginning of the unit, longer beginnings first; they also limit
densities and coefficients that would alone cause larger readings."""

METADATA = "parameter"
"""Key of a field's description in the dataclass."""


class _Kind(NamedTuple):
    """Values that a parameter may have."""

    allowed: str
    """Description of the allowed values."""
    entry: type[float] | type[bool] | type[str]
    """The type of a value, or of each entry of a list."""
    length: int | None = None
    """Length of a list; 0: any length; None: a single value."""


_KINDS: Final = {
    "number": _Kind("a finite number", float),
    "integer": _Kind("an integer", int),
    "flag": _Kind("true or false", bool),
    "text": _Kind("a string", str),
    "choice": _Kind("one of", str),
    "vector": _Kind("a finite number or a list of three", float, 3),
    "gravity": _Kind("a magnitude of at least 0, downwards, or a list of three", float, 3),
    "matrix": _Kind("a list of nine finite numbers, row by row", float, 9),
    "numbers": _Kind("a list of finite numbers", float, 0),
    "texts": _Kind("a list of strings", str, 0),
}
"""A single number stands for all three of a vector; for gravity, it is the magnitude downwards."""


_NUMBERS: Final = (float, int, np.number)


class _SizeError(ValueError):
    """A number that is too large or too small for arithmetic."""


@dataclass(frozen=True)
class Parameter:
    """Declaration of one parameter: kind, default, unit, range and text.

    ``kind`` is a name in ``_KINDS``. Numbers of any count come in groups of ``group``. ``live``
    says that a node takes a new value while it runs. ``turn_on_scale`` says what a sensor's turn-on
    scale s does to an error in the realised unit: ``multiplies`` each row of a coefficient of its
    response by 1 + s of the row's axis, ``divides`` a part of the scale by it, and nothing else.
    ``covariance`` says that the covariance of dead reckoning has a term for it.
    """

    kind: str
    default: Value
    text: str
    unit: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    above_minimum: bool = False
    choices: tuple[str, ...] = ()
    group: int = 1
    live: bool = False
    turn_on_scale: str = ""
    covariance: bool = False

    def parse(self, name: str, value: object) -> Value:
        """Return the value in the parameter's own type.

        :param name: name of the parameter, for the message.
        :raises ConfigurationError: with the line that says what is allowed.
        """
        length = _KINDS[self.kind].length
        try:
            if length is None:
                return self._entry(value)
            listed = entries(value)
            if hasattr(listed, "__iter__") and not isinstance(listed, str):
                parsed = tuple(self._entry(entry) for entry in listed)
                if len(parsed) != (length or len(parsed)) or len(parsed) % self.group:
                    raise ValueError
                return cast(Value, parsed)
            if length != 3:
                raise ValueError
            number = cast(float, self._entry(listed))
            if self.kind == "vector":
                return (number, number, number)
            if number < 0.0:
                raise ValueError
            return (0.0, 0.0, 0.0 - number)
        except _SizeError:
            allowed = (
                f"must be 0 or of a size from {SMALLEST:g} to {self.largest:g} {self.unit}".rstrip()
            )
        except (ValueError, TypeError, OverflowError):
            allowed = f"must be {self.allowed_text()}"
            if self.choices:
                allowed = suggestion(value, self.choices)
        raise ConfigurationError(f"{argument_prefix(name, short_repr(value))}: {allowed}")

    def unquote(self, value: object) -> object:
        """Return a number in quotes, alone or in a list, as the number if the kind has numbers."""
        if _KINDS[self.kind].entry not in (float, int):
            return value
        if isinstance(value, list):
            return [self.unquote(entry) for entry in value]
        if not isinstance(value, str):
            return value
        try:
            number = parse_yaml(value)
        except ValueError:
            return value
        is_number = isinstance(number, _NUMBERS) and not isinstance(number, bool)
        return number if is_number else value

    def _entry(self, value: object) -> float | bool | str:
        """Return a checked single value, or entry of a list. :raises ValueError: for any other."""
        entry = _KINDS[self.kind].entry
        if entry in (bool, str):
            if not isinstance(value, entry) or (self.choices and value not in self.choices):
                raise ValueError
            return entry(value)
        if isinstance(value, bool) or not isinstance(value, _NUMBERS):
            raise ValueError
        if not math.isfinite(value):
            raise ValueError
        exact = entry is int  # of large integers a float is another one
        number = int(value) if exact else float(value)
        if exact and number != value:
            raise ValueError
        if number > self.maximum or number < self.minimum:
            raise ValueError
        if self.above_minimum and number == self.minimum:
            raise ValueError
        if not exact and number and not SMALLEST <= abs(number) <= self.largest:
            raise _SizeError
        return number

    def allowed_text(self) -> str:
        """Return the description of the allowed values, with limits and unit."""
        description = _KINDS[self.kind].allowed
        if self.choices:
            description += f" {', '.join(self.choices)}"
        if self.group > 1:
            description += f", {self.group} for each entry"
        limits = []
        if self.minimum > -math.inf:
            limits.append(f"{'above' if self.above_minimum else 'at least'} {self.minimum:g}")
        if self.maximum < math.inf:
            limits.append(f"at most {self.maximum:g}")
        if limits:
            description += (" " if _KINDS[self.kind].length is None else ", each ") + " and ".join(
                limits
            )
        return f"{description} [{self.unit}]" if self.unit else description

    @cached_property
    def largest(self) -> float:
        """Largest possible magnitude; readings of this size still pass the gate."""
        limits = (
            limit.largest for start, limit in _POSSIBLE.items() if self.unit.startswith(start)
        )
        return next(limits, LARGEST)


def entries(value: object) -> object:
    """Return a list given as a string, such as ``"[0.1, 0, 0]"``; anything else unchanged.

    ROS has no empty list and no list of floats and integers: ``ros2 param set`` sends either as a
    string.
    """
    if not isinstance(value, str) or not value.lstrip().startswith("["):
        return value
    return parse_yaml(value)


class NumberLimits(TypedDict, total=False):
    """Fields of :class:`Parameter` that bound its numbers."""

    minimum: float
    maximum: float
    above_minimum: bool


class ParameterDetails(NumberLimits, total=False):
    """Fields of :class:`Parameter` that a declaration may state."""

    unit: str
    group: int
    live: bool
    turn_on_scale: str
    covariance: bool


# What follows is a field of a dataclass; as with dataclasses.field, its type is that of the value.


def _field(
    kind: str,
    default: _V,
    text: str,
    choices: tuple[str, ...] = (),
    **details: "Unpack[ParameterDetails]",
) -> _V:
    """Return the dataclass field of a parameter."""
    parameter = Parameter(kind, cast(Value, default), text, choices=choices, **details)
    return dataclasses.field(default=default, metadata={METADATA: parameter})


def copy_parameter(parameter_of_origin: Parameter, **changed: Any) -> Any:
    """Return a parameter like another one, except for some fields of :class:`Parameter`."""
    parameter = dataclasses.replace(parameter_of_origin, **changed)
    return dataclasses.field(default=parameter.default, metadata={METADATA: parameter})


def number(default: float, text: str, **details: "Unpack[ParameterDetails]") -> float:
    """Describe a float; details are fields of :class:`Parameter`."""
    return _field("number", float(default), text, **details)


def integer(default: int, text: str, **details: "Unpack[ParameterDetails]") -> int:
    """Describe an integer."""
    return _field("integer", default, text, **details)


def flag(default: bool, text: str, **details: "Unpack[ParameterDetails]") -> bool:
    """Describe a switch."""
    return _field("flag", default, text, **details)


def text(default: str, text: str, **details: "Unpack[ParameterDetails]") -> str:
    """Describe a string."""
    return _field("text", default, text, **details)


def choice(
    default: str, choices: Sequence[str], text: str, **details: "Unpack[ParameterDetails]"
) -> str:
    """Describe a string from a fixed set."""
    return _field("choice", default, text, tuple(choices), **details)


def vector(default: float | Vector, text: str, **details: "Unpack[ParameterDetails]") -> Vector:
    """Describe a value per axis x, y, z; a single number applies to all three."""
    x, y, z = default if isinstance(default, tuple) else (default,) * 3
    return _field("vector", (float(x), float(y), float(z)), text, **details)


def gravity(text: str) -> Vector:
    """Describe gravity in the world [m/s^2]; a single number is its magnitude, downwards."""
    return _field("gravity", GRAVITY, text, unit="m/s^2")


LARGEST_GRAVITY: Final = 30.0
"""Largest magnitude of gravity, more than on any planet: a larger one is in another unit
[m/s^2]."""


def gravity_warnings(gravity: Vector) -> Iterator[str]:
    """Yield a line for a world that is probably upside down, and for gravity in another unit.

    :param gravity: g_w [m/s^2].
    """
    if any(gravity) and gravity[2] >= 0.0:
        components = ", ".join(f"{component:g}" for component in gravity)
        usual = ", ".join(f"{component:g}" for component in GRAVITY)
        yield (
            f"gravity = [{components}]: does not point downwards; z of the world is up, so that "
            f"gravity is usually [{usual}], or {-GRAVITY[2]:g}, its magnitude"
        )
    size = math.hypot(*gravity)
    if size > LARGEST_GRAVITY:
        yield (
            f"gravity: {size:g} m/s^2 is more than on any planet; it is {-GRAVITY[2]:g} m/s^2 on "
            f"the Earth, {-100.0 * GRAVITY[2]:g} in cm/s^2"
        )


def matrix(default: Matrix, text: str, **details: "Unpack[ParameterDetails]") -> Matrix:
    """Describe a 3 x 3 matrix as nine numbers, row by row."""
    return _field("matrix", cast(Matrix, tuple(map(float, default))), text, **details)


def numbers(
    default: tuple[float, ...], text: str, **details: "Unpack[ParameterDetails]"
) -> tuple[float, ...]:
    """Describe a list of numbers of any length (a multiple of ``group``)."""
    return _field("numbers", tuple(map(float, default)), text, **details)


def texts(
    default: tuple[str, ...], text: str, **details: "Unpack[ParameterDetails]"
) -> tuple[str, ...]:
    """Describe a list of strings."""
    return _field("texts", default, text, **details)
