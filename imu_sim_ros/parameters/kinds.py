# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of a parameter (kind, default, unit, range, text), and reading of its values."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from imu_sim_ros.conventions import GRAVITY
from imu_sim_ros.inputs import gate

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Value: TypeAlias = "float | int | bool | str | tuple[float, ...] | tuple[str, ...]"

IDENTITY_MATRIX: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO_MATRIX: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ZERO_VECTOR: Vector = (0.0, 0.0, 0.0)
EMPTY_LIST = "[]"
"""An empty list as a string, for ROS, which has no empty list of numbers or strings."""

SMALLEST = 1e-30
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
"""What the gate takes for possible, by the beginning of the unit, the longer ones first; densities
and coefficients that alone make larger readings are none either."""

METADATA = "parameter"
"""Key of a field's description in the dataclass."""


class SizeError(ValueError):
    """A number that is too large or too small for arithmetic."""


@dataclass(frozen=True)
class Parameter:
    """Declaration of one parameter: kind, default, unit, range and text.

    ``kind`` is one of number, integer, flag, text, choice, vector (three numbers, or one that
    stands for all), gravity (a vector, or one number, its magnitude downwards), matrix (nine
    numbers, row by row), numbers (any count, in groups of ``group``), texts. ``live`` says that a
    node takes a new value while it runs. ``turn_on_scale`` says what a sensor's turn-on scale s
    does to an error in the realised unit: ``multiplies`` each row of a coefficient of its response
    by 1 + s of the row's axis, ``divides`` a part of the scale by it, and nothing else.
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

    def parse(self, value: object) -> Value:
        """Return the value in the parameter's own type.

        :raises SizeError: if a number is too large or too small for any parameter.
        :raises ValueError: if it is not allowed; :meth:`allowed` says what is.
        """
        return _PARSERS[self.kind](self, value)

    @cached_property
    def parsed_default(self) -> Value:
        """The default in the parameter's own type."""
        return self.parse(self.default)

    def allowed(self) -> str:
        """Return in words which values are allowed."""
        if self.kind == "choice":
            return "one of " + ", ".join(self.choices)
        if self.kind == "flag":
            return "true or false"
        if self.kind in ("text", "texts"):
            return "a string" if self.kind == "text" else "a list of strings"
        noun = {
            "number": "a finite number",
            "integer": "an integer",
            "vector": "a finite number or a list of three",
            "gravity": "a magnitude of at least 0, downwards, or a list of three",
            "matrix": "a list of nine finite numbers, row by row",
            "numbers": "a list of finite numbers"
            + (f", {self.group} for each entry" if self.group > 1 else ""),
        }[self.kind]
        limits = self._range()
        if limits:
            noun += (" " if self.kind in ("number", "integer") else ", each ") + limits
        return f"{noun} [{self.unit}]" if self.unit else noun

    def _range(self) -> str:
        words = []
        if self.minimum > -math.inf:
            words.append(f"{'above' if self.above_minimum else 'at least'} {self.minimum:g}")
        if self.maximum < math.inf:
            words.append(f"at most {self.maximum:g}")
        return " and ".join(words)

    @cached_property
    def largest(self) -> float:
        """The largest size that is possible at all; a reading of it still passes the gate."""
        found = (one.largest for start, one in _POSSIBLE.items() if self.unit.startswith(start))
        return next(found, LARGEST)

    def in_range(self, number: float) -> bool:
        """Return whether a number is in the parameter's range."""
        low = number > self.minimum if self.above_minimum else number >= self.minimum
        return low and number <= self.maximum


def _number(parameter: Parameter, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ValueError
    number = float(value)
    if not math.isfinite(number) or not parameter.in_range(number):
        raise ValueError
    if number and not SMALLEST <= abs(number) <= parameter.largest:
        raise SizeError
    return number


def _integer(parameter: Parameter, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ValueError
    if not math.isfinite(value):
        raise ValueError
    exact = int(value)  # of large numbers a float is another one
    if value != exact or not parameter.in_range(exact):
        raise ValueError
    return exact


def _flag(_: Parameter, value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError
    return value


def _text(_: Parameter, value: object) -> str:
    if not isinstance(value, str):
        raise ValueError
    return value


def _choice(parameter: Parameter, value: object) -> str:
    if value not in parameter.choices:
        raise ValueError
    return str(value)


def entries(value: object) -> object:
    """Return a list given as a string, such as ``"[0.1, 0, 0]"``; anything else unchanged.

    ROS has no empty list and no list of floats and integers: ``ros2 param set`` sends either as a
    string.
    """
    if not isinstance(value, str) or not value.lstrip().startswith("["):
        return value
    from imu_sim_ros.parameters.yaml_text import parse_yaml

    return parse_yaml(value)


def _list(value: object) -> Sequence[object]:
    value = entries(value)
    if isinstance(value, str) or not hasattr(value, "__iter__"):
        raise ValueError
    return list(value)


def _numbers(parameter: Parameter, value: object) -> tuple[float, ...]:
    entries = tuple(_number(parameter, entry) for entry in _list(value))
    if len(entries) % parameter.group:
        raise ValueError
    return entries


def _vector(parameter: Parameter, value: object) -> tuple[float, ...]:
    value = entries(value)
    if not hasattr(value, "__iter__"):
        return (_number(parameter, value),) * 3
    return _counted(parameter, value, 3)


def _gravity(parameter: Parameter, value: object) -> tuple[float, ...]:
    value = entries(value)
    if hasattr(value, "__iter__"):
        return _counted(parameter, value, 3)
    magnitude = _number(parameter, value)
    if magnitude < 0.0:
        raise ValueError
    return (0.0, 0.0, 0.0 - magnitude)


def _matrix(parameter: Parameter, value: object) -> tuple[float, ...]:
    return _counted(parameter, value, 9)


def _counted(parameter: Parameter, value: object, count: int) -> tuple[float, ...]:
    entries = tuple(_number(parameter, entry) for entry in _list(value))
    if len(entries) != count:
        raise ValueError
    return entries


def _texts(parameter: Parameter, value: object) -> tuple[str, ...]:
    return tuple(_text(parameter, entry) for entry in _list(value))


_PARSERS: dict[str, Callable[[Parameter, object], Value]] = {
    "number": _number,
    "integer": _integer,
    "flag": _flag,
    "text": _text,
    "choice": _choice,
    "vector": _vector,
    "gravity": _gravity,
    "matrix": _matrix,
    "numbers": _numbers,
    "texts": _texts,
}


def _field(kind: str, default: Value, text: str, **details: Any) -> Any:
    parameter = Parameter(kind, default, text, **details)
    return dataclasses.field(default=default, metadata={METADATA: parameter})


def like(other: Parameter, **changed: Any) -> Any:
    """Describe what another parameter describes, but for some fields of :class:`Parameter`."""
    parameter = dataclasses.replace(other, **changed)
    return dataclasses.field(default=parameter.default, metadata={METADATA: parameter})


def number(default: float, text: str, **details: Any) -> Any:
    """Describe a float; details are fields of :class:`Parameter`."""
    return _field("number", default, text, **details)


def integer(default: int, text: str, **details: Any) -> Any:
    """Describe an integer."""
    return _field("integer", default, text, **details)


def flag(default: bool, text: str, **details: Any) -> Any:
    """Describe a switch."""
    return _field("flag", default, text, **details)


def text(default: str, text: str, **details: Any) -> Any:
    """Describe a string."""
    return _field("text", default, text, **details)


def choice(default: str, choices: Sequence[str], text: str, **details: Any) -> Any:
    """Describe a string from a fixed set."""
    return _field("choice", default, text, choices=tuple(choices), **details)


def vector(default: float | Vector, text: str, **details: Any) -> Any:
    """Describe a value per axis x, y, z; a single number applies to all three."""
    entries = default if isinstance(default, tuple) else (float(default),) * 3
    return _field("vector", entries, text, **details)


def gravity(text: str) -> Any:
    """Describe gravity in the world [m/s^2]; a single number is its magnitude, downwards."""
    return _field("gravity", GRAVITY, text, unit="m/s^2")


def upward_gravity(gravity: Vector) -> Iterator[str]:
    """Say that a world is probably upside down, in a line.

    :param gravity: g_w [m/s^2].
    """
    if any(gravity) and gravity[2] >= 0.0:
        words = ", ".join(f"{component:g}" for component in gravity)
        usual = ", ".join(f"{component:g}" for component in GRAVITY)
        yield (
            f"gravity = [{words}]: does not point downwards; z of the world is up, so that "
            f"gravity is usually [{usual}], or {-GRAVITY[2]:g}, its magnitude"
        )


def matrix(default: Matrix, text: str, **details: Any) -> Any:
    """Describe a 3 x 3 matrix as nine numbers, row by row."""
    return _field("matrix", default, text, **details)


def numbers(default: tuple[float, ...], text: str, **details: Any) -> Any:
    """Describe a list of numbers of any length (a multiple of ``group``)."""
    return _field("numbers", default, text, **details)


def texts(default: tuple[str, ...], text: str, **details: Any) -> Any:
    """Describe a list of strings."""
    return _field("texts", default, text, **details)
