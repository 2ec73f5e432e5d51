# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""PyYAML's safe loader, which reads numbers as ROS does, counts values, and refuses repeated names.

It stands apart from :mod:`imu_sim_ros.parameters.yaml_text` so that PyYAML is imported with the
first text.
"""

import re
from collections.abc import Hashable
from functools import lru_cache
from typing import Any, ClassVar, Final

import yaml
from yaml.composer import Composer, ComposerError
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

_FLOAT: Final = "tag:yaml.org,2002:float"
_NUMBERS: Final = ("tag:yaml.org,2002:int", _FLOAT)
_MERGE: Final = "tag:yaml.org,2002:merge"
_DEEPEST: Final = 32
"""Deepest nesting."""
_MAX_ALIASES: Final = 100
"""Largest number of aliases."""
_MAX_VALUES: Final = 200_000
"""Largest number of values."""
_LONGEST_NUMBER: Final = 400
"""Longest text that is read as a number [letters]."""
_SOURCE: Final = ' in "<unicode string>",'
_LONGEST_REASON: Final = 200
"""Longest text of the library's error in a message [characters]."""


def _refusal(problem: str, mark: yaml.Mark | None) -> Exception:
    return yaml.MarkedYAMLError(None, None, problem, mark)


class _Rules(Composer, SafeConstructor, Resolver):
    """Rules that differ from PyYAML's, and limits on size and depth."""

    depth = aliases = values = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        parser: Any = self  # the other base of each loader
        mark = parser.peek_event().start_mark
        self.aliases += parser.check_event(yaml.AliasEvent)
        if self.aliases > _MAX_ALIASES:
            raise _refusal(f"over {_MAX_ALIASES} aliases", mark)
        self.values += 1
        if self.values > _MAX_VALUES:
            raise _refusal(f"over {_MAX_VALUES:,} values", mark)
        self.depth += 1
        if self.depth > _DEEPEST:
            raise _refusal(f"nested over {_DEEPEST} deep", mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Hashable, object]:
        keys = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != _MERGE:
                if key.value in keys:
                    raise _refusal(f"{key.value!r} is given twice", key.start_mark)
                keys.add(key.value)
        return super().construct_mapping(node, deep=True)

    def construct_list(self, node: yaml.SequenceNode) -> list[object]:
        """Return the whole list: without it, an alias inside it would contain itself."""
        return self.construct_sequence(node, deep=True)

    def construct_scalar(self, node: yaml.ScalarNode | yaml.MappingNode) -> str:
        if node.tag in _NUMBERS and len(str(node.value)) > _LONGEST_NUMBER:
            raise _refusal(f"a number of {len(node.value)} letters", node.start_mark)
        return super().construct_scalar(node)

    yaml_constructors: ClassVar = {
        **SafeConstructor.yaml_constructors,
        "tag:yaml.org,2002:python/tuple": construct_list,
        "tag:yaml.org,2002:seq": construct_list,
        "tag:yaml.org,2002:map": construct_mapping,
        "tag:yaml.org,2002:opencv-matrix": construct_mapping,
    }


_EXPONENT: Final = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$")
_POINT_FIRST: Final = re.compile(r"[-+]?\.\d+([eE][-+]?\d+)?$")
_Rules.add_implicit_resolver(_FLOAT, _EXPONENT, list("-+.0123456789"))
_Rules.add_implicit_resolver(_FLOAT, _POINT_FIRST, list("-+."))


class _PythonLoader(_Rules, yaml.SafeLoader):
    """The loader without libyaml."""


LOADERS: list[Any] = [_PythonLoader]
"""Classes of loaders, the preferred one first; that of libyaml has no types."""
if yaml.__with_libyaml__:
    from yaml._yaml import CParser

    class _CLoader(_Rules, CParser):
        """The loader with libyaml, which is faster."""

        def __init__(self, text: str) -> None:
            CParser.__init__(self, text)
            for base in (Composer, SafeConstructor, Resolver):
                base.__init__(self)

    LOADERS.insert(0, _CLoader)


@lru_cache(maxsize=32)
def content(text: str) -> object:
    """Return the content of a text; presets are read for every run of a study.

    :raises ValueError: with the reason in one line.
    """
    try:
        loader = LOADERS[0](text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _size(node, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        raise ValueError(_reason(error, text)) from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # PyYAML's own constructors trip over !!timestamp 1, !!bool x, 2020-99-99.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(reason[:_LONGEST_REASON]) from None


def _reason(error: yaml.YAMLError, text: str) -> str:
    """Return why a text is not YAML, in one line."""
    mark = error.problem_mark if isinstance(error, yaml.MarkedYAMLError) else None
    number = 0 if mark is None else mark.line
    line = (text.splitlines()[number : number + 1] or [""])[0]
    if "\t" in line[: len(line) - len(line.lstrip())]:
        return f"line {number + 1} is indented with a tab: YAML needs spaces"
    if isinstance(error, ComposerError) and "single document" in str(error):
        return f"another document begins in line {number + 1} (---): keep one of them"
    return " ".join(str(error).split()).replace(_SOURCE, ",")


def _size(node: yaml.Node, sizes: dict[int, int]) -> int:
    """Return how many values a node has once its aliases are written out.

    :param sizes: sizes of the nodes that are known, by their id; 0 while a node's own is counted.
    """
    size = sizes.get(id(node))
    if size == 0:
        raise ValueError("a value that contains itself")
    if size is None:
        sizes[id(node)] = 0
        children = node.value if isinstance(node.value, list) else ()
        parts = [
            part for child in children for part in (child if isinstance(child, tuple) else (child,))
        ]
        size = sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
        if size > _MAX_VALUES:
            raise ValueError(f"over {_MAX_VALUES:,} values")
    return size
