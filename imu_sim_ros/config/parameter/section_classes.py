# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The decorator of sections: a frozen dataclass whose methods are written once for all of them.

:func:`dataclasses.dataclass` writes and compiles the methods of each class anew. With nearly sixty
sections that was 15 ms of every program's start.
"""

import dataclasses
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, TypeVar

if TYPE_CHECKING:  # to a type checker a section is what it looks like
    from dataclasses import dataclass as section_class

__all__ = ["section_class"]

_T = TypeVar("_T")
_Fields = tuple[tuple[str, Any, Any], ...]


@cache
def _fields(cls: type) -> _Fields:
    """Return name, default and factory of each field; ``MISSING`` where it has none."""
    return tuple((f.name, f.default, f.default_factory) for f in dataclasses.fields(cls))


@cache
def _values(cls: type) -> Callable[[object], object]:
    """Return what returns the values of all fields."""
    return attrgetter(*(name for name, *_ in _fields(cls)))


def _init(self: Any, *values: object, **named: object) -> None:
    fields, own = _fields(self.__class__), vars(self)
    for (name, *_), value in zip(fields, values, strict=False):
        if name in named:
            raise TypeError(f"{type(self).__name__}: {name} is given twice")
        named[name] = value
    for name, default, factory in fields:
        if name in named:
            own[name] = named.pop(name)
        elif factory is not dataclasses.MISSING:
            own[name] = factory()
        elif default is not dataclasses.MISSING:
            own[name] = default
        else:
            raise TypeError(f"{type(self).__name__}: {name} is missing")
    if named or len(values) > len(fields):
        raise TypeError(f"{type(self).__name__}: takes no {', '.join(named) or 'more values'}")


def _repr(self: Any) -> str:
    shown = ", ".join(f"{name}={getattr(self, name)!r}" for name, *_ in _fields(self.__class__))
    return f"{type(self).__qualname__}({shown})"


def _eq(self: Any, other: object) -> Any:
    values = _values(self.__class__)
    if other.__class__ is not self.__class__:
        return NotImplemented
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_values(self.__class__)(self))


_METHODS: Final = {"__init__": _init, "__repr__": _repr, "__eq__": _eq, "__hash__": _hash}

if not TYPE_CHECKING:

    def section_class(*, frozen: bool) -> Callable[[_T], _T]:
        """Make a section of a class; a dataclass derived from it needs ``frozen=True`` as well."""

        def made(cls: _T) -> _T:
            for name, method in _METHODS.items():
                setattr(cls, name, method)
            return dataclasses.dataclass(frozen=frozen, init=False, repr=False, eq=False)(cls)

        return made
