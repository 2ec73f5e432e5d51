# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections of parameters: frozen dataclasses that nest, built from values by dotted name."""

import dataclasses
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, TypeVar, cast

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


@dataclass(frozen=True)
class _Nested:
    """A section within another, see :func:`section`."""

    cls: type
    joint: str = "."
    words: Mapping[str, str] | None = None
    without: Collection[str] = ()
    fixed: bool = False

    def described(self, parameter: Parameter) -> Parameter:
        """Return a parameter of the section as it is described within the other."""
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
    nested = _Nested(cls, joint, words, without, fixed)
    return dataclasses.field(default_factory=cls, metadata={"section": nested})


def variant(key: str, default: str, find: Callable[[str], type], kinds: Mapping[str, type]) -> Any:
    """Describe a nested section whose class depends on the text at ``key`` within it.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    :param kinds: classes that :func:`build` names if a parameter of theirs is given to another.
    """
    return dataclasses.field(
        default_factory=lambda: find(default)(),
        metadata={"variant": (key, default, find), "kinds": kinds},
    )


@dataclass(frozen=True)
class _Each:
    """Sections of names that a parameter lists, see :func:`each`."""

    listed: str
    find: Callable[[str, Mapping[str, object]], type]
    taken: Collection[str]


def each(
    listed: str, find: Callable[[str, Mapping[str, object]], type], taken: Collection[str] = ()
) -> Any:
    """Describe a dictionary of sections by name; their parameters are ``NAME.*``.

    :param listed: the parameter of the same section that lists the names.
    :param find: returns the class for a name and all values, or raises ConfigurationError with one
        line.
    :param taken: names that cannot be used, next to those of parameters.
    """
    return dataclasses.field(default_factory=dict, metadata={"each": _Each(listed, find, taken)})


@dataclass(frozen=True)
class _Shared:
    """Sections that are always there, see :func:`shared`."""

    sections: Callable[[], Mapping[str, type]]
    joint: str | None

    def below(self, prefix: str, name: str) -> str:
        return prefix if self.joint is None else f"{prefix}{name}{self.joint}"


def shared(sections: Callable[[], Mapping[str, type]], joint: str | None) -> Any:
    """Describe a dictionary of sections whose parameters stand among those of the one around it.

    :param joint: behind the name of each, before those of its parameters; None: no name either.
    """
    return dataclasses.field(
        default_factory=lambda: {name: cls() for name, cls in sections().items()},
        metadata={"shared": _Shared(sections, joint)},
    )


@dataclass(frozen=True)
class _Optional:
    """A section that is there or not, see :func:`optional`."""

    cls: Callable[[], type]
    there: Callable[[Mapping[str, object]], bool]


def optional(cls: Callable[[], type], there: Callable[[Mapping[str, object]], bool]) -> Any:
    """Describe a section, or None, whose parameters have no prefix of their own.

    :param cls: returns it; called only if it is there, so that it may be imported then.
    :param there: tells from all values whether it is.
    """
    return dataclasses.field(default=None, metadata={"optional": _Optional(cls, there)})


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
        if "section" in field.metadata:
            within = [field.metadata["section"].cls]
        elif "shared" in field.metadata:
            within = [*field.metadata["shared"].sections().values()]
        else:
            return None
        if any(_fixed(one) is None for one in within):
            return None
    return tuple(_walk_fields(cls, {}, ""))


def _walk_fields(
    cls: type, values: Mapping[str, object], prefix: str
) -> Iterator[tuple[str, Parameter]]:
    for field in dataclasses.fields(cls):
        name = prefix + field.name
        if METADATA in field.metadata:
            yield name, field.metadata[METADATA]
            continue
        for _, nested, below in _inside(field, values, prefix):
            absent = [below + other for other in nested.without]
            for dotted, parameter in _walk(nested.cls, values, below):
                if dotted not in absent:
                    yield dotted, nested.described(parameter)


def _inside(
    field: Any, values: Mapping[str, object], prefix: str
) -> Iterator[tuple[str, _Nested, str]]:
    """Yield the sections within a field: key in its dictionary, class, prefix of their names."""
    if "each" in field.metadata:
        found: _Each = field.metadata["each"]
        for name in listed(found.listed, values):
            yield name, _Nested(found.find(name, values)), f"{name}."
    elif "shared" in field.metadata:
        always: _Shared = field.metadata["shared"]
        for name, cls in always.sections().items():
            yield name, _Nested(cls), always.below(prefix, name)
    elif "optional" in field.metadata:
        maybe: _Optional = field.metadata["optional"]
        if maybe.there(values):
            yield "", _Nested(maybe.cls()), prefix
    else:
        name = prefix + field.name
        nested = _nested(field, values, name)
        yield "", nested, name + nested.joint


def listed(parameter: str, values: Mapping[str, object]) -> list[str]:
    """Return the names that a parameter lists; none, if it is not a list."""
    try:
        value = entries(values.get(parameter, ()))
    except ValueError:
        return []
    return [str(name) for name in value] if isinstance(value, list | tuple) else []


def _nested(field: Any, values: Mapping[str, object], name: str) -> _Nested:
    if "section" in field.metadata:
        return cast(_Nested, field.metadata["section"])
    key, default, find = field.metadata["variant"]
    chosen = values.get(f"{name}.{key}", default)
    return _Nested(find(str(chosen)))


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
        gone: list[str] = []
        if "variant" in field.metadata:
            try:
                _nested(field, values, field.name)
            except ConfigurationError as error:
                problems += error.problems
                gone = [field.name]
        elif "optional" in field.metadata and field.metadata["optional"].there(values):
            values, found = _usable(field.metadata["optional"].cls(), values, known)
            problems += found
        elif "each" in field.metadata:
            found, gone = _unusable_names(cls, field.metadata["each"], values, known)
            problems += found
            if gone:
                listing = field.metadata["each"].listed
                rest = [name for name in listed(listing, values) if name not in gone]
                values = {**values, listing: tuple(rest)}
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
        below = f"{field.name}."
        if "optional" in field.metadata and field.metadata["optional"].there(values):
            line = _of_other_variants(field.metadata["optional"].cls(), values, name)
            if line is not None:
                return line
        if "variant" not in field.metadata or not name.startswith(below):
            continue
        key, default, _ = field.metadata["variant"]
        kinds: Mapping[str, type] = field.metadata["kinds"]
        own = name.removeprefix(below)
        having = [kind for kind, each in kinds.items() if own in parameters(each)]
        chosen = values.get(below + key, default)
        if having:
            verb = "has" if len(having) == 1 else "have"
            of = f"{below}{key} {chosen}"
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
        made: dict[str, Any] = {
            key: _construct(nested.cls, parsed, values, below)
            for key, nested, below in _inside(field, values, prefix)
        }
        several = "each" in field.metadata or "shared" in field.metadata
        arguments[field.name] = made if several else made.get("")
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
    if "each" in field.metadata:
        yield from ((one, f"{name}.", ()) for name, one in value.items())
    elif "shared" in field.metadata:
        always: _Shared = field.metadata["shared"]
        yield from ((one, always.below(prefix, name), ()) for name, one in value.items())
    elif "optional" in field.metadata:
        if value is not None:
            yield value, prefix, ()
    else:
        nested: _Nested = field.metadata.get("section", _Nested(object))
        yield value, f"{prefix}{field.name}{nested.joint}", nested.without


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
