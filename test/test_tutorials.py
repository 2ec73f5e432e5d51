# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tutorials and guides: every block is run, in order, and prints what the page shows."""

import os
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from imu_sim_ros.terminal import startup

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    page
    for page in (ROOT / "docs/tutorials").glob("*.md")
    if page.stem not in ("gallery", "exercises")
)
GUIDES = [
    ROOT / f"docs/how_to/{name}.md"
    for name in ("ci_gate", "data_sheet", "own_place", "own_sensor", "own_trajectory")
]
GUIDES += [ROOT / "docs/tutorials/exercises.md", ROOT / "docs/explanation/splines.md"]
GUIDES += [ROOT / f"docs/how_to/{name}.md" for name in ("madgwick", "error_model", "migration")]
GUIDES += [ROOT / "docs/how_to/motion_capture.md"]
NEEDS = {
    "motion_capture": "bvhio",
    "vio_stack": "gtsam",
    "madgwick": "ahrs",
    "own_place": "embreex",
}
"""Pages with a library that only the tests install."""
PICTURES = {
    "first_flight": "drift.png",
    "own_twin": "twin/twin.png",
    "still_hour": "allan/allan.png",
    "vio_stack": "vio.png",
    "which_imu": "which_imu.png",
}


NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
SPEED = re.compile(r"in [\d.,]+ s \([\d.,]+ (k )?messages/s\)")


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Return a page's fenced blocks: the tolerance in the comment above, language and content."""
    fence = r"^(?:<!-- numbers within ([\d.]+) % -->\n)?```(\w*)\n(.*?)^```"
    return re.findall(fence, page.read_text(encoding="utf-8"), re.M | re.S)


def run_line(line: str) -> None:
    """Run a command as the shell would, in this process."""
    program_name, name, *rest = shlex.split(line)
    if program_name == "imu_sim":
        assert startup.load(f"imu_sim_ros.commands.{name}").main(rest) == 0, line
        return
    assert program_name == "python", line
    sys.argv = [name, *rest]
    sys.path.insert(0, str((ROOT / name).parent))  # as for a script that Python starts
    runpy.run_path(str(ROOT / name), run_name="__main__")
    del sys.path[0]


def run_block(language: str, content: str, names: dict[str, object]) -> None:
    """Run a page's block; a parameter file is written under the name in its first line."""
    if language == "sh":
        for line in content.replace("\\\n", " ").splitlines():
            run_line(line)
    elif language == "python":
        exec(compile(content, "tutorial", "exec"), names)
    elif language == "yaml" and content.startswith("# "):
        Path(content.split()[1]).write_text(content)


def lines_of(text: str) -> list[str]:
    """Return a text's lines with single spaces, without the speed of this machine."""
    lines = [SPEED.sub("", " ".join(line.split())) for line in text.splitlines()]
    return [line for line in lines if line not in ("", "...")]


def is_printed(shown: str, printed: list[str], tolerance: float) -> bool:
    """Return whether a line is among those printed, to the last digit, or within a tolerance.

    Where a number depends on the version of a library, the page says so, and the comment above
    the block has the relative tolerance.
    """
    if not tolerance:
        return shown in printed

    def numbers(line: str) -> list[float]:
        return [float(number.replace(",", "")) for number in NUMBER.findall(line)]

    candidates = [line for line in printed if NUMBER.sub("#", line) == NUMBER.sub("#", shown)]
    return any(numbers(line) == pytest.approx(numbers(shown), rel=tolerance) for line in candidates)


def run_page(page: Path, folder: Path, monkeypatch, capsys) -> None:
    """Run a page's blocks in a folder and compare what they print with what it shows."""
    if page.stem in NEEDS:
        pytest.importorskip(NEEDS[page.stem])
    monkeypatch.chdir(folder)
    (folder / "examples").symlink_to(ROOT / "examples")  # as at the top of the checkout
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", ["page"])
    printed, names = "", {"__name__": "page"}
    for percent, language, content in blocks(page):
        if language == "text":
            printed_lines, tolerance = lines_of(printed), float(percent or 0.0) / 100.0
            missing = [
                line for line in lines_of(content) if not is_printed(line, printed_lines, tolerance)
            ]
            assert not missing, "\n".join(
                ["not printed:", *missing, "", "printed:", *printed_lines]
            )
            continue
        run_block(language, content, names)
        printed = capsys.readouterr().out


def check_picture(path: Path, shown: Path, exact: bool) -> None:
    """Check that a picture is that of the manual; ``make pictures`` draws those anew.

    Releases of matplotlib place letters differently, by a pixel or so: then it is compared
    coarsely, by means over 40 x 40 pixels.

    :param exact: its numbers do not depend on the version of a library.
    """
    pictures = [plt.imread(source)[..., :3] for source in (path, shown)]
    assert pictures[0].shape == pictures[1].shape
    assert min(pictures[0].shape[:2]) > 200
    releases = [Image.open(source).info["Software"] for source in (path, shown)]
    if releases[0] == releases[1]:
        differing = np.mean(np.abs(pictures[0] - pictures[1]).max(axis=2) > 0.1)
        assert differing < (0.001 if exact else 0.01)
    rows, columns = (size // 40 for size in pictures[0].shape[:2])
    means = [
        picture[: 40 * rows, : 40 * columns].reshape(rows, 40, columns, 40, 3).mean(axis=(1, 3))
        for picture in pictures
    ]
    assert np.abs(means[0] - means[1]).max() < 0.1
    assert np.std(means[0]) > 0.01  # not an empty page


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_runs_as_it_is_written(page, tmp_path, monkeypatch, capsys):
    run_page(page, tmp_path, monkeypatch, capsys)
    image = f"images/tutorial_{page.stem}.png"
    text = page.read_text(encoding="utf-8")
    assert f"../{image}" in text
    if os.environ.get("DRAW_PICTURES"):
        shutil.copyfile(tmp_path / PICTURES[page.stem], ROOT / "docs" / image)
    check_picture(
        tmp_path / PICTURES[page.stem], ROOT / "docs" / image, exact="numbers within" not in text
    )


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.stem)
def test_a_guide_runs_as_it_is_written(page, tmp_path, monkeypatch, capsys):
    run_page(page, tmp_path, monkeypatch, capsys)


def test_the_files_that_the_exercises_name_exist():
    """Each exercise says where its formula is."""
    page = (ROOT / "docs/tutorials/exercises.md").read_text(encoding="utf-8")
    script_names = set(re.findall(r"`([\w/]+\.py)`", page))
    assert len(script_names) > 12
    homes = (ROOT, ROOT / "imu_sim_ros")
    assert not [name for name in script_names if not any((home / name).is_file() for home in homes)]


def test_tutorials_write_no_file_of_another_one():
    """All tutorials can be followed one after the other in one folder."""
    writers: dict[str, str] = {}
    for page in [*PAGES, ROOT / "docs/tutorials/exercises.md"]:
        text = page.read_text(encoding="utf-8")
        outputs = re.findall(
            r"(?:-o|--plot|--save) (\S+)|save(?:fig)?\(\"([^\"]+)\"|^# (\S+\.yaml)", text, re.M
        )
        for name in {"".join(groups).partition("/")[0] for groups in outputs}:
            assert writers.setdefault(name, page.stem) == page.stem, name
    assert len(writers) > 15


def test_every_tutorial_has_a_picture_and_is_about_five():
    assert {page.stem for page in PAGES} == set(PICTURES)
