# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections of parameters: frozen dataclasses that nest, built from values by dotted name."""

import dataclasses
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeVar, cast

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.parameters.kinds import METADATA, Parameter, Value, entries

_T = TypeVar("_T")
_SECTION_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
OF_EVERY_NODE: Final = {
    "use_sim_time": Parameter("flag", False, "take the time from /clock"),
    "start_type_description_service": Parameter("flag", True, "offer the types' descriptions"),
}
"""Parameters that ROS adds to every node; ``ros2 param dump`` writes them into files."""
_QOS: Final = "qos_overrides."


_NESTED: Final = "sections"
"""Key of the description of nested sections in the metadata of a dataclass field."""


@dataclass(frozen=True)
class _Nested:
    """The sections in a field of another one.

    :func:`section`, :func:`variant`, :func:`each`, :func:`shared` and :func:`optional` make it.
    """

    before: str
    """Prefix of the names of their parameters, with ``{field}`` and ``{name}``."""
    names: Callable[[Mapping[str, object]], Collection[str]]
    """Function that returns their names from all values; a single section has the name ``""``."""
    find: Callable[[str, Mapping[str, object]], type]
    """Function that returns the class for a name, or for the name of the field, and all values."""
    several: bool = False
    """True if the field is a dictionary of sections by name."""
    declarations: Mapping[str, Parameter] | None = None
    """Declarations of their parameters; None: those of the class."""
    listed: str = ""
    """Name of the parameter that lists the names; empty: no parameter lists them."""
    reserved: Collection[str] = ()
    """Names that it cannot list, in addition to those of parameters."""
    key: str = ""
    """Name of the parameter in the section that selects its class; empty: the class is fixed."""
    default: str = ""
    """Default of the parameter ``key``."""
    kinds: Mapping[str, type] = field(default_factory=dict)
    """Classes by the value of the parameter ``key``."""

    def classes(
        self, name: str, prefix: str, values: Mapping[str, object]
    ) -> Iterator[tuple[str, type, str]]:
        """Yield the name of each section, its class, and the prefix of its parameters.

        :param name: name of the field.
        :param prefix: prefix of the field.
        """
        for section_name in self.names(values):
            cls = self.find(section_name or prefix + name, values)
            yield section_name, cls, prefix + self.before.format(field=name, name=section_name)


def section(
    cls: type[_T],
    *,
    joint: str = ".",
    substitutions: Mapping[str, str] | None = None,
    without: Collection[str] = (),
    fixed: bool = False,
) -> _T:
    """Describe a nested section; its parameters' names are the field's, the joint, and their own.

    :param substitutions: replacements of ``{word}`` in the section's texts and units.
    :param without: fields of the section that are not parameters here and keep their default.
    :param fixed: whether none of its parameters is live here.
    """
    declarations: dict[str, Parameter] | None = None
    if substitutions or without or fixed:
        declarations = {}
        for name, parameter in parameters(cls).items():
            if name in without:
                continue
            if substitutions:
                text, unit = (
                    description.format_map(substitutions)
                    for description in (parameter.text, parameter.unit)
                )
                parameter = dataclasses.replace(parameter, text=text, unit=unit)
            declarations[name] = dataclasses.replace(parameter, live=False) if fixed else parameter
    nested = _Nested(
        f"{{field}}{joint}", lambda _: ("",), lambda *_: cls, declarations=declarations
    )
    return field(default_factory=cls, metadata={_NESTED: nested})


def variant(
    key: str, default: str, find: Callable[[str], type[_T]], variants: Mapping[str, type[_T]]
) -> _T:
    """Describe a nested section whose class depends on the text at ``key`` within it.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    :param variants: classes that :func:`build` names if a parameter of theirs is given to another.
    """
    nested = _Nested(
        "{field}.",
        lambda _: ("",),
        lambda name, values: find(str(values.get(f"{name}.{key}", default))),
        key=key,
        default=default,
        kinds=variants,
    )
    return field(default_factory=lambda: find(default)(), metadata={_NESTED: nested})


def sections_by_name(
    parameter: str,
    find: Callable[[str, Mapping[str, object]], type[_T]],
    reserved: Collection[str] = (),
) -> Mapping[str, _T]:
    """Describe a dictionary of sections by name; their parameters are ``NAME.*``.

    :param parameter: of the same section, which lists the names.
    :param find: returns the class for a name and all values, or raises ConfigurationError with one
        line.
    :param reserved: names that cannot be used, next to those of parameters.
    """
    nested = _Nested(
        "{name}.",
        lambda values: listed_names(parameter, values),
        find,
        several=True,
        listed=parameter,
        reserved=reserved,
    )
    return field(default_factory=dict, metadata={_NESTED: nested})


def common_sections(
    sections: Callable[[], Mapping[str, type[_T]]], joint: str | None
) -> Mapping[str, _T]:
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


def optional_section(
    cls: Callable[[], type[_T]], is_present: Callable[[Mapping[str, object]], bool]
) -> _T | None:
    """Describe a section, or None, whose parameters have no prefix of their own.

    :param cls: returns it; called only if it is there, so that it may be imported then.
    :param is_present: tells from all values whether it is.
    """
    nested = _Nested("", lambda values: ("",) if is_present(values) else (), lambda *_: cls())
    return field(default=None, metadata={_NESTED: nested})


def parameters(
    cls: type, values: Mapping[str, object] | None = None, prefix: str = ""
) -> dict[str, Parameter]:
    """Return every parameter of a section by its dotted name.

    :param values: chosen values; they decide which class a variant has.
    :param prefix: before each name.
    """
    result: dict[str, Parameter] = {}
    for dataclass_field in fields(cls):
        if METADATA in dataclass_field.metadata:
            result[prefix + dataclass_field.name] = dataclass_field.metadata[METADATA]
            continue
        nested: _Nested = dataclass_field.metadata[_NESTED]
        for _, inner, inner_prefix in nested.classes(dataclass_field.name, prefix, values or {}):
            if nested.declarations is None:
                result |= parameters(inner, values, inner_prefix)
            else:
                result |= {
                    inner_prefix + name: parameter
                    for name, parameter in nested.declarations.items()
                }
    return result


def listed_names(parameter: str, values: Mapping[str, object]) -> list[str]:
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
    result = building.section(cls, "", is_relevant=True)
    values, declared, elsewhere = (
        building.values,
        building.declared,
        getattr(cls, "elsewhere", None),
    )
    problems = building.misnamed + [
        _of_other_variants(cls, values, name) or unknown(name, declared, elsewhere)
        for name in values
        if name not in declared and name not in unused and not is_of_ros(name)
    ]
    problems += {**bad_values(unused, values), **building.bad}.values()
    if complete and not problems:
        checked_sections = (
            section for section in building.sections if hasattr(section[0], "problems")
        )
        problems = [
            line for section, prefix in checked_sections for line in section.problems(prefix)
        ]
    if problems:
        raise ConfigurationError(problems)
    return result


def bad_values(declared: Mapping[str, Parameter], values: Mapping[str, object]) -> dict[str, str]:
    """Return a line for every bad value of a known name, by name; other names are passed over."""
    lines = {}
    for name, parameter in declared.items():
        if name in values:
            try:
                parameter.parse(name, values[name])
            except ConfigurationError as error:
                (lines[name],) = error.problems
    return lines


def _of_other_variants(cls: type, values: Mapping[str, object], name: str) -> str | None:
    """Return the line for a parameter that only other classes of its variant have; else None."""
    for dataclass_field in fields(cls):
        nested: _Nested | None = dataclass_field.metadata.get(_NESTED)
        if nested is not None and not nested.before:
            for _, inner, _ in nested.classes(dataclass_field.name, "", values):
                line = _of_other_variants(inner, values, name)
                if line is not None:
                    return line
        if nested is None or not nested.key or not name.startswith(f"{dataclass_field.name}."):
            continue
        parameter_name = name.removeprefix(f"{dataclass_field.name}.")
        owners = [
            kind_name
            for kind_name, kind in nested.kinds.items()
            if parameter_name in parameters(kind)
        ]
        if owners:
            verb = "has" if len(owners) == 1 else "have"
            key = f"{dataclass_field.name}.{nested.key}"
            variant = f"{key} {values.get(key, nested.default)}"
            return f"{name}: unknown parameter of {variant}; {', '.join(owners)} {verb} it"
    return None


class _Plan(NamedTuple):
    """Fields of a section, collected once for all times that it is built."""

    parameters: Mapping[str, Parameter]
    """Parameters of the section itself by dotted name."""
    sections: Sequence[tuple[str, _Nested]]
    """Names of the fields that hold sections, and their descriptions."""


@lru_cache(maxsize=256)
def _plan(cls: type, prefix: str) -> _Plan:
    """Return the fields of a section.

    :param prefix: prefix of the names of its parameters.
    """
    descriptions = [(field.name, field.metadata) for field in fields(cls)]
    return _Plan(
        {prefix + name: data[METADATA] for name, data in descriptions if METADATA in data},
        [(name, data[_NESTED]) for name, data in descriptions if METADATA not in data],
    )


@dataclass
class _Building:
    """Construction of nested sections from values, with all problems that occur."""

    values: Mapping[str, object]
    """Values by dotted name, without those of invalid sections."""
    declared: dict[str, Parameter] = field(default_factory=dict)
    """All parameters by dotted name."""
    names: dict[str, str] = field(default_factory=dict)
    """Parameters that list the names of sections, by these names."""
    misnamed: list[str] = field(default_factory=list)
    """Line for each invalid section."""
    bad: dict[str, str] = field(default_factory=dict)
    """Line for each bad value, by dotted name."""
    sections: list[tuple[Any, str]] = field(default_factory=list)
    """Sections with at least one value, outer ones first, and the prefixes of their parameters."""

    def section(
        self,
        cls: type[_T],
        prefix: str,
        declarations: Mapping[str, Parameter] | None = None,
        is_relevant: bool = False,
    ) -> _T:
        """Return a section with the sections in it.

        :param prefix: prefix of its parameters.
        :param declarations: declarations by dotted name; None: those of the class.
        :param is_relevant: True if the section exists even though none of its parameters is set.
        """
        position, arguments, values = len(self.sections), dict[str, Any](), self.values
        plan = _plan(cast(Any, cls), prefix)
        declared = plan.parameters
        if declarations is not None:
            declared = {path: declarations[path] for path in declared if path in declarations}
        self.declared |= declared
        for path in [path for path in declared if path in values]:
            is_relevant = True
            try:
                arguments[path[len(prefix) :]] = declared[path].parse(path, values[path])
            except ConfigurationError as error:
                (self.bad[path],) = error.problems
        for field_name, nested in plan.sections:
            path = prefix + field_name
            names = list(nested.names(self.values))
            if len(set(names)) < len(names):
                # Ambiguous: the values below a repeated name could belong to either section.
                raise ConfigurationError(f"{nested.listed} = {names}: names must differ")
            inner = dict[str, Any]()
            for name in names:
                inner_prefix = prefix + nested.before.format(field=field_name, name=name)
                kind = self._class(nested, cls, name or path, inner_prefix)
                if kind is not None:
                    inner_declarations = declarations
                    if declarations is None and nested.declarations is not None:
                        inner_declarations = {
                            inner_prefix + path: parameter
                            for path, parameter in nested.declarations.items()
                        }
                    inner[name] = self.section(
                        kind, inner_prefix, inner_declarations, bool(nested.listed)
                    )
            arguments[field_name] = inner if nested.several else inner.get("")
        result = cls(**arguments)
        if is_relevant or len(self.sections) > position:
            self.sections.insert(position, (result, prefix))
        return result

    def _class(self, nested: _Nested, outer: type, name: str, prefix: str) -> type | None:
        """Return the class of a section, or None if the section is invalid.

        The values of an invalid section are ignored, so that all others are still checked.

        :param outer: class of the enclosing section, whose names are reserved.
        :param name: name of the section, or else the dotted name of the field.
        :param prefix: prefix of its parameters.
        """
        listing, problems = nested.listed, list[str]()
        if listing and name in self.names:
            problems.append(f"{listing}: {name!r}: is a name in {self.names[name]}")
        elif listing:
            self.names[name] = listing
            reserved = {*nested.reserved, *(field.name for field in fields(outer))}
            if name in reserved or not _SECTION_NAME.fullmatch(name):
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
        remaining = {key: value for key, value in self.values.items() if not key.startswith(prefix)}
        if listing:
            self.bad.pop(listing, None)
            remaining[listing] = [
                section_name
                for section_name in listed_names(listing, remaining)
                if section_name != name
            ]
        self.values = remaining
        return None


def flatten(instance: object, prefix: str = "") -> dict[str, Value]:
    """Return all values of a section by dotted name; :func:`build` of it gives an equal section."""
    result: dict[str, Value] = {}
    for dataclass_field in fields(cast(Any, instance)):
        value = getattr(instance, dataclass_field.name)
        if METADATA in dataclass_field.metadata:
            result[prefix + dataclass_field.name] = value
            continue
        nested: _Nested = dataclass_field.metadata[_NESTED]
        sections = value if nested.several else {} if value is None else {"": value}
        for name, inner in sections.items():
            inner_prefix = prefix + nested.before.format(field=dataclass_field.name, name=name)
            values = flatten(inner)
            names = values if nested.declarations is None else nested.declarations
            result.update({inner_prefix + parameter: values[parameter] for parameter in names})
    return result


def unknown(
    name: str, declared: Mapping[str, object], elsewhere: Callable[[str], str | None] | None = None
) -> str:
    """Return the line for a name that does not exist, with the nearest one that does.

    :param elsewhere: returns the hint for a name in a section that does not exist, or None.
    """
    section, dot, _ = name.partition(".")
    hint = None
    if (
        dot
        and elsewhere is not None
        and not any(parameter.startswith(f"{section}.") for parameter in declared)
    ):
        hint = elsewhere(name)
    if hint is None:
        alike = [each for each in declared if "." in each] if dot else declared
        hint = suggestion(name, alike, "see the parameter reference for all names")
    return f"{name}: unknown parameter; {hint}"
