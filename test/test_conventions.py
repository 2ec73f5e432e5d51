# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conventions have one home: no other source file spells them out."""

import ast
import re
from pathlib import Path

import pytest

from imu_sim_ros.core import conventions

PACKAGE = Path(conventions.__file__).parent
MANUAL = Path(__file__).parents[1] / "docs"
TOPICS = {value for name, value in vars(conventions).items() if name.endswith("_TOPIC")}
FRAMES = {value for name, value in vars(conventions).items() if name.endswith("_FRAME")}
pytestmark = pytest.mark.usefixtures("uncollected")
SOURCES = sorted(path for path in PACKAGE.rglob("*.py") if path.name != "conventions.py")


def constants(nodes):
    """Return the constants of a file, its docstrings and help texts aside."""
    for node in nodes:
        if isinstance(node, ast.Constant):
            yield node.value


def vectors(nodes):
    for node in nodes:
        if isinstance(node, ast.Tuple | ast.List):
            try:
                yield tuple(ast.literal_eval(node))
            except (ValueError, TypeError):
                continue


def spelled_out(path):
    """Return what a file writes that only conventions.py may."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    literals = list(constants(nodes))
    texts = {value.removeprefix("/") for value in literals if isinstance(value, str)}
    shared = (conventions.GRAVITY, conventions.TRIADS, conventions.AXES)
    gravity = {conventions.GRAVITY[2], -conventions.GRAVITY[2]} & set(literals)
    return [*(texts & (TOPICS | FRAMES)), *(v for v in vectors(nodes) if v in shared), *gravity]


def test_topics_frames_gravity_and_triads_are_written_once():
    violations = {str(path.relative_to(PACKAGE)): spelled_out(path) for path in SOURCES}
    assert not {path: what for path, what in violations.items() if what}


def test_a_place_is_that_of_a_scene():
    """A sensor has a mount."""
    sensor = "(?:IMU|sensor|gyroscope|accelerometer|camera|LiDAR)"
    mount = re.compile(
        f"{sensor}s?'s? places?\\b|places? of (?:the|an?) {sensor}|{sensor} [ia][nt] its place"
    )
    pages = [*SOURCES, *sorted(MANUAL.rglob("*.md"))]
    mounts = {path.name: mount.findall(path.read_text(encoding="utf-8")) for path in pages}
    assert not {name: matches for name, matches in mounts.items() if matches}
