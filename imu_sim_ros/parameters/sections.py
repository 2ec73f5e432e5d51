# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections of parameters: frozen dataclasses that nest, built from values by dotted name."""

import dataclasses
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeVar, cast

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import suggestion
from imu_sim_ros.parameters.kinds import METADATA, Parameter, Value, entries

_T = TypeVar("_T")
_SECTION_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
OF_EVERY_NODE: Final = {
    "use_sim_time": Parameter("flag", False, "take the time from /clock"),
    "start_type_description_service": Parameter("flag", True, "offer the types' descriptions"),
}
"""What ROS gives to every node; ``ros2 param dump`` writes it into files."""
_QOS: Final = "qos_overrides."


_NESTED: Final = "sections"
"""Key of what describes the sections in a field of a dataclass."""


@dataclass(frozen=True)
class _Nested:
    """The sections in a field of another one.

    :func:`section`, :func:`variant`, :func:`each`, :func:`shared` and :func:`optional` make it.
    """

    before: str
    """What stands before the names of their parameters, with ``{field}`` and ``{name}``."""
    names: Callable[[Mapping[str, object]], Collection[str]]
    """Returns their names from all values that are given; a single section has none, ``""``."""
    find: Callable[[str, Mapping[str, object]], type]
    """Returns the class for a name, or the field's if there is none, and all values."""
    several: bool = False
    """Whether the field is a dictionary of sections by name."""
    own: Mapping[str, Parameter] | None = None
    """Their parameters; None: all those of the class, as it describes them."""
    listed: str = ""
    """The parameter that lists the names, if one does."""
    taken: Collection[str] = ()
    """Names that it cannot list, next to those of parameters."""
    key: str = ""
    """The parameter in the section on which its class depends, if it does."""
    default: str = ""
    """Of that parameter."""
    kinds: Mapping[str, type] = field(default_factory=dict)
    """The classes by that parameter."""

    def classes(
        self, name: str, prefix: str, values: Mapping[str, object]
    ) -> Iterator[tuple[str, type, str]]:
        """Yield the name of each section, its class, and what stands before its parameters.

        :param name: of the field.
        :param prefix: what stands before it.
        """
        for own in self.names(values):
            cls = self.find(own or prefix + name, values)
            yield own, cls, prefix + self.before.format(field=name, name=own)


def section(
    cls: type[_T],
    *,
    joint: str = ".",
    words: Mapping[str, str] | None = None,
    without: Collection[str] = (),
    fixed: bool = False,
) -> _T:
    """Describe a nested section; its parameters' names are the field's, the joint, and their own.

    :param words: replacements of ``{word}`` in the section's texts and units.
    :param without: fields of the section that are not parameters here and keep their default.
    :param fixed: whether none of its parameters is live here.
    """
    own: dict[str, Parameter] | None = None
    if words or without or fixed:
        own = {}
        for name, parameter in parameters(cls).items():
            if name in without:
                continue
            if words:
                text, unit = (of.format_map(words) for of in (parameter.text, parameter.unit))
                parameter = dataclasses.replace(parameter, text=text, unit=unit)
            own[name] = dataclasses.replace(parameter, live=False) if fixed else parameter
    nested = _Nested(f"{{field}}{joint}", lambda _: ("",), lambda *_: cls, own=own)
    return field(default_factory=cls, metadata={_NESTED: nested})


def variant(
    key: str, default: str, find: Callable[[str], type[_T]], kinds: Mapping[str, type[_T]]
) -> _T:
    """Describe a nested section whose class depends on the text at ``key`` within it.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    :param kinds: classes that :func:`build` names if a parameter of theirs is given to another.
    """
    nested = _Nested(
        "{field}.",
        lambda _: ("",),
        lambda name, values: find(str(values.get(f"{name}.{key}", default))),
        key=key,
        default=default,
        kinds=kinds,
    )
    return field(default_factory=lambda: find(default)(), metadata={_NESTED: nested})


def each(
    parameter: str,
    find: Callable[[str, Mapping[str, object]], type[_T]],
    taken: Collection[str] = (),
) -> Mapping[str, _T]:
    """Describe a dictionary of sections by name; their parameters are ``NAME.*``.

    :param parameter: of the same section, which lists the names.
    :param find: returns the class for a name and all values, or raises ConfigurationError with one
        line.
    :param taken: names that cannot be used, next to those of parameters.
    """
    nested = _Nested(
        "{name}.",
        lambda values: listed(parameter, values),
        find,
        several=True,
        listed=parameter,
        taken=taken,
    )
    return field(default_factory=dict, metadata={_NESTED: nested})


def shared(sections: Callable[[], Mapping[str, type[_T]]], joint: str | None) -> Mapping[str, _T]:
    """Describe a dictionary of sections whose parameters stand among those of the one around it.

    :param joint: behind the name of each, before those of its parameters; None: no name either.
    """
    nested = _Nested(
        "" if joint is None else f"{{name}}{joint}",
        lambda _: sections(),
        lambda name, _: sections()[name],
        several=True,
    )
    return field(
        default_factory=lambda: {name: cls() for name, cls in sections().items()},
        metadata={_NESTED: nested},
    )


def optional(
    cls: Callable[[], type[_T]], there: Callable[[Mapping[str, object]], bool]
) -> _T | None:
    """Describe a section, or None, whose parameters have no prefix of their own.

    :param cls: returns it; called only if it is there, so that it may be imported then.
    :param there: tells from all values whether it is.
    """
    nested = _Nested("", lambda values: ("",) if there(values) else (), lambda *_: cls())
    return field(default=None, metadata={_NESTED: nested})


def parameters(
    cls: type, values: Mapping[str, object] | None = None, prefix: str = ""
) -> dict[str, Parameter]:
    """Return every parameter of a section by its dotted name.

    :param values: chosen values; they decide which class a variant has.
    :param prefix: before each name.
    """
    result: dict[str, Parameter] = {}
    for one in fields(cls):
        if METADATA in one.metadata:
            result[prefix + one.name] = one.metadata[METADATA]
            continue
        nested: _Nested = one.metadata[_NESTED]
        for _, inner, below in nested.classes(one.name, prefix, values or {}):
            if nested.own is None:
                result |= parameters(inner, values, below)
            else:
                result |= {below + name: parameter for name, parameter in nested.own.items()}
    return result


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


def build(cls: type[_T], values: Mapping[str, object], complete: bool = True) -> _T:
    """Return the section with the given values and the defaults of all others.

    A section may have ``problems(prefix)``: a line for each value that does not fit another one. It
    is asked if something in it is given; defaults fit each other. It may have ``passed_over()``:
    parameters by name that it has no use for. Their values, and those of ROS' own parameters, are
    checked and left. It may have ``elsewhere(name)``: the end of the line about a name in a section
    that does not exist; None: the usual one.

    :param values: by dotted name, as :func:`imu_sim_ros.parameters.files.load` returns them.
    :param complete: False if some are missing: nothing is said about what fits what.
    :raises ConfigurationError: with a line for every unknown name and every bad value.
    """
    unused = {**OF_EVERY_NODE, **getattr(cls, "passed_over", dict)()}
    building = _Building(values)
    result = building.section(cls, "", named=True)
    values, known, elsewhere = building.values, building.known, getattr(cls, "elsewhere", None)
    problems = building.misnamed + [
        _of_other_variants(cls, values, name) or unknown(name, known, elsewhere)
        for name in values
        if name not in known and name not in unused and not is_of_ros(name)
    ]
    problems += {**bad_values(unused, values), **building.bad}.values()
    if complete and not problems:
        asked = (one for one in building.made if hasattr(one[0], "problems"))
        problems = [line for one, prefix in asked for line in one.problems(prefix)]
    if problems:
        raise ConfigurationError(problems)
    return result


def bad_values(known: Mapping[str, Parameter], values: Mapping[str, object]) -> dict[str, str]:
    """Return a line for every bad value of a known name, by name; other names are passed over."""
    lines = {}
    for name, parameter in known.items():
        if name in values:
            try:
                parameter.parse(name, values[name])
            except ConfigurationError as error:
                (lines[name],) = error.problems
    return lines


def _of_other_variants(cls: type, values: Mapping[str, object], name: str) -> str | None:
    """Return the line for a parameter that only other classes of its variant have; else None."""
    for one in fields(cls):
        nested: _Nested | None = one.metadata.get(_NESTED)
        if nested is not None and not nested.before:
            for _, inner, _ in nested.classes(one.name, "", values):
                line = _of_other_variants(inner, values, name)
                if line is not None:
                    return line
        if nested is None or not nested.key or not name.startswith(f"{one.name}."):
            continue
        own = name.removeprefix(f"{one.name}.")
        having = [word for word, kind in nested.kinds.items() if own in parameters(kind)]
        if having:
            verb = "has" if len(having) == 1 else "have"
            key = f"{one.name}.{nested.key}"
            of = f"{key} {values.get(key, nested.default)}"
            return f"{name}: unknown parameter of {of}; {', '.join(having)} {verb} it"
    return None


class _Plan(NamedTuple):
    """The fields of a section, as often as it is built."""

    parameters: Mapping[str, Parameter]
    """Its own parameters by dotted name."""
    sections: Sequence[tuple[str, _Nested]]
    """Names of the fields that hold sections, and their descriptions."""


@lru_cache(maxsize=256)
def _plan(cls: type, prefix: str) -> _Plan:
    """Return the fields of a section.

    :param prefix: what stands before the names of its parameters.
    """
    described = [(field.name, field.metadata) for field in fields(cls)]
    return _Plan(
        {prefix + name: data[METADATA] for name, data in described if METADATA in data},
        [(name, data[_NESTED]) for name, data in described if METADATA not in data],
    )


@dataclass
class _Building:
    """Sections on their way from values: one walk that makes them and notes all that is wrong."""

    values: Mapping[str, object]
    """By dotted name, without those of sections that cannot be."""
    known: dict[str, Parameter] = field(default_factory=dict)
    """All parameters by dotted name."""
    names: dict[str, str] = field(default_factory=dict)
    """The names of sections so far, and the parameters that list them."""
    misnamed: list[str] = field(default_factory=list)
    """A line for each section that cannot be."""
    bad: dict[str, str] = field(default_factory=dict)
    """A line for each bad value, by dotted name."""
    made: list[tuple[Any, str]] = field(default_factory=list)
    """The sections in which something is given, the outer ones first, and what stands before their
    parameters."""

    def section(
        self,
        cls: type[_T],
        prefix: str,
        own: Mapping[str, Parameter] | None = None,
        named: bool = False,
    ) -> _T:
        """Return a section with the sections in it.

        :param prefix: what stands before its parameters.
        :param own: them by dotted name; None: as the class describes them.
        :param named: whether it is there because it is named, whatever is given in it.
        """
        position, arguments, values = len(self.made), dict[str, Any](), self.values
        plan = _plan(cast(Any, cls), prefix)
        known = plan.parameters
        if own is not None:
            known = {path: own[path] for path in known if path in own}
        self.known |= known
        for path in [path for path in known if path in values]:
            named = True
            try:
                arguments[path[len(prefix) :]] = known[path].parse(path, values[path])
            except ConfigurationError as error:
                (self.bad[path],) = error.problems
        for field_name, nested in plan.sections:
            path = prefix + field_name
            names = list(nested.names(self.values))
            if len(set(names)) < len(names):
                # Which other name was meant is not known, nor whose the values below it are.
                raise ConfigurationError(f"{nested.listed} = {names}: names must differ")
            inner = dict[str, Any]()
            for name in names:
                below = prefix + nested.before.format(field=field_name, name=name)
                kind = self._class(nested, cls, name or path, below)
                if kind is not None:
                    described = own
                    if own is None and nested.own is not None:
                        described = {below + word: each for word, each in nested.own.items()}
                    inner[name] = self.section(kind, below, described, bool(nested.listed))
            arguments[field_name] = inner if nested.several else inner.get("")
        result = cls(**arguments)
        if named or len(self.made) > position:
            self.made.insert(position, (result, prefix))
        return result

    def _class(self, nested: _Nested, outer: type, name: str, below: str) -> type | None:
        """Return the class of a section, or None if it cannot be.

        What is given in that one is left out, so that all else is still checked.

        :param outer: the class of the section around it, whose names are taken.
        :param name: its own, or else the dotted name of the field.
        :param below: what stands before its parameters.
        """
        listing, problems = nested.listed, list[str]()
        if listing and name in self.names:
            problems.append(f"{listing}: {name!r}: is a name in {self.names[name]}")
        elif listing:
            self.names[name] = listing
            taken = {*nested.taken, *(field.name for field in fields(outer))}
            if name in taken or not _SECTION_NAME.fullmatch(name):
                problems.append(
                    f"{listing}: {name!r}: must be letters, digits and underscores, and not "
                    "a parameter's name"
                )
        if not problems:
            try:
                return nested.find(name, self.values)
            except ConfigurationError as error:
                problems += error.problems
        self.misnamed += problems
        left = {key: each for key, each in self.values.items() if not key.startswith(below)}
        if listing:
            self.bad.pop(listing, None)
            left[listing] = [each for each in listed(listing, left) if each != name]
        self.values = left
        return None


def flatten(instance: object, prefix: str = "") -> dict[str, Value]:
    """Return all values of a section by dotted name; :func:`build` of it gives an equal section."""
    result: dict[str, Value] = {}
    for one in fields(cast(Any, instance)):
        value = getattr(instance, one.name)
        if METADATA in one.metadata:
            result[prefix + one.name] = value
            continue
        nested: _Nested = one.metadata[_NESTED]
        sections = value if nested.several else {} if value is None else {"": value}
        for name, inner in sections.items():
            below = prefix + nested.before.format(field=one.name, name=name)
            values = flatten(inner)
            names = values if nested.own is None else nested.own
            result.update({below + own: values[own] for own in names})
    return result


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
