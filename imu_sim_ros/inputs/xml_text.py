# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""XML from untrusted files as a tree of elements, of bounded size, without entities.

A document type, with which entities are declared, is refused.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.inputs.rows import read_text

_DEEPEST: Final = 200
"""Deepest nesting of elements."""
_MAX_ELEMENTS: Final = 1_000_000
"""Largest number of elements."""
_LONGEST_TEXT: Final = 4096
"""Longest text of an element [characters]."""
_BUFFER: Final = 1 << 20
"""Size of the text that the parser delivers at once [bytes]."""


@dataclass
class Element:
    """An element of XML: its name, attributes, text and children."""

    tag: str
    attributes: Mapping[str, str]
    text: str = ""
    children: "list[Element]" = field(default_factory=list)

    def child(self, *path: str) -> "Element | None":
        """Return the first element on a path of names; None if there is none."""
        element: Element | None = self
        for name in path:
            element = (
                next((c for c in element.children if c.tag == name), None) if element else None
            )
        return element

    def every(self) -> "Iterator[Element]":
        """Yield this element and all below."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)


def parse_xml(path: str | Path, longest_text: int = _LONGEST_TEXT) -> Element:
    """Return the root of a file of bounded size, depth and number of elements.

    :param longest_text: characters of an element from which on its text is cut.
    :raises InputError: for what is not XML, and for a document type.
    """
    root = Element("", {})
    stack, count = [root], 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(stack) > _DEEPEST or count > _MAX_ELEMENTS:
            raise InputError(f"{path}: nested deeper than {_DEEPEST}, or very many elements")
        element = Element(tag, attributes)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

    def text(characters: str) -> None:
        if len(stack[-1].text) < longest_text:
            stack[-1].text += characters

    def refuse(*_: object) -> None:
        raise InputError(f"{path}: has a document type (<!DOCTYPE ...>), which is not read")

    # Its text is known to be UTF-8, whatever encoding it declares; Python knows not all of these.
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text, parser.buffer_size = True, _BUFFER
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse
    content = read_text(path).encode()
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise InputError(f"{path}: not XML: {error}") from None
    return root
