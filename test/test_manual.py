# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""README and manual: every link between them leads somewhere, and formulas need no network."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]


def anchors(page):
    """Return what GitHub and MyST make of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        linked_page = page.parent / name if name else page
        assert linked_page.exists(), target
        if anchor and linked_page.suffix == ".md":
            assert anchor in anchors(linked_page), target


def test_every_page_is_in_one_of_the_four_kinds_and_in_the_table_of_contents():
    trees = re.findall(r"```\{toctree\}\n(.*?)```", (DOCS / "index.md").read_text(), re.S)
    listed = [line for tree in trees for line in tree.split() if "/" in line]
    pages = [page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES[2:]]
    assert sorted(listed) == sorted(page for page in pages if page != "index")
    kinds = {"tutorials", "how_to", "reference", "explanation", "contributing"}
    assert {page.split("/")[0] for page in listed} == kinds


@pytest.mark.ros  # the manual's tools are not part of the run on the oldest versions
def test_formulas_are_drawn_without_a_network(tmp_path):
    """The page with most of them, built: no script from elsewhere, no TeX left in the text."""
    pytest.importorskip("sphinx")
    shutil.copytree(DOCS / "_static", tmp_path / "docs/_static")
    shutil.copy(DOCS / "conf.py", tmp_path / "docs")
    theory = (DOCS / "explanation/theory.md").read_text(encoding="utf-8")
    theory = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", theory)  # links to pages that are not here
    (tmp_path / "docs/index.md").write_text(theory, encoding="utf-8")
    build = [
        sys.executable,
        "-m",
        "sphinx",
        "-q",
        "-W",
        str(tmp_path / "docs"),
        str(tmp_path / "built"),
    ]
    subprocess.run(build, check=True)
    page = (tmp_path / "built/index.html").read_text(encoding="utf-8")
    formulas = re.findall(r"<math .*?</math>", page, re.S)
    assert len(formulas) == len(re.findall(r"\$\$.*?\$\$|\$[^$]+\$", theory, re.S)) > 50
    assert not re.search(r"""(src|href)=["'](https?:)?//[^"']*\.(js|css|woff2?)""", page)
    remaining = re.sub(r"<math .*?</math>|<script.*?</script>", "", page, flags=re.S)
    assert "\\" not in remaining
    assert "<munderover>" not in "".join(formulas)


GENERATED = ("findings", "parameters", "presets", "programs")
LONGEST = 2500
"""Words of a page that somebody reads from its beginning to its end."""


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_page_is_too_long_to_be_read(page):
    word_count = len(page.read_text(encoding="utf-8").split())
    assert word_count <= LONGEST or page.stem in GENERATED, word_count


def test_the_messages_of_the_troubleshooting_page_are_those_of_the_programs():
    page = (DOCS / "how_to/troubleshooting.md").read_text(encoding="utf-8")
    sources = [*(ROOT / "imu_sim_ros").rglob("*.py"), ROOT / "Makefile"]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    text = re.sub(r'"\s*\n\s*f?"', "", text)  # strings that go on in the next line
    text = re.sub(r"\{argument\('(\w+)'.*?\)\}", r"--\1", text)  # as a command's user writes it
    text = re.sub(r"\{job_argument\('convert', '(\w+)'\)\}", r"convert_bag --\1", text)
    foreign = ("New subscription discovered", "requesting incompatible QoS", "XMLPARSER Error")
    headings = re.findall(r"^### (`.*)$", page, re.M)
    assert len(headings) > 10
    for heading in headings:
        for message in re.findall(r"`([^`]*)`", heading):
            for piece in message.replace("'...'", "...").split("..."):
                if len(phrase := piece.strip(" ,;:'?")) > 8 and not phrase.startswith(foreign):
                    assert phrase in text, message
