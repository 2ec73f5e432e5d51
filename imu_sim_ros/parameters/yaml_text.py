# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML read safely, with the numbers that ROS reads, and without what may hide or explode.

A name that is given twice, endless nesting or strings and lists that repeat themselves are errors:
what a file says is then what is used. The size of a text and the number of its values are bounded,
and the time grows with them only: a few seconds at most.
"""

import copy
import re
from functools import lru_cache
from typing import Any, Final

_EXPONENT: Final = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$")
_POINT_FIRST: Final = re.compile(r"[-+]?\.\d+([eE][-+]?\d+)?$")
_TUPLE: Final = "tag:yaml.org,2002:python/tuple"
_MAPPING: Final = "tag:yaml.org,2002:map"
_MERGE: Final = "tag:yaml.org,2002:merge"
_DEEPEST: Final = 32
_MAX_ALIASES: Final = 100
_LARGEST: Final = 4 << 20
"""[letters] The metadata.yaml of a bag of 10,000 files has 2 million."""
_MAX_VALUES: Final = 200_000
_SOURCE: Final = ' in "<unicode string>",'
_LONGEST_REASON: Final = 200
_REMEMBERED: Final = 1 << 16
"""[letters] of a text that is parsed once only, however often it is read."""
_LONGEST_NUMBER: Final = 400
"""[letters] of one value that is read as a number."""


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text, read safely and with numbers as ROS reads them.

    YAML 1.1 takes ``5e-4`` for a string because it has no point, and ``-.2`` because no digit is
    before its point; ROS, kalibr and people do not. launch_ros writes each list of a launch file
    as a Python tuple: that tag, and no other of Python's, is read as the list that it is.

    :raises ValueError: for text that is not YAML or is refused, with the reason in one line.
    """
    if len(text) > _LARGEST:
        raise ValueError(f"more than {_LARGEST >> 20} MiB of YAML")
    return copy.deepcopy(_parsed(text)) if len(text) < _REMEMBERED else _parsed.__wrapped__(text)


@lru_cache(maxsize=32)
def _parsed(text: str) -> Any:
    """Return the content of a text; presets are read for every run of a study."""
    import yaml  # 30 ms that a start without files saves

    try:
        loader = _class()(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _size(node, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split()).replace(_SOURCE, ",")) from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # PyYAML's own constructors trip over !!timestamp 1, !!bool x, 2020-99-99.
        words = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(words[:_LONGEST_REASON]) from None


def _size(node: Any, sizes: dict[int, int]) -> int:
    """Return how many values a node has once its aliases are written out.

    :param sizes: of the nodes that are known, by their id; 0 while a node's own is counted.
    """
    known = sizes.get(id(node))
    if known == 0:
        raise ValueError("a value that contains itself")
    if known is None:
        sizes[id(node)] = 0
        children = node.value if isinstance(node.value, list) else ()
        parts = [part for child in children for part in _parts(child)]
        known = sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
        if known > _MAX_VALUES:
            raise ValueError(f"over {_MAX_VALUES:,} values")
    return known


def _parts(child: Any) -> tuple[Any, ...]:
    return child if isinstance(child, tuple) else (child,)


@lru_cache(maxsize=1)
def _class() -> Any:
    """Return the loader's class, which is made once, when yaml is needed."""
    import yaml

    class Loader(_checking(yaml)):  # type: ignore[misc]
        """The rules for numbers, lists and names."""

    # Without the list, an alias inside its own list would be a value that contains itself.
    def construct_list(loader: Any, node: Any) -> Any:
        return loader.construct_sequence(node, deep=True)

    def construct_map(loader: Any, node: Any) -> Any:
        return loader.construct_mapping(node)

    number = "tag:yaml.org,2002:float"
    Loader.add_implicit_resolver(number, _EXPONENT, list("-+.0123456789"))
    Loader.add_implicit_resolver(number, _POINT_FIRST, list("-+."))
    for tag in (_TUPLE, "tag:yaml.org,2002:seq"):
        Loader.add_constructor(tag, construct_list)
    Loader.add_constructor(_MAPPING, construct_map)
    return Loader


def _checking(yaml: Any) -> Any:
    """Return a safe loader that counts values and refuses names given twice."""

    def refused(words: str, mark: Any) -> Exception:
        return yaml.MarkedYAMLError(None, None, words, mark)

    class Checking(_loader(yaml)):  # type: ignore[misc]
        depth = aliases = values = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            mark = self.peek_event().start_mark
            self.aliases += self.check_event(yaml.AliasEvent)
            if self.aliases > _MAX_ALIASES:
                raise refused(f"over {_MAX_ALIASES} aliases", mark)
            self.values += 1
            if self.values > _MAX_VALUES:
                raise refused(f"over {_MAX_VALUES:,} values", mark)
            self.depth += 1
            if self.depth > _DEEPEST:
                raise refused(f"nested over {_DEEPEST} deep", mark)
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            seen = set()
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode) and key.tag != _MERGE:
                    if key.value in seen:
                        raise refused(f"{key.value!r} is given twice", key.start_mark)
                    seen.add(key.value)
            return super().construct_mapping(node, deep=True)

        def construct_scalar(self, node: Any) -> Any:
            number = node.tag in ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
            if number and len(str(node.value)) > _LONGEST_NUMBER:
                raise refused(f"a number of {len(node.value)} letters", node.start_mark)
            return super().construct_scalar(node)

    return Checking


def _loader(yaml: Any) -> Any:
    """Return a safe loader, by libyaml if PyYAML has it, which is seven times faster."""
    if not yaml.__with_libyaml__:
        return yaml.SafeLoader
    composer, parser = yaml.composer.Composer, yaml.cyaml.CParser
    constructor, resolver = yaml.constructor.SafeConstructor, yaml.resolver.Resolver

    class Loader(composer, parser, constructor, resolver):  # type: ignore[misc, valid-type]
        def __init__(self, text: str) -> None:
            parser.__init__(self, text)
            for base in (composer, constructor, resolver):
                base.__init__(self)

    return Loader
