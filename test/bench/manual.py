# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write the tables of a run of benchmarks into the manual.

    make bench > bench.log && .venv/bin/python test/bench/manual.py bench.log

A table stands on a page between ``<!-- make bench: NAME -->``, or ``<!-- make bench: NAME, TITLE
-->`` for those parts of a benchmark whose title begins with TITLE, and ``<!-- end -->``. A run of
some of a page's benchmarks fills it only if machine and date are those on the page.
"""

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

MANUAL: Final = Path(__file__).resolve().parents[2] / "docs"
_SECTION: Final = re.compile(r"^=== (\w+)$", re.MULTILINE)
BLOCK: Final = re.compile(
    r"(?P<begin><!-- make bench: (?P<name>\w+)(?:, (?P<title>[^>]*?))? -->\n)"
    r"(?P<text>.*?)(?P<end><!-- end -->)",
    re.DOTALL,
)
RUN: Final = "run"
"""Name of the block with the machine and the date of the run."""


class Part(NamedTuple):
    """A table of a benchmark, or a line that it prints."""

    title: str
    """Title of the table, or the line."""
    table: list[list[str]]
    """Cells by row, the header first; none for a line."""

    def markdown(self) -> str:
        """Return the part as it stands on a page."""
        if not self.table:
            return f"{_sentence(self.title)}\n"
        rows = [f"| {' | '.join(row)} |" for row in self.table]
        return "\n".join(
            [_sentence(self.title, ":"), "", rows[0], _rule(self.table), *rows[1:], ""]
        )


def _sentence(line: str, end: str = ".") -> str:
    """Return a line with a capital and an end."""
    return f"{line[0].upper()}{line[1:].rstrip('.:')}{end}"


def _rule(table: list[list[str]]) -> str:
    """Return the line below a header: numbers stand to the right."""
    return "|".join(["", "---", *["---:"] * (len(table[0]) - 1), ""])


def parts(output: str) -> Iterator[Part]:
    """Yield the tables and lines that a benchmark has printed."""
    lines: list[str] = []
    for block in re.split(r"\n\s*\n", output.strip("\n")):
        rows = block.splitlines()
        if len(rows) > 1 and set(rows[1].strip()) == {"─"}:
            title = lines.pop() if lines else ""
            yield from (Part(line, []) for line in lines)
            lines = []
            table = [re.split(r" {2,}", row.strip()) for row in (rows[0], *rows[2:])]
            if any(len(row) != len(table[0]) for row in table):
                raise ValueError(f"{title}: rows of different lengths")
            yield Part(title, table)
        else:
            lines += [row.strip() for row in rows]
    yield from (Part(line, []) for line in lines if line)


def sections(log: str) -> dict[str, list[Part]]:
    """Return the parts of each benchmark of a run, and the run's first line."""
    head, *texts = _SECTION.split(log)
    machine = [line for line in head.splitlines() if line.startswith("Python ")]
    printed = {RUN: [Part(line, []) for line in machine]}
    for name, text in zip(texts[::2], texts[1::2], strict=True):
        printed[name] = list(parts(text))
    return printed


def filled(page: str, printed: dict[str, list[Part]]) -> str:
    """Return a page with the parts of a run in its blocks; blocks of other benchmarks stay.

    :raises ValueError: for a block whose part the run has not printed, and for a page with tables
        of another run that this one does not replace.
    """
    names = {block["name"] for block in BLOCK.finditer(page)}
    absent = sorted(names - set(printed))
    if RUN in names and absent and not all(part.markdown() in page for part in printed[RUN]):
        raise ValueError(f"is of another run, and this one has no {', '.join(absent)}")

    def text(block: re.Match[str]) -> str:
        name, title = block["name"], block["title"] or ""
        if name not in printed:
            return block[0]
        chosen = [part for part in printed[name] if part.title.startswith(title)]
        if not chosen:
            raise ValueError(f"{name} has printed no {title or 'table'}")
        return "\n".join([block["begin"], *(part.markdown() for part in chosen), block["end"]])

    return BLOCK.sub(text, page)


def main() -> int:
    """Fill all pages of the manual; return 1 if a page stays unchanged."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, help="output of make bench")
    printed = sections(parser.parse_args().log.read_text(encoding="utf-8"))
    status = 0
    for path in sorted(MANUAL.rglob("*.md")):
        page = path.read_text(encoding="utf-8")
        names = {block["name"] for block in BLOCK.finditer(page)}
        if names & set(printed):
            try:
                path.write_text(filled(page, printed), encoding="utf-8")
                line = ", ".join(sorted(names & set(printed)))
            except ValueError as error:
                line, status = f"not filled: {error}", 1
            print(f"{path.relative_to(MANUAL)}: {line}")
    return status


if __name__ == "__main__":
    sys.exit(main())
