# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conventions have one home: no other source file spells them out."""

import ast
from pathlib import Path

import pytest

from imu_sim_ros import conventions

PACKAGE = Path(conventions.__file__).parent
TOPICS = {value for name, value in vars(conventions).items() if name.endswith("_TOPIC")}
FRAMES = {value for name, value in vars(conventions).items() if name.endswith("_FRAME")}
SOURCES = sorted(path for path in PACKAGE.rglob("*.py") if path.name != "conventions.py")


def constants(tree):
    """Return the constants of a file, its docstrings and help texts aside."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            yield node.value


def vectors(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple | ast.List):
            try:
                yield tuple(ast.literal_eval(node))
            except (ValueError, TypeError):
                continue


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_topics_frames_gravity_and_triads_are_written_once(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    words = {value.removeprefix("/") for value in constants(tree) if isinstance(value, str)}
    assert not words & (TOPICS | FRAMES)
    found = list(vectors(tree))
    assert not [
        v for v in found if v in (conventions.GRAVITY, conventions.TRIADS, conventions.AXES)
    ]
    assert not {conventions.GRAVITY[2], -conventions.GRAVITY[2]} & set(constants(tree))
