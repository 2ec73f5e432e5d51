# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections of parameters: frozen dataclasses that nest, built from values by dotted name."""

import dataclasses
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, ClassVar, Final, NamedTuple, Protocol, TypeVar, cast, runtime_checkable

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
"""Key of the nesting in the metadata of a dataclass field that holds sections."""


@runtime_checkable
class _WithProblems(Protocol):
    """A section whose values must fit each other."""

    def problems(self, prefix: str) -> Iterable[str]:
        """Return a line for each value that does not fit another one."""


@runtime_checkable
class _WithIgnoredParameters(Protocol):
    """A section that accepts parameters without an effect on it."""

    @staticmethod
    def ignored_parameters() -> Mapping[str, Parameter]:
        """Return the parameters that are checked and ignored, by dotted name."""


@runtime_checkable
class _WithHints(Protocol):
    """A section that knows where parameters of absent sections belong."""

    @staticmethod
    def elsewhere(name: str) -> str | None:
        """Return the end of the line about a parameter of an absent section; None: the usual."""


class _Nesting(ABC):
    """Sections in a field of another section: their names, classes and prefixes.

    The value of the field is a section, which has the name ``""`` here, or a dictionary of sections
    by name.
    """

    is_mapping: ClassVar[bool] = False
    """True if the value of the field is a dictionary of sections by name."""
    declarations: Mapping[str, Parameter] | None = None
    """Declarations of the parameters by name within the section; None: those of the class."""

    @abstractmethod
    def names(self, values: Mapping[str, object]) -> Collection[str]:
        """Return the names of the sections that exist, for all values by dotted name."""

    @abstractmethod
    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        """Return the class of a section, or raise ConfigurationError with one line.

        :param path: dotted name of the field.
        :param name: name of the section.
        :param values: all values by dotted name.
        """

    @abstractmethod
    def prefix(self, field_name: str, name: str) -> str:
        """Return the text between the enclosing section's prefix and a parameter's name."""

    def sections(
        self, field_name: str, prefix: str, values: Mapping[str, object]
    ) -> Iterator[tuple[str, type, str]]:
        """Yield the name, the class and the prefix of the parameters of each section.

        :param prefix: prefix of the field.
        :param values: all values by dotted name.
        """
        for name in self.names(values):
            section_class = self.section_class(prefix + field_name, name, values)
            yield name, section_class, prefix + self.prefix(field_name, name)


@dataclass(frozen=True)
class _FixedSection(_Nesting):
    """A section that always exists and always has the same class."""

    cls: type
    joint: str
    """Text between the name of the field and that of a parameter."""
    declarations: Mapping[str, Parameter] | None

    def names(self, values: Mapping[str, object]) -> Collection[str]:
        return ("",)

    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        return self.cls

    def prefix(self, field_name: str, name: str) -> str:
        return field_name + self.joint


@dataclass(frozen=True)
class _Variant(_Nesting):
    """A section whose class depends on one of its parameters."""

    key: str
    """Name of this parameter in the section."""
    default: str
    """Default of this parameter."""
    find: Callable[[str], type]
    """Function that returns the class for a value of this parameter."""
    classes: Mapping[str, type]
    """Classes by the value of this parameter."""

    def names(self, values: Mapping[str, object]) -> Collection[str]:
        return ("",)

    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        return self.find(str(values.get(f"{path}.{self.key}", self.default)))

    def prefix(self, field_name: str, name: str) -> str:
        return f"{field_name}."


@dataclass(frozen=True)
class _ListedSections(_Nesting):
    """Sections by the names that a parameter of the enclosing section lists."""

    is_mapping = True
    parameter: str
    """Name of this parameter."""
    find: Callable[[str, Mapping[str, object]], type]
    """Function that returns the class for a name and all values."""
    reserved: Collection[str]
    """Names that cannot be listed, in addition to those of parameters."""

    def names(self, values: Mapping[str, object]) -> Collection[str]:
        return names_in_parameter(self.parameter, values)

    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        return self.find(name, values)

    def prefix(self, field_name: str, name: str) -> str:
        return f"{name}."


@dataclass(frozen=True)
class _CommonSections(_Nesting):
    """Sections that always exist, with their parameters among those of the enclosing section."""

    is_mapping = True
    classes: Callable[[], Mapping[str, type]]
    """Function that returns the classes by the names of the sections."""
    joint: str | None
    """Text between the name of a section and that of a parameter; None: no name and no joint."""

    def names(self, values: Mapping[str, object]) -> Collection[str]:
        return self.classes()

    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        return self.classes()[name]

    def prefix(self, field_name: str, name: str) -> str:
        return "" if self.joint is None else name + self.joint


@dataclass(frozen=True)
class _OptionalSection(_Nesting):
    """A section, or None, with its parameters among those of the enclosing section."""

    cls: Callable[[], type]
    """Function that returns the class; called only if the section exists."""
    is_present: Callable[[Mapping[str, object]], bool]
    """Function that returns whether the section exists, for all values by dotted name."""

    def names(self, values: Mapping[str, object]) -> Collection[str]:
        return ("",) if self.is_present(values) else ()

    def section_class(self, path: str, name: str, values: Mapping[str, object]) -> type:
        return self.cls()

    def prefix(self, field_name: str, name: str) -> str:
        return ""


def _section_field(nesting: _Nesting, default: Callable[[], _T]) -> _T:
    """Return a dataclass field that holds sections; its type is that of its value."""
    return field(default_factory=default, metadata={_NESTED: nesting})


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
    :param fixed: True if none of its parameters is live here.
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
    return _section_field(_FixedSection(cls, joint, declarations), cls)


def variant(
    key: str, default: str, find: Callable[[str], type[_T]], variants: Mapping[str, type[_T]]
) -> _T:
    """Describe a nested section whose class depends on its parameter ``key``.

    :param find: returns the class for a string, or raises ConfigurationError with one line.
    :param variants: classes that :func:`build` names if a parameter of theirs is given to another.
    """
    return _section_field(_Variant(key, default, find, variants), lambda: find(default)())


def sections_by_name(
    parameter: str,
    find: Callable[[str, Mapping[str, object]], type[_T]],
    reserved: Collection[str] = (),
) -> Mapping[str, _T]:
    """Describe a dictionary of sections by name; their parameters are ``NAME.*``.

    :param parameter: parameter of the same section that lists the names.
    :param find: returns the class for a name and all values, or raises ConfigurationError with one
        line.
    :param reserved: names that cannot be listed, in addition to those of parameters.
    """
    return _section_field(_ListedSections(parameter, find, reserved), dict[str, _T])


def common_sections(
    classes: Callable[[], Mapping[str, type[_T]]], joint: str | None
) -> Mapping[str, _T]:
    """Describe a dictionary of sections whose parameters stand among those of the enclosing one.

    :param classes: returns the classes of the sections by name.
    :param joint: text between the name of a section and that of a parameter; None: the parameters
        have neither the name nor a joint.
    """

    def defaults() -> Mapping[str, _T]:
        return {name: cls() for name, cls in classes().items()}

    return _section_field(_CommonSections(classes, joint), defaults)


def optional_section(
    cls: Callable[[], type[_T]], is_present: Callable[[Mapping[str, object]], bool]
) -> _T | None:
    """Describe a section, or None, whose parameters stand among those of the enclosing section.

    :param cls: returns the class; called only if the section exists, so that it can import it.
    :param is_present: returns whether the section exists, for all values by dotted name.
    """
    return _section_field(_OptionalSection(cls, is_present), lambda: None)


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
        nesting: _Nesting = dataclass_field.metadata[_NESTED]
        for _, inner, inner_prefix in nesting.sections(dataclass_field.name, prefix, values or {}):
            if nesting.declarations is None:
                result |= parameters(inner, values, inner_prefix)
            else:
                result |= {
                    inner_prefix + name: parameter
                    for name, parameter in nesting.declarations.items()
                }
    return result


def names_in_parameter(parameter: str, values: Mapping[str, object]) -> list[str]:
    """Return the names that a parameter lists; none, if it is not a list."""
    try:
        value = entries(values.get(parameter, ()))
    except ValueError:
        return []
    return [str(name) for name in value] if isinstance(value, list | tuple) else []


def ignored_parameters(cls: type) -> Mapping[str, Parameter]:
    """Return the parameters that a section accepts without an effect on it, by dotted name."""
    return cls.ignored_parameters() if issubclass(cls, _WithIgnoredParameters) else {}


def is_of_ros(name: str) -> bool:
    """Return whether a parameter is one of ROS' own."""
    return name in OF_EVERY_NODE or name.startswith(_QOS)


def build(cls: type[_T], values: Mapping[str, object], complete: bool = True) -> _T:
    """Return the section with the given values and the defaults of all others.

    A section may have ``problems(prefix)``, which returns a line for each value that does not fit
    another one; it is called if a value in the section is set, since defaults fit each other. It
    may have ``ignored_parameters()``, parameters by name that are checked and ignored like ROS's
    own, and ``elsewhere(name)``, the end of the line about a name in an absent section.

    :param values: by dotted name, as :func:`imu_sim_ros.parameters.files.load` returns them.
    :param complete: False if some are missing: nothing is said about what fits what.
    :raises ConfigurationError: with a line for every unknown name and every bad value.
    """
    ignored = {**OF_EVERY_NODE, **ignored_parameters(cls)}
    building = _Building(values)
    result = building.section(cls, "", is_relevant=True)
    values, declared = building.values, building.declared
    hint = cls.elsewhere if issubclass(cls, _WithHints) else None
    problems = building.misnamed + [
        _other_variant_line(cls, values, name) or unknown_parameter_line(name, declared, hint)
        for name in values
        if name not in declared and name not in ignored and not is_of_ros(name)
    ]
    problems += {**bad_value_lines(ignored, values), **building.bad}.values()
    if complete and not problems:
        problems = [
            line
            for section, prefix in building.sections
            if isinstance(section, _WithProblems)
            for line in section.problems(prefix)
        ]
    if problems:
        raise ConfigurationError(problems)
    return result


def bad_value_lines(
    declared: Mapping[str, Parameter], values: Mapping[str, object]
) -> dict[str, str]:
    """Return a line for every bad value of a known name, by name; other names are passed over."""
    lines = {}
    for name, parameter in declared.items():
        if name in values:
            try:
                parameter.parse(name, values[name])
            except ConfigurationError as error:
                (lines[name],) = error.problems
    return lines


def _other_variant_line(cls: type, values: Mapping[str, object], name: str) -> str | None:
    """Return the line for a parameter of another class of its variant; None for any other."""
    for dataclass_field in fields(cls):
        field_name = dataclass_field.name
        nesting: _Nesting | None = dataclass_field.metadata.get(_NESTED)
        if isinstance(nesting, _OptionalSection | _CommonSections):
            for _, inner, _ in nesting.sections(field_name, "", values):
                line = _other_variant_line(inner, values, name)
                if line is not None:
                    return line
        if not isinstance(nesting, _Variant) or not name.startswith(f"{field_name}."):
            continue
        parameter_name = name.removeprefix(f"{field_name}.")
        owners = [
            variant_name
            for variant_name, variant_class in nesting.classes.items()
            if parameter_name in parameters(variant_class)
        ]
        if owners:
            verb = "has" if len(owners) == 1 else "have"
            key = f"{field_name}.{nesting.key}"
            variant = f"{key} {values.get(key, nesting.default)}"
            return f"{name}: unknown parameter of {variant}; {', '.join(owners)} {verb} it"
    return None


class _Plan(NamedTuple):
    """Fields of a section, collected once for all times that it is built."""

    parameters: Mapping[str, Parameter]
    """Parameters of the section itself by dotted name."""
    sections: Sequence[tuple[str, _Nesting]]
    """Names of the fields that hold sections, and their nestings."""


@lru_cache(maxsize=256)
def _plan(cls: type, prefix: str) -> _Plan:
    """Return the fields of a section.

    :param prefix: prefix of the names of its parameters.
    """
    descriptions = [(field.name, field.metadata) for field in fields(cls)]
    return _Plan(
        {prefix + name: data[METADATA] for name, data in descriptions if METADATA in data},
        [(name, data[_NESTED]) for name, data in descriptions if _NESTED in data],
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
    sections: list[tuple[object, str]] = field(default_factory=list)
    """Sections with at least one value, outer ones first, and the prefixes of their parameters."""

    def section(
        self,
        cls: type[_T],
        prefix: str,
        declarations: Mapping[str, Parameter] | None = None,
        is_relevant: bool = False,
    ) -> _T:
        """Return a section with its nested sections.

        :param prefix: prefix of its parameters.
        :param declarations: declarations by dotted name; None: those of the class.
        :param is_relevant: True if the section exists even though none of its parameters is set.
        """
        position, arguments, values = len(self.sections), dict[str, object](), self.values
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
        for field_name, nesting in plan.sections:
            inner = dict[str, object]()
            for name in self._names(nesting):
                inner_prefix = prefix + nesting.prefix(field_name, name)
                inner_class = self._class(nesting, cls, prefix + field_name, name, inner_prefix)
                if inner_class is None:
                    continue
                inner_declarations = declarations
                if declarations is None and nesting.declarations is not None:
                    inner_declarations = {
                        inner_prefix + path: parameter
                        for path, parameter in nesting.declarations.items()
                    }
                is_listed = isinstance(nesting, _ListedSections)
                inner[name] = self.section(inner_class, inner_prefix, inner_declarations, is_listed)
            arguments[field_name] = inner if nesting.is_mapping else inner.get("")
        result = cls(**arguments)
        if is_relevant or len(self.sections) > position:
            self.sections.insert(position, (result, prefix))
        return result

    def _names(self, nesting: _Nesting) -> Collection[str]:
        """Return the names of sections, or raise ConfigurationError if two are the same."""
        names = list(nesting.names(self.values))
        if isinstance(nesting, _ListedSections) and len(set(names)) < len(names):
            # Ambiguous: the values below a repeated name could belong to either section.
            raise ConfigurationError(f"{nesting.parameter} = {names}: names must differ")
        return names

    def _class(
        self, nesting: _Nesting, outer: type, path: str, name: str, prefix: str
    ) -> type | None:
        """Return the class of a section, or None if the section is invalid.

        The values of an invalid section are ignored, so that all others are still checked.

        :param outer: class of the enclosing section, whose names are reserved.
        :param path: dotted name of the field.
        :param name: name of the section.
        :param prefix: prefix of its parameters.
        """
        problems = list[str]()
        if isinstance(nesting, _ListedSections):
            problem = self._name_problem(nesting, outer, name)
            problems += [problem] if problem else []
        if not problems:
            try:
                return nesting.section_class(path, name, self.values)
            except ConfigurationError as error:
                problems += error.problems
        self.misnamed += problems
        remaining = {key: value for key, value in self.values.items() if not key.startswith(prefix)}
        if isinstance(nesting, _ListedSections):
            self.bad.pop(nesting.parameter, None)
            valid_names = names_in_parameter(nesting.parameter, remaining)
            remaining[nesting.parameter] = [n for n in valid_names if n != name]
        self.values = remaining
        return None

    def _name_problem(self, nesting: _ListedSections, outer: type, name: str) -> str | None:
        """Return a line if a listed name is not allowed; register it otherwise."""
        listing = nesting.parameter
        if name in self.names:
            return f"{listing}: {name!r}: is a name in {self.names[name]}"
        self.names[name] = listing
        reserved = {*nesting.reserved, *(field.name for field in fields(outer))}
        if name in reserved or not _SECTION_NAME.fullmatch(name):
            return (
                f"{listing}: {name!r}: must be letters, digits and underscores, and not "
                "a parameter's name"
            )
        return None


def flatten(instance: object) -> dict[str, Value]:
    """Return all values of a section by dotted name; :func:`build` of it gives an equal section."""
    result: dict[str, Value] = {}
    for dataclass_field in fields(cast(Any, instance)):
        value = getattr(instance, dataclass_field.name)
        if METADATA in dataclass_field.metadata:
            result[dataclass_field.name] = value
            continue
        nesting: _Nesting = dataclass_field.metadata[_NESTED]
        sections = value if nesting.is_mapping else {} if value is None else {"": value}
        for name, inner in sections.items():
            inner_prefix = nesting.prefix(dataclass_field.name, name)
            values = flatten(inner)
            names = values if nesting.declarations is None else nesting.declarations
            result.update({inner_prefix + parameter: values[parameter] for parameter in names})
    return result


def unknown_parameter_line(
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
        alike = [parameter for parameter in declared if "." in parameter] if dot else declared
        hint = suggestion(name, alike, "see the parameter reference for all names")
    return f"{name}: unknown parameter; {hint}"
