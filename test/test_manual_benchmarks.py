# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the manual that ``make bench`` measures are those that it prints."""

import re
from pathlib import Path

import pytest
from scripts import load_script

ROOT = Path(__file__).parents[1]
BENCH = ROOT / "test/bench"


manual = load_script(BENCH / "manual.py")
PAGES = {
    "explanation/benchmarks.md": [
        *(("run", None), ("speeds", "median"), ("speeds", "allan")),
        ("error_node", None),
    ],
    "explanation/cost.md": [
        *(("run", None), ("growth", "generate"), ("growth", "campaign of")),
        *(("growth", "a run takes"), ("growth", "simulated")),
    ],
    "reference/nodes.md": [("recorder", None)],
}
LOG = """make: colcon build
Python 3.12.1, 2 cores, 1 December 2026

=== growth
cost, 10 min

  rate      wall s   CPU s
 ──────────────────────────
  100 Hz      0.52    0.57
  4000 Hz     4.75

a run takes 9.9 ms
simulated campaign: time

  runs    1 workers
 ──────────────────────
  1,000   11.9 s (83 %)


=== speeds
3 s in all
"""
PAGE = """Before

<!-- make bench: growth, cost -->
stale
<!-- end -->
<!-- make bench: growth, a run -->
<!-- end -->
<!-- make bench: growth, simulated -->
<!-- end -->
<!-- make bench: run -->
<!-- end -->
"""


def blocks():
    """Return the blocks of the whole manual by page."""
    texts = {path: path.read_text(encoding="utf-8") for path in manual.MANUAL.rglob("*.md")}
    by_page = {
        path.relative_to(manual.MANUAL).as_posix(): list(manual.BLOCK.finditer(text))
        for path, text in texts.items()
    }
    return {name: matches for name, matches in by_page.items() if matches}


def test_a_run_fills_the_blocks_of_a_page():
    log = LOG.replace("4000 Hz     4.75", "4000 Hz     4.75    7.20")
    page = manual.filled(PAGE, manual.sections(log))
    expected = """Before

<!-- make bench: growth, cost -->

Cost, 10 min:

| rate | wall s | CPU s |
|---|---:|---:|
| 100 Hz | 0.52 | 0.57 |
| 4000 Hz | 4.75 | 7.20 |

<!-- end -->
<!-- make bench: growth, a run -->

A run takes 9.9 ms.

<!-- end -->
<!-- make bench: growth, simulated -->

Simulated campaign: time:

| runs | 1 workers |
|---|---:|
| 1,000 | 11.9 s (83 %) |

<!-- end -->
<!-- make bench: run -->

Python 3.12.1, 2 cores, 1 December 2026.

<!-- end -->
"""
    assert page == expected
    assert manual.filled(page, manual.sections(log)) == page


RECORDER = "<!-- make bench: recorder -->\nas it was\n<!-- end -->\n"


def test_a_page_of_another_run_is_not_filled_in_part():
    printed = manual.sections(LOG.replace("4000 Hz     4.75", "4000 Hz     4.75    7.20"))
    assert manual.filled(RECORDER, printed) == RECORDER
    page = manual.filled(PAGE, printed) + RECORDER
    assert manual.filled(page, printed) == page
    with pytest.raises(ValueError, match="is of another run, and this one has no recorder"):
        manual.filled(page.replace("December", "November"), printed)


def test_a_table_that_was_not_printed_is_named():
    printed = manual.sections(LOG.partition("simulated")[0].replace("    4.75", "    4.75  7.20"))
    with pytest.raises(ValueError, match="growth has printed no simulated"):
        manual.filled(PAGE, printed)


def test_a_row_without_a_cell_is_refused():
    with pytest.raises(ValueError, match="cost, 10 min: rows of different lengths"):
        manual.sections(LOG)


def test_each_page_has_its_blocks_and_no_other_page_has_any():
    names = {page: [(m["name"], m["title"]) for m in matches] for page, matches in blocks().items()}
    assert names == PAGES


def test_blocks_have_the_form_that_the_benchmarks_print():
    """Each column and, of speeds, each row is one of the benchmark as it is now."""
    scripts = {path.stem.removeprefix("bench_"): path for path in BENCH.rglob("bench_*.py")}
    for matches in blocks().values():
        for match in matches:
            tables = re.findall(r"\n(\|.*)\n\|---", match["text"])
            assert match["name"] == "run" or tables or match["title"] in ("allan", "a run takes")
            for header in tables:
                source = scripts[match["name"]].read_text(encoding="utf-8")
                for column in header.strip("| ").split(" | "):
                    text = re.split(r"\d", column)[0].strip()  # rates and workers are numbers
                    assert f'"{text}' in source, f"{match['name']}: {column}"
    (page,) = [m for m in blocks()["explanation/benchmarks.md"] if m["title"] == "median"]
    rows = re.findall(r"^\| ([^|]+) \|", page["text"], re.M)[1:]
    assert rows == list(load_script(BENCH / "bench_speeds.py").CASES)
