# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One HTML file from its content, with style, programs and numbers inside.

The content is a tree of plain values that the scripts of ``assets/`` draw. It is embedded in a
script element as JSON in which ``<``, ``>`` and ``&`` are escaped, so that no text can end the
element, and it enters the page as text only. A content security policy lets the browser run only
the page's own script, by its hash, and fetch nothing.
"""

import base64
import hashlib
import html as markup
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import AXIS_COLOURS, SERIES_COLOURS
from imu_sim_ros.core.names import printable_text
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.terminal.json_text import json_text

_SCRIPTS: Final = (
    *("base.js", "plot.js", "path.js", "table.js"),
    *("verdict.js", "runs.js", "main.js"),
)
_DARK_AXES: Final = {"x": "#FF7A75", "y": "#5FD37A", "z": "#82ABFF"}
_DARK_SERIES: Final = (
    *("#CF9BEB", "#FFB04D", "#4FD0D8", "#FF94C8", "#D2A679", "#C3D04A", "#A9B5C0"),
)
"""The colours of axes and series on a dark page."""
_STYLE: Final = "page.css"
_DIGITS: Final = 6
"""Significant digits of numbers in curves."""
_USUAL: Final = 0.9
"""Share of a column's values from which the usual one is written once, and the others by row."""
_PACKED: Final = 500
"""Numbers from which a column is written as floats: 5.3 letters each, not some 8."""

Item = JsonObject
"""``kind``: a key of ``builders`` in main.js; the rest as that takes it."""


class Section(NamedTuple):
    """A section of a page, with its anchor."""

    title: str
    items: list[Item]
    short: str = ""
    """The link's words; none: the title."""


def html(title: str, lines: Sequence[str], sections: Sequence[Section]) -> str:
    """Return a page.

    :param lines: the lines below the title.
    :param sections: values that are not finite become gaps.
    """
    style = _style()
    script = f'"use strict";\nconst SERIES_COLOURS = {len(SERIES_COLOURS)};\n'
    script += "".join(_asset(name) for name in _SCRIPTS)
    content = {"sections": [section._asdict() for section in sections]}
    policy = (
        f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    subtitle = "".join(f'<p class="faint">{markup.escape(line)}</p>\n' for line in lines)
    return printable_text(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{markup.escape(title)}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"<header><h1>{markup.escape(title)}</h1>\n{subtitle}"
        "<noscript><p>The plots and tables need JavaScript.</p></noscript></header>\n"
        '<nav><div><div id="links"></div></div></nav>\n<main></main>\n'
        f'<script type="application/json" id="content">{json_for_script(content)}</script>\n'
        f"<script>{script}</script>\n</body>\n</html>\n"
    )


def json_for_script(content: object) -> str:
    """Return content as JSON that is safe in a script element."""
    text = json_text(content, _six_digits, separators=(",", ":"))
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _six_digits(value: float) -> float | int:
    """Return a number with six digits, a whole one if it is."""
    short = float(f"{value:.{_DIGITS}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def column(name: str, values: Iterable[object]) -> Item:
    """Return a table's column; repeated values are stored once, many numbers as floats."""
    entries = list(values)
    if len(entries) > _PACKED:
        usual = max(counted := Counter(entries), key=counted.__getitem__)
        if counted[usual] > _USUAL * len(entries):
            exceptions = [[row, value] for row, value in enumerate(entries) if value != usual]
            return {"name": name, "usual": usual, "count": len(entries), "others": exceptions}
    texts = list(dict.fromkeys(value for value in entries if isinstance(value, str)))
    if (
        texts
        and len(texts) * 2 < len(entries)
        and all(isinstance(v, str) or v is None for v in entries)
    ):
        order = {word: k for k, word in enumerate(texts)}
        index = [order[value] if isinstance(value, str) else None for value in entries]
        return {"name": name, "words": texts, "index": index}
    if len(entries) > _PACKED and any(type(v) is float for v in entries) and _are_many(entries):
        packed = np.array([np.nan if v is None else v for v in entries], dtype="<f4")
        return {"name": name, "f4": base64.b64encode(packed.tobytes()).decode()}
    return {"name": name, "values": entries}


def _are_many(values: Sequence[object]) -> bool:
    """Return whether values are numbers that seldom recur: they are short as floats."""
    plain = all(v is None or (isinstance(v, int | float) and type(v) is not bool) for v in values)
    return plain and 2 * len(set(values)) > len(values)


def plot(title: str, x: str, y: str, series: list[Item], log: str = "", **options: object) -> Item:
    """Return a plot.

    :param x: label of the horizontal axis; ``y``: label of the vertical one.
    :param log: logarithmic axes, of "xy".
    :param options: further fields, such as ``link``, ``legend`` and ``caption``.
    """
    return {
        "kind": "plot",
        "title": title,
        "x": {"label": x, "log": "x" in log},
        "y": {"label": y, "log": "y" in log},
        "series": series,
        **options,
    }


def table(name: str, header: Sequence[str], rows: Sequence[Sequence[object]], search: bool) -> Item:
    """Return a table from its rows."""
    columns = [column(head, (row[k] for row in rows)) for k, head in enumerate(header)]
    return {"kind": "table", "name": name, "columns": columns, "search": search}


def _style() -> str:
    """Return the style sheet with the colours of axes (``--x``) and series (``--c0``)."""
    light = _variables(AXIS_COLOURS, SERIES_COLOURS)
    dark = _variables(_DARK_AXES, _DARK_SERIES)
    return (
        f":root {{ {light} }}\n"
        "@media screen and (prefers-color-scheme: dark) "
        f'{{ :root:not([data-theme="light"]) {{ {dark} }} }}\n'
        f'@media screen {{ :root[data-theme="dark"] {{ {dark} }} }}\n{_asset(_STYLE)}'
    )


def _variables(axes: Mapping[str, str], series: Sequence[str]) -> str:
    """Return the colours as variables of CSS."""
    colours = {**axes, **{f"c{number}": colour for number, colour in enumerate(series)}}
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items())


def _asset(name: str) -> str:
    """Return the text of a file of the page: script or style."""
    return (resources.files(__package__) / "assets" / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    """Return the digest of a script as the content security policy takes it."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"
