# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections of parameters: frozen dataclasses that nest, built from values by dotted name."""

import dataclasses
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Final, TypeVar, cast

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import shown, suggestion
from imu_sim_ros.parameters.kinds import (
    METADATA,
    SMALLEST,
    Parameter,
    SizeError,
    Value,
    entries,
)

_T = TypeVar("_T")
_SECTION_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
OF_EVERY_NODE: Final = {
    "use_sim_time": Parameter("flag", False, "take the time from /clock"),
    "start_type_description_service": Parameter("flag", True, "offer the types' descriptions"),
}
"""What ROS gives to every node; ``ros2 param dump`` writes it into files."""
_QOS: Final = "qos_overrides."


_SECTIONS: Final = "sections"
"""Key of what describes the sections in a field of a dataclass."""


class _Kind(ABC):
    """How the sections in a field stand among the parameters around them."""

    several: ClassVar[bool] = False
    """Whether the field is a dictionary of sections by name."""
    without: Collection[str] = ()
    """Fields of a section that are not parameters."""

    @abstractmethod
    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        """Return the classes by their names; that of a single section has none.

        :param name: of the field, with what stands before it.
        :param values: all that are given.
        """

    @abstractmethod
    def below(self, prefix: str, field: str, name: str) -> str:
        """Return what stands before the names of a section's parameters."""

    def described(self, parameter: Parameter) -> Parameter:
        """Return a parameter of a section as it is described here."""
        return parameter


@dataclass(frozen=True)
class _Section(_Kind):
    """A section within another, see :func:`section`."""

    cls: type
    joint: str
    words: Mapping[str, str] | None = None
    without: Collection[str] = ()
    fixed: bool = False

    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        return {"": self.cls}

    def below(self, prefix: str, field: str, name: str) -> str:
        return f"{prefix}{field}{self.joint}"

    def described(self, parameter: Parameter) -> Parameter:
        if self.words:
            text, unit = (of.format_map(self.words) for of in (parameter.text, parameter.unit))
            parameter = dataclasses.replace(parameter, text=text, unit=unit)
        return dataclasses.replace(parameter, live=False) if self.fixed else parameter


def section(
    cls: type,
    *,
    joint: str = ".",
    words: Mapping[str, str] | None = None,
    without: Collection[str] = (),
    fixed: bool = False,
) -> Any:
    """Describe a nested section; its parameters' names are the field's, the joint, and their own.

    :param words: replacements of ``{word}`` in the section's texts and units.
    :param without: fields of the section that are not parameters here and keep their default.
    :param fixed: whether none of its parameters is live here.
    """
    kind = _Section(cls, joint, words, without, fixed)
    return dataclasses.field(default_factory=cls, metadata={_SECTIONS: kind})


@dataclass(frozen=True)
class _Variant(_Kind):
    """A section whose class depends on a parameter in it, see :func:`variant`."""

    key: str
    default: str
    find: Callable[[str], type]
    kinds: Mapping[str, type]

    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        return {"": self.find(str(values.get(f"{name}.{self.key}", self.default)))}

    def below(self, prefix: str, field: str, name: str) -> str:
        return f"{prefix}{field}."


def variant(key: str, default: str, find: Callable[[str], type], kinds: Mapping[str, type]) -> Any:
    """Describe a nested section whose class depends on the text at ``key`` within it.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    :param kinds: classes that :func:`build` names if a parameter of theirs is given to another.
    """
    kind = _Variant(key, default, find, kinds)
    return dataclasses.field(default_factory=lambda: find(default)(), metadata={_SECTIONS: kind})


@dataclass(frozen=True)
class _Each(_Kind):
    """Sections of names that a parameter lists, see :func:`each`."""

    listed: str
    find: Callable[[str, Mapping[str, object]], type]
    taken: Collection[str]
    several = True

    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        return {one: self.find(one, values) for one in listed(self.listed, values)}

    def below(self, prefix: str, field: str, name: str) -> str:
        return f"{name}."


def each(
    listed: str, find: Callable[[str, Mapping[str, object]], type], taken: Collection[str] = ()
) -> Any:
    """Describe a dictionary of sections by name; their parameters are ``NAME.*``.

    :param listed: the parameter of the same section that lists the names.
    :param find: returns the class for a name and all values, or raises ConfigurationError with one
        line.
    :param taken: names that cannot be used, next to those of parameters.
    """
    kind = _Each(listed, find, taken)
    return dataclasses.field(default_factory=dict, metadata={_SECTIONS: kind})


@dataclass(frozen=True)
class _Shared(_Kind):
    """Sections that are always there, see :func:`shared`."""

    sections: Callable[[], Mapping[str, type]]
    joint: str | None
    several = True

    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        return self.sections()

    def below(self, prefix: str, field: str, name: str) -> str:
        return prefix if self.joint is None else f"{prefix}{name}{self.joint}"


def shared(sections: Callable[[], Mapping[str, type]], joint: str | None) -> Any:
    """Describe a dictionary of sections whose parameters stand among those of the one around it.

    :param joint: behind the name of each, before those of its parameters; None: no name either.
    """
    return dataclasses.field(
        default_factory=lambda: {name: cls() for name, cls in sections().items()},
        metadata={_SECTIONS: _Shared(sections, joint)},
    )


@dataclass(frozen=True)
class _Optional(_Kind):
    """A section that is there or not, see :func:`optional`."""

    cls: Callable[[], type]
    there: Callable[[Mapping[str, object]], bool]

    def classes(self, name: str, values: Mapping[str, object]) -> Mapping[str, type]:
        return {"": self.cls()} if self.there(values) else {}

    def below(self, prefix: str, field: str, name: str) -> str:
        return prefix


def optional(cls: Callable[[], type], there: Callable[[Mapping[str, object]], bool]) -> Any:
    """Describe a section, or None, whose parameters have no prefix of their own.

    :param cls: returns it; called only if it is there, so that it may be imported then.
    :param there: tells from all values whether it is.
    """
    return dataclasses.field(default=None, metadata={_SECTIONS: _Optional(cls, there)})


def parameters(cls: type, values: Mapping[str, object] | None = None) -> dict[str, Parameter]:
    """Return every parameter of a section by its dotted name.

    :param values: chosen values; they decide which class a variant has.
    """
    return dict(_walk(cls, values or {}, ""))


def _walk(cls: type, values: Mapping[str, object], prefix: str) -> Iterator[tuple[str, Parameter]]:
    fixed = _fixed(cls)
    if fixed is not None:
        yield from ((prefix + name, parameter) for name, parameter in fixed)
    else:
        yield from _walk_fields(cls, values, prefix)


@cache
def _fixed(cls: type) -> tuple[tuple[str, Parameter], ...] | None:
    """Return the parameters of a section that are the same whatever the values; None: of others."""
    for field in dataclasses.fields(cls):
        if METADATA in field.metadata:
            continue
        kind = field.metadata[_SECTIONS]
        if not isinstance(kind, _Section | _Shared):
            return None
        if any(_fixed(one) is None for one in kind.classes("", {}).values()):
            return None
    return tuple(_walk_fields(cls, {}, ""))


def _walk_fields(
    cls: type, values: Mapping[str, object], prefix: str
) -> Iterator[tuple[str, Parameter]]:
    for field in dataclasses.fields(cls):
        if METADATA in field.metadata:
            yield prefix + field.name, field.metadata[METADATA]
            continue
        kind: _Kind = field.metadata[_SECTIONS]
        for name, one in kind.classes(prefix + field.name, values).items():
            below = kind.below(prefix, field.name, name)
            absent = [below + other for other in kind.without]
            for dotted, parameter in _walk(one, values, below):
                if dotted not in absent:
                    yield dotted, kind.described(parameter)


def listed(parameter: str, values: Mapping[str, object]) -> list[str]:
    """Return the names that a parameter lists; none, if it is not a list."""
    try:
        value = entries(values.get(parameter, ()))
    except ValueError:
        return []
    return [str(name) for name in value] if isinstance(value, list | tuple) else []


def is_of_ros(name: str) -> bool:
    """Return whether a parameter is one of ROS' own."""
    return name in OF_EVERY_NODE or name.startswith(_QOS)


def build(cls: type[_T], values: Mapping[str, object]) -> _T:
    """Return the section with the given values and the defaults of all others.

    A section may have ``passed_over()``: parameters by name that it has no use for. Their values,
    and those of ROS' own parameters, are checked and left. It may have ``elsewhere(name)``: the end
    of the line about a name in a section that does not exist; None: the usual one.

    :param values: by dotted name, as :func:`imu_sim_ros.parameters.files.load` returns them.
    :raises ConfigurationError: with a line for every unknown name and every bad value.
    """
    values, problems = _usable(cls, values)
    known = parameters(cls, values)
    unused = {**OF_EVERY_NODE, **getattr(cls, "passed_over", dict)()}
    unused = {name: parameter for name, parameter in unused.items() if name not in known}
    every = known.keys() | unused.keys()
    elsewhere = getattr(cls, "elsewhere", None)
    problems += [
        _of_other_variants(cls, values, n) or unknown(n, known, elsewhere)
        for n in values
        if n not in every and not is_of_ros(n)
    ]
    problems += bad_values(unused, values)
    parsed: dict[str, Value] = {}
    for name, parameter in known.items():
        if name not in values:
            parsed[name] = parameter.parsed_default
            continue
        try:
            parsed[name] = parse(name, parameter, values[name])
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
    except SizeError:
        raise ConfigurationError(
            f"{name} = {shown(value)}: must be 0 or of a size from {SMALLEST:g} to "
            f"{parameter.largest:g} {parameter.unit}".rstrip()
        ) from None
    except (ValueError, TypeError, OverflowError):
        allowed = f"must be {parameter.allowed()}"
        if parameter.kind == "choice":
            allowed = suggestion(value, parameter.choices)
        raise ConfigurationError(f"{name} = {shown(value)}: {allowed}") from None


def bad_values(known: Mapping[str, Parameter], values: Mapping[str, object]) -> Iterator[str]:
    """Yield a line for every bad value of a known name; other names are passed over."""
    for name in values.keys() & known.keys():
        try:
            parse(name, known[name], values[name])
        except ConfigurationError as error:
            yield from error.problems


def _usable(
    cls: type, values: Mapping[str, object], known: dict[str, str] | None = None
) -> tuple[Mapping[str, object], list[str]]:
    """Set aside sections whose class cannot be found, so that all else is still checked.

    :param known: the names of sections so far, and the parameters that list them.
    """
    problems: list[str] = []
    known = {} if known is None else known
    for field in dataclasses.fields(cls):
        kind, gone = field.metadata.get(_SECTIONS), list[str]()
        if isinstance(kind, _Variant):
            try:
                kind.classes(field.name, values)
            except ConfigurationError as error:
                problems += error.problems
                gone = [field.name]
        elif isinstance(kind, _Optional) and kind.there(values):
            values, found = _usable(kind.cls(), values, known)
            problems += found
        elif isinstance(kind, _Each):
            found, gone = _unusable_names(cls, kind, values, known)
            problems += found
            if gone:
                rest = [name for name in listed(kind.listed, values) if name not in gone]
                values = {**values, kind.listed: tuple(rest)}
        if gone:
            below = tuple(f"{name}." for name in gone)
            values = {key: v for key, v in values.items() if not key.startswith(below)}
    return values, problems


def _unusable_names(
    cls: type, each: _Each, values: Mapping[str, object], known: dict[str, str]
) -> tuple[list[str], list[str]]:
    """Return what is wrong with the names that a parameter lists, and which of them are."""
    problems, gone = [], []
    names = listed(each.listed, values)
    taken = {*each.taken, *(field.name for field in dataclasses.fields(cls))}
    if len(set(names)) < len(names):
        # Which other name was meant is not known, nor whose parameters the values below it are.
        raise ConfigurationError(f"{each.listed} = {names}: names must differ")
    for name in dict.fromkeys(names):
        if name in known:
            problems.append(f"{each.listed}: {name!r}: is a name in {known[name]}")
            gone.append(name)
            continue
        known[name] = each.listed
        if not _SECTION_NAME.fullmatch(name) or name in taken:
            problems.append(
                f"{each.listed}: {name!r}: must be letters, digits and underscores, and not "
                "a parameter's name"
            )
            gone.append(name)
            continue
        try:
            each.find(name, values)
        except ConfigurationError as error:
            problems += error.problems
            gone.append(name)
    return problems, gone


def _of_other_variants(cls: type, values: Mapping[str, object], name: str) -> str | None:
    """Return the line for a parameter that only other classes of its variant have; else None."""
    for field in dataclasses.fields(cls):
        kind, below = field.metadata.get(_SECTIONS), f"{field.name}."
        if isinstance(kind, _Optional) and kind.there(values):
            line = _of_other_variants(kind.cls(), values, name)
            if line is not None:
                return line
        if not isinstance(kind, _Variant) or not name.startswith(below):
            continue
        own = name.removeprefix(below)
        having = [word for word, each in kind.kinds.items() if own in parameters(each)]
        chosen = values.get(below + kind.key, kind.default)
        if having:
            verb = "has" if len(having) == 1 else "have"
            of = f"{below}{kind.key} {chosen}"
            return f"{name}: unknown parameter of {of}; {', '.join(having)} {verb} it"
    return None


def _construct(
    cls: type[_T], parsed: Mapping[str, Value], values: Mapping[str, object], prefix: str
) -> _T:
    arguments: dict[str, object] = {}
    for field in dataclasses.fields(cast(Any, cls)):
        name = prefix + field.name
        if METADATA in field.metadata:
            if name in parsed:
                arguments[field.name] = parsed[name]
            continue
        kind: _Kind = field.metadata[_SECTIONS]
        made: dict[str, Any] = {
            key: _construct(one, parsed, values, kind.below(prefix, field.name, key))
            for key, one in kind.classes(name, values).items()
        }
        arguments[field.name] = made if kind.several else made.get("")
    return cls(**arguments)


def _checks(instance: object, prefix: str) -> Iterator[str]:
    """Collect the sections' own ``problems(prefix)``, rules over several parameters."""
    own = getattr(instance, "problems", None)
    if own is not None:
        yield from own(prefix)
    for field in dataclasses.fields(cast(Any, instance)):
        if METADATA not in field.metadata:
            for one, below, _ in _built(field, getattr(instance, field.name), prefix):
                yield from _checks(one, below)


def flatten(instance: object, prefix: str = "") -> dict[str, Value]:
    """Return all values of a section by dotted name; :func:`build` of it gives an equal section."""
    result: dict[str, Value] = {}
    for field in dataclasses.fields(cast(Any, instance)):
        value = getattr(instance, field.name)
        if METADATA in field.metadata:
            result[prefix + field.name] = value
            continue
        for one, below, without in _built(field, value, prefix):
            result.update(flatten(one, below))
            for absent in without:
                result.pop(below + absent, None)
    return result


def _built(field: Any, value: Any, prefix: str) -> Iterator[tuple[object, str, Collection[str]]]:
    """Yield the sections in a field, with the prefix of their names, and what they lack."""
    kind: _Kind = field.metadata[_SECTIONS]
    found = value if kind.several else {} if value is None else {"": value}
    for name, one in found.items():
        yield one, kind.below(prefix, field.name, name), kind.without


def unknown(
    name: str, known: Mapping[str, object], elsewhere: Callable[[str], str | None] | None = None
) -> str:
    """Return the line for a name that does not exist, with the nearest one that does.

    :param elsewhere: returns the hint for a name in a section that does not exist, or None.
    """
    section, dot, _ = name.partition(".")
    hint = None
    if dot and elsewhere is not None and not any(one.startswith(f"{section}.") for one in known):
        hint = elsewhere(name)
    if hint is None:
        alike = [each for each in known if "." in each] if dot else known
        hint = suggestion(name, alike, "see the parameter reference for all names")
    return f"{name}: unknown parameter; {hint}"
