# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Without ROS nothing needs Linux: its own calls are hidden, and the programs run all the same.

What a pip install puts on the PATH is held here as well.
"""

import configparser
import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HIDDEN = (
    *("O_DIRECT", "O_NOATIME", "O_PATH", "O_TMPFILE", "copy_file_range", "eventfd", "fdatasync"),
    *("getrandom", "memfd_create", "pidfd_open", "pipe2", "posix_fadvise", "posix_fallocate"),
    *("sched_getaffinity", "sched_setaffinity", "sched_setscheduler", "setns", "splice"),
    *("unshare", "waitid"),
)
"""Names of ``os`` that exist on Linux and not on macOS."""

HIDE = f"""
import ctypes, os, resource, select, signal, socket, sys, time
for name in {HIDDEN!r}:
    if hasattr(os, name):
        delattr(os, name)
for module, name in (
    *((select, "epoll"), (resource, "prlimit"), (signal, "sigtimedwait")),
    *((signal, "sigwaitinfo"), (time, "CLOCK_BOOTTIME"), (socket, "AF_NETLINK")),
):
    if hasattr(module, name):
        delattr(module, name)
real = ctypes.CDLL
def without_prctl(name, *rest, **options):
    found = real(name, *rest, **options)
    return found if name is not None else object()
ctypes.CDLL = without_prctl
sys.modules["rclpy"] = None
sys.modules["ament_index_python"] = None
from imu_sim_ros.commands import start
"""


SMALL = (
    "--camera euroc_cam0 --set camera.width=188 --set camera.height=120 "
    "--set camera.intrinsics=[114.7,114.3,91.8,62.1]"
)


def run(folder: Path, *lines: str) -> None:
    calls = "\n".join(
        f"sys.argv[:] = {['imu_sim', *line.split()]!r}\nassert start.imu_sim() == 0, {line!r}"
        for line in lines
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", HIDE + calls],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_files_are_written_and_read_without_linux(tmp_path):
    """Each kind, those of a drive with GNSS and wheels, and of a campaign."""
    (tmp_path / "plan.yaml").write_text("parameters: {rate: 50.0, duration: 1.0}\nseeds: 2\n")
    run(
        tmp_path,
        "generate -o a.mcap --duration 3s --compression lz4 --quiet",
        "generate -o b --storage sqlite3 --duration 3s --quiet",
        "generate -o c.bag --duration 3s --quiet",
        "generate -o d --format euroc --duration 3s --quiet",
        "convert_bag c.bag -o e.mcap --quiet",
        "dead_reckon a.mcap -o track.csv --quiet",
        "evaluate track.csv a.mcap --quiet",
        "generate -o rest.mcap --trajectory static --duration 60s --imu-only --quiet",
        "allan rest.mcap -o allan --skip-checks --quiet",
        "report a.mcap -o a.html --quiet",
        "generate -o f.mcap --trajectory town --wheels husky_a200 --gnss zed_f9p --duration 2s "
        "--quiet",
        "campaign plan.yaml -o results --workers 1 --no-report --quiet",
    )


def test_images_and_tracks_are_written_and_read_without_linux(tmp_path):
    pytest.importorskip("cv2")
    run(
        tmp_path,
        f"generate -o seen --format euroc {SMALL} --duration 0.2s --quiet",
        "convert_bag seen -o seen.mcap --images compressed --quiet",
        f"generate -o b --format tracks {SMALL} --scene corridor --trajectory tour "
        "--set trajectory.place=corridor --duration 0.1s --quiet",
    )


def test_a_serial_line_is_written_and_read_without_linux(tmp_path):
    script = """
from imu_sim_ros.nodes.simulator.serial_line import PseudoTerminal
line = PseudoTerminal("gps")
reader = os.open("gps", os.O_RDONLY | os.O_NOCTTY)
line.send(b"$GPGGA")
assert os.read(reader, 100) == b"$GPGGA"
line.close()
"""
    command = [sys.executable, "-c", HIDE + script]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_name_that_only_linux_has_stands_behind_a_guard():
    used = set()
    for path in (ROOT / "imu_sim_ros").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for name in re.findall(rf"\bos\.({'|'.join(HIDDEN)})\b", text):
            used.add(name)
            assert f'hasattr(os, "{name}")' in text, f"{path}: os.{name}"
        assert "select.epoll" not in text, path
    assert used == {"fdatasync", "sched_getaffinity"}


def test_a_program_is_run_and_killed_without_prctl(tmp_path, monkeypatch):
    from imu_sim_ros.campaigns import command_estimator

    monkeypatch.setattr(command_estimator, "_libc", object)  # it has no prctl
    command_estimator._prctl(command_estimator._PR_SET_CHILD_SUBREAPER, 1)
    monkeypatch.setattr(command_estimator, "Path", lambda _: tmp_path / "no_such_folder")
    assert command_estimator._children() == set()


def scripts(folder: Path) -> set[str]:
    """Return the names of the programs in a description of a package."""
    entry_points = configparser.ConfigParser()
    entry_points.read(next(folder.glob("*.egg-info")) / "entry_points.txt")
    return set(entry_points["console_scripts"])


def test_a_pip_install_puts_one_program_on_the_path(tmp_path):
    pytest.importorskip("setuptools")
    # A copy: in the checkout, setuptools reads the names of all files, those of .venv too.
    for name in ("setup.py", "setup.cfg", "package.xml", "README.md"):
        shutil.copy(ROOT / name, tmp_path)
    arguments = ["setup.py", "-q", "egg_info"]
    subprocess.run([sys.executable, *arguments], cwd=tmp_path, capture_output=True, check=True)
    assert scripts(tmp_path) == {"imu_sim"}


def test_the_source_distribution_has_its_tests_the_manual_and_the_changelog(tmp_path):
    """All files of the checkout; what git ignores in these folders is no part of it."""
    pytest.importorskip("setuptools")
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns("__pycache__", "_build", "*.egg-info", "euroc_*", "kaist_*")
    for folder in (".ci", ".github", "config", "docs", "examples", "imu_sim_ros", "launch", "test"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=ignored)
    shutil.copytree(ROOT / "resource", copy / "resource")
    kinds = {".md", ".rst", ".cff", ".py", ".toml", ".cfg", ".xml", ".yaml", ".in"}
    for path in ROOT.iterdir():
        if path.suffix in kinds or path.name in ("Makefile", "LICENSE", ".flake8", ".gitignore"):
            shutil.copy(path, copy)
    expected = {path.relative_to(copy).as_posix() for path in copy.rglob("*") if path.is_file()}
    arguments = ["setup.py", "-q", "sdist", "--formats", "tar", "-d", str(tmp_path)]
    subprocess.run([sys.executable, *arguments], cwd=copy, capture_output=True, check=True)
    (archive,) = tmp_path.glob("*.tar")
    with tarfile.open(archive) as file:
        names = {member.name.partition("/")[2] for member in file if member.isfile()}
    assert not expected - names
    assert {"CHANGELOG.rst", "docs/index.md", "test/data/recorded/README.md"} <= names


@pytest.mark.ros
def test_colcon_installs_every_program():
    from imu_sim_ros.commands.start import NODES, PROGRAMS

    assert scripts(ROOT / "build/imu_sim_ros") == {"imu_sim", *PROGRAMS, *NODES}
