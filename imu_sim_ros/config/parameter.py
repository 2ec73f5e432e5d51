# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a parameter is described once and read from anywhere.

A section is a frozen dataclass whose fields are made by the functions below; each field carries its
unit, range and text. From that one description come the checks, the declaration of ROS parameters,
the arguments' help and the reference in the documentation. Sections nest; names are joined by dots.
"""

import dataclasses
import difflib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from imu_sim_ros.errors import ConfigurationError

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Value: TypeAlias = "float | int | bool | str | tuple[float, ...] | tuple[str, ...]"

IDENTITY_MATRIX: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO_MATRIX: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ZERO_VECTOR: Vector = (0.0, 0.0, 0.0)
EMPTY_LIST = "[]"
"""An empty list as a string, for ROS, which has no empty list of numbers or strings."""

_T = TypeVar("_T")
_METADATA = "parameter"


@dataclass(frozen=True)
class Parameter:
    """What is known of one parameter: kind, default, unit, range and text.

    ``kind`` is one of number, integer, flag, text, choice, vector (three numbers, or one that
    stands for all), matrix (nine numbers, row by row), numbers (any count, in groups of
    ``group``), texts. ``live`` says that a node takes a new value while it runs.
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

    def parse(self, value: object) -> Value:
        """Return the value in the parameter's own type.

        :raises ValueError: where it is not allowed; :meth:`allowed` says what is.
        """
        return _PARSERS[self.kind](self, value)

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

    def in_range(self, number: float) -> bool:
        """Tell whether a number lies in the parameter's range."""
        low = number > self.minimum if self.above_minimum else number >= self.minimum
        return low and number <= self.maximum


def _number(parameter: Parameter, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ValueError
    number = float(value)
    if not math.isfinite(number) or not parameter.in_range(number):
        raise ValueError
    return number


def _integer(parameter: Parameter, value: object) -> int:
    number = _number(parameter, value)
    if number != int(number):
        raise ValueError
    return int(cast(float, value))


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
    """Return a list that came as a string, such as ``"[0.1, 0, 0]"``; anything else as it is.

    ROS has no empty list and no list of floats and integers: ``ros2 param set`` sends either as a
    string.
    """
    if not isinstance(value, str) or not value.lstrip().startswith("["):
        return value
    from imu_sim_ros.inputs import parse_yaml

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
    "matrix": _matrix,
    "numbers": _numbers,
    "texts": _texts,
}


def _field(kind: str, default: Value, text: str, **details: Any) -> Any:
    parameter = Parameter(kind, default, text, **details)
    return dataclasses.field(default=default, metadata={_METADATA: parameter})


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
    """Describe a string out of a few."""
    return _field("choice", default, text, choices=tuple(choices), **details)


def vector(default: float | Vector, text: str, **details: Any) -> Any:
    """Describe a value per axis x, y, z; a single number stands for all three."""
    entries = default if isinstance(default, tuple) else (float(default),) * 3
    return _field("vector", entries, text, **details)


def matrix(default: Matrix, text: str, **details: Any) -> Any:
    """Describe a 3 x 3 matrix as nine numbers, row by row."""
    return _field("matrix", default, text, **details)


def numbers(default: tuple[float, ...], text: str, **details: Any) -> Any:
    """Describe a list of numbers of any length (a multiple of ``group``)."""
    return _field("numbers", default, text, **details)


def texts(default: tuple[str, ...], text: str, **details: Any) -> Any:
    """Describe a list of texts."""
    return _field("texts", default, text, **details)


def section(cls: type) -> Any:
    """Describe a nested section, below the field's name and a dot."""
    return dataclasses.field(default_factory=cls, metadata={"section": cls})


def variant(key: str, default: str, find: Callable[[str], type]) -> Any:
    """Describe a nested section whose class depends on the text at ``key`` within it.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    """
    return dataclasses.field(
        default_factory=lambda: find(default)(),
        metadata={"variant": (key, default, find)},
    )


def parameters(cls: type, values: Mapping[str, object] | None = None) -> dict[str, Parameter]:
    """Return every parameter of a section by its dotted name.

    :param values: chosen values; they decide which class a variant has.
    """
    return dict(_walk(cls, values or {}, ""))


def _walk(cls: type, values: Mapping[str, object], prefix: str) -> Iterator[tuple[str, Parameter]]:
    for field in dataclasses.fields(cls):
        name = prefix + field.name
        if _METADATA in field.metadata:
            yield name, field.metadata[_METADATA]
        else:
            yield from _walk(_section_class(field, values, name), values, name + ".")


def _section_class(field: Any, values: Mapping[str, object], name: str) -> type:
    if "section" in field.metadata:
        return cast(type, field.metadata["section"])
    key, default, find = field.metadata["variant"]
    chosen = values.get(f"{name}.{key}", default)
    return cast(type, find(str(chosen)))


def build(cls: type[_T], values: Mapping[str, object]) -> _T:
    """Return the section with the given values and the defaults of all others.

    :param values: by dotted name, as :func:`imu_sim_ros.config.files.load` returns them.
    :raises ConfigurationError: with a line for every unknown name and every bad value.
    """
    values, problems = _without_bad_variants(cls, values, "")
    known = parameters(cls, values)
    problems += [unknown(name, known) for name in values if name not in known]
    parsed: dict[str, Value] = {}
    for name, parameter in known.items():
        try:
            parsed[name] = parse(name, parameter, values.get(name, parameter.default))
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    result = _construct(cls, parsed, values, "")
    problems = list(_checks(result, ""))
    if problems:
        raise ConfigurationError(problems)
    return result


def parse(name: str, parameter: Parameter, value: object) -> Value:
    """Return the value in the parameter's own type.

    :raises ConfigurationError: with the line that names the parameter and what is allowed.
    """
    try:
        return parameter.parse(value)
    except (ValueError, TypeError, OverflowError):
        raise ConfigurationError(
            f"{name} = {shown(value)}: must be {parameter.allowed()}"
        ) from None


def _without_bad_variants(
    cls: type, values: Mapping[str, object], prefix: str
) -> tuple[Mapping[str, object], list[str]]:
    """Set aside variants whose class cannot be found, so that all else is still checked."""
    problems: list[str] = []
    for field in dataclasses.fields(cls):
        name = prefix + field.name
        if "variant" not in field.metadata:
            continue
        try:
            _section_class(field, values, name)
        except ConfigurationError as error:
            problems += error.problems
            values = {key: v for key, v in values.items() if not key.startswith(name + ".")}
    return values, problems


def _construct(
    cls: type[_T], parsed: Mapping[str, Value], values: Mapping[str, object], prefix: str
) -> _T:
    arguments: dict[str, object] = {}
    for field in dataclasses.fields(cast(Any, cls)):
        name = prefix + field.name
        if _METADATA in field.metadata:
            arguments[field.name] = parsed[name]
        else:
            nested = _section_class(field, values, name)
            arguments[field.name] = _construct(nested, parsed, values, name + ".")
    return cls(**arguments)


def _checks(instance: object, prefix: str) -> Iterator[str]:
    """Collect what the sections' own ``problems(prefix)`` say: rules over several parameters."""
    own = getattr(instance, "problems", None)
    if own is not None:
        yield from own(prefix)
    for field in dataclasses.fields(cast(Any, instance)):
        if _METADATA not in field.metadata:
            yield from _checks(getattr(instance, field.name), f"{prefix}{field.name}.")


def flatten(instance: object, prefix: str = "") -> dict[str, Value]:
    """Return all values of a section by dotted name; :func:`build` of it gives an equal section."""
    result: dict[str, Value] = {}
    for field in dataclasses.fields(cast(Any, instance)):
        value = getattr(instance, field.name)
        if _METADATA in field.metadata:
            result[prefix + field.name] = value
        else:
            result.update(flatten(value, f"{prefix}{field.name}."))
    return result


def unknown(name: str, known: Mapping[str, object]) -> str:
    """Return the line for a name that does not exist, with the nearest one that does."""
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else "see the parameter reference for all names"
    return f"{name}: unknown parameter; {hint}"


def shown(value: object) -> str:
    """Return a value as a message shows it, cut where it is long."""
    words = repr(value)
    return words if len(words) <= 60 else words[:57] + "..."
