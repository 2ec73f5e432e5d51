# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML read safely, with the numbers that ROS reads, and without what may hide or explode.

A name that is given twice, endless nesting or strings and lists that repeat themselves are errors:
what a file says is then what is used. The size of a text and the number of its values are bounded,
and the time grows with them only: a few seconds at most.
"""

import copy
import re
from collections.abc import Mapping
from typing import Any, Final, TypeAlias

YamlMapping: TypeAlias = Mapping[Any, object]
"""Content of a YAML file by name, or by number in files of other tools; values are unchecked."""
_LARGEST: Final = 4 << 20
"""Largest text [letters]; the metadata.yaml of a bag of 10,000 files has 2 million."""
_REMEMBERED: Final = 1 << 16
"""Largest text that is parsed once, however often it is read [letters]."""

_SCALARS: Final = (str, float, int, bool, type(None))

_OPENCV: Final = re.compile(r"\s*%YAML:1")
"""Start of a file of OpenCV, whose first line is no directive of YAML."""


def parse_yaml(text: str) -> object:
    """Return the content of a YAML text, read safely and with numbers as ROS reads them.

    YAML 1.1 takes ``5e-4`` for a string because it has no point, and ``-.2`` because no digit is
    before its point; ROS, kalibr and people do not. launch_ros writes each list of a launch file
    as a Python tuple: that tag, and no other of Python's, is read as the list that it is. The first
    line of OpenCV's files, ``%YAML:1.0``, is passed over, and its matrices are names and values.

    :raises ValueError: for text that is not YAML or is refused, with the reason in one line.
    """
    if len(text) > _LARGEST:
        raise ValueError(f"more than {_LARGEST >> 20} MiB of YAML")
    if _OPENCV.match(text):
        text = text.replace("%", "#", 1)
    from imu_sim_ros.parameters.yaml_loader import content  # PyYAML, 30 ms

    return _copy(content(text)) if len(text) < _REMEMBERED else content.__wrapped__(text)


def _copy(tree: Any) -> object:
    """Return a copy of a tree, whose mappings and lists can be changed."""
    kind = type(tree)
    if kind is dict:
        return {name: _copy(branch) for name, branch in tree.items()}
    if kind is list:
        return [_copy(branch) for branch in tree]
    return tree if kind in _SCALARS else copy.deepcopy(tree)
