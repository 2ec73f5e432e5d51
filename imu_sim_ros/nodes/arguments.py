# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line of a node: checked, and rewritten in the form that ROS accepts.

rcl ends a process on a list such as ``[1.0, 0, 0]``, with three lines of its own. The files and
values that the commands accept are therefore read here first: all errors are reported together,
and numbers are written in the one form that rcl understands.
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems
from imu_sim_ros.core.names import short_repr
from imu_sim_ros.inputs.rows import read_text
from imu_sim_ros.nodes.help import SECTION_FILES, parameters_of_other_nodes
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import EMPTY_LIST
from imu_sim_ros.parameters.sections import (
    OF_EVERY_NODE,
    bad_value_lines,
    parameters,
    unknown_parameter_line,
)
from imu_sim_ros.parameters.yaml_text import parse_yaml
from imu_sim_ros.sensors import switchable_sensors
from imu_sim_ros.sensors.imu import presets

_RULE = re.compile(r"(?P<name>(?:[^\s:]+:)?[^\s:=]+):=(?P<value>.*)", re.DOTALL)
_PARAMETERS = "ros__parameters"
_OF_ROS = ("-p", "--param", "--params-file", "-r", "--remap")


def ros_arguments(arguments: Sequence[str], section: type, folder: Path) -> list[str]:
    """Return the arguments for ``rclpy.init``.

    :param arguments: without the program's name: ``--ros-args`` as ROS defines them, and every
        parameter of the section as ``--name value`` (dashes may stand for underscores).
    :param section: the node's section of parameters.
    :param folder: folder for rewritten parameter files.
    :raises ConfigurationError: with a line for each problem.
    """
    problems = Problems()
    problems += [f"{argument!r}: not UTF-8" for argument in arguments if not _is_text(argument)]
    problems.tell()
    program_arguments, ros = _split(arguments)
    overrides = _ros_parameters(program_arguments, section, problems)
    checked_arguments = ["--ros-args"]
    position = 0
    while position < len(ros):
        flag = ros[position]
        if flag in ("--params-file", "-p", "--param"):
            value = ros[position + 1] if position + 1 < len(ros) else ""
            is_file = flag == "--params-file"
            with problems.collect():
                checked = _readable_parameter_file(value, folder) if is_file else _check_rule(value)
                checked_arguments += [flag, checked]
            position += 2
        else:
            checked_arguments.append(flag)
            position += 1
    problems.tell()
    return [*checked_arguments, *overrides]  # rcl takes the last value: these override every file


def _is_text(argument: str) -> bool:
    """Return True for an argument in the terminal's encoding."""
    try:
        return bool(argument.encode()) or not argument
    except UnicodeEncodeError:  # bytes from a terminal with another encoding
        return False


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Separate the program's own arguments from those between ``--ros-args`` and ``--``."""
    program_arguments: list[str] = []
    ros: list[str] = []
    current = program_arguments
    for argument in arguments:
        if argument == "--ros-args":
            current = ros
        elif argument == "--" and current is ros:
            current = program_arguments
        else:
            current.append(argument)
    return program_arguments, ros


def _ros_parameters(
    program_arguments: Sequence[str], section: type, problems: Problems
) -> list[str]:
    """Return ROS's ``-p rate:=400`` for each ``--rate 400`` or ``--rate=400``.

    :param problems: receives a line for each argument that is none.
    """
    declarations = parameters(section)
    overrides: list[str] = []
    rest = iter(program_arguments)
    for word in rest:
        if word in _OF_ROS:
            problems.append(f"{word} {next(rest, '')}: must come after --ros-args")
            continue
        name, equals, value = word.removeprefix("--").partition("=")
        name = name.replace("-", "_")
        if not word.startswith("--") or not name:
            problems.append(f"{word}: not an argument (--help-all lists them)")
            continue
        short = SECTION_FILES.get(name)
        if short and (short in declarations or short.partition(".")[0] in switchable_sensors()):
            name = short
        if parameters_of_other_nodes(section, [name]):
            problems.append(unknown_parameter_line(name, declarations))
        if not equals:
            value = next(rest, "")
        if not value:
            problems.append(f"{word}: a value is missing")
            continue
        kind = declarations[name].kind if name in declarations else ""
        quoted = kind in ("text", "choice")
        with problems.collect():
            rule = f'{name}:="{value}"' if quoted else _check_rule(f"{name}:={value}")
            overrides += ["-p", rule]
    return overrides


def _check_rule(rule: str) -> str:
    """Return the parameter rule ``name:=value`` of ``-p``, lists of numbers as floats.

    :raises ConfigurationError: for a rule of another form, and lists of mixed types.
    """
    match = _RULE.fullmatch(rule)
    if match is None or not match["value"].strip():
        raise ConfigurationError(f"-p {rule}: must be name:=value")
    is_list = match["value"].lstrip().startswith(("[", "{"))
    if not is_list and match["name"].rpartition(":")[2] not in OF_EVERY_NODE:
        return rule
    try:
        value = parse_yaml(match["value"])
    except ValueError as error:
        raise ConfigurationError(f"{match['name']}: {error}") from None
    problems: list[str] = []
    uniform = _uniform(match["name"], value, problems)
    if problems:
        raise ConfigurationError(problems)
    if not is_list:
        return rule
    quoted = f'"{uniform}"' if uniform == EMPTY_LIST else uniform
    return f"{match['name']}:={quoted}"


def _readable_parameter_file(name: str, folder: Path) -> str:
    """Return the parameter file, or the path of a copy in a form that rcl can read.

    :param folder: folder for the copy.
    :raises ConfigurationError: for a file that is missing or no parameter file.
    """
    if not name:
        raise ConfigurationError("--params-file: a file is missing")
    path = Path(name)
    try:
        tree = parse_yaml(read_text(path))
    except InputError as error:
        raise ConfigurationError(error.problems) from None
    except ValueError as error:
        raise ConfigurationError(f"{path}: not a YAML file: {error}") from None
    try:
        sections = _has_sections(tree)
    except ConfigurationError as error:
        raise ConfigurationError([f"{path}: {problem}" for problem in error.problems]) from None
    if not sections:
        # A file of another tool, or a flat one; for anything else load() reports what is missing.
        uniform: object = {"/**": {_PARAMETERS: presets.load(path)}}
    else:
        problems: list[str] = []
        uniform = _uniform("", tree, problems)
        if problems:
            raise ConfigurationError([f"{path}: {problem}" for problem in problems])
        uniform = _resolve_paths("", uniform, path)
        # Values and types: 1 == 1.0, but only the latter belongs in a list of floats.
        if repr(uniform) == repr(tree):
            return name
    import yaml

    with tempfile.NamedTemporaryFile(
        "w", suffix=".yaml", dir=folder, delete=False, encoding="utf-8"
    ) as copy:
        yaml.safe_dump(uniform, copy)
    return copy.name


def _has_sections(tree: object) -> bool:
    """Return whether a tree has sections of parameters.

    :raises ConfigurationError: for a section that is anything but names and values.
    """
    if not isinstance(tree, dict):
        return False
    section = tree.get(_PARAMETERS, {})
    if not isinstance(section, dict):
        raise ConfigurationError(f"{_PARAMETERS}: must hold names and values")
    if any(key == _PARAMETERS for key in tree):
        return True
    return any(_has_sections(content) for content in tree.values())


def _uniform(name: str, value: object, problems: list[str]) -> object:
    """Return a tree whose lists hold one type each: integers among others become floats.

    rcl cannot infer a type for an empty list, so it is passed as a string.
    """
    if isinstance(value, dict):
        return {
            key: _uniform(f"{name}.{key}" if name else str(key), entry, problems)
            for key, entry in value.items()
        }
    short = name.rpartition(f"{_PARAMETERS}.")[2].rpartition(":")[2]
    problems += bad_value_lines(OF_EVERY_NODE, {short: value}).values()
    if value is None:
        problems.append(f"{short}: a value is missing")
    if value == []:
        return EMPTY_LIST
    if not isinstance(value, list):
        return value
    kinds = {type(entry) for entry in value}
    if kinds == {int, float}:
        return [float(entry) for entry in value]
    if not (len(kinds) <= 1 and kinds <= {int, float, bool, str}):
        problems.append(f"{short} = {short_repr(value)}: must be a list of values of one type")
    return value


def _resolve_paths(name: str, value: object, path: Path) -> object:
    """Return a tree in which paths relative to its file are those from the working directory."""
    if isinstance(value, dict):
        return {key: _resolve_paths(str(key), entry, path) for key, entry in value.items()}
    return files.resolve_path(name, value, path)
