# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of the launch files: arguments that are the nodes' parameters, and required nodes.

An argument is passed to its node as written (``--rate abc``), so that the node itself checks and
reports it; an empty one is not passed, and the node's files and defaults apply.
``launch`` and ``launch_ros`` come with a ROS 2 installation, not from PyPI: they are imported where
they are used.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.nodes.help import SECTION_FILES
from imu_sim_ros.nodes.messages import installation
from imu_sim_ros.parameters.kinds import Parameter
from imu_sim_ros.parameters.sections import parameters

PACKAGE: Final = "imu_sim_ros"
_FLAGS: Final = {"true": True, "1": True, "false": False, "0": False}


class Argument(NamedTuple):
    """An argument of a launch file."""

    name: str
    text: str
    default: str = ""


NAMESPACE: Final = Argument("namespace", "namespace of the nodes and their topics")
OF_EVERY_NODE: Final = (
    Argument(
        "params_file",
        "parameter files, separated by spaces; later ones override, launch arguments override all",
    ),
    Argument("use_sim_time", "true: time comes from an external /clock"),
)


def arguments(section: type, names: Sequence[str]) -> list[Argument]:
    """Return launch arguments for parameters, with the parameters' own texts.

    :param names: parameters' names, or the short ``imu`` and ``trajectory``.
    """
    declarations = parameters(section)
    return [Argument(name, _text(declarations[SECTION_FILES.get(name, name)])) for name in names]


def _text(parameter: Parameter) -> str:
    """Return the description of a launch argument with its allowed values."""
    allowed = parameter.allowed_text()
    if parameter.kind == "texts":
        allowed = "names, separated by spaces"
    return f"{parameter.text}: {allowed}"


def command_line(section: type, values: Mapping[str, str]) -> list[str]:
    """Return a node's plain command-line arguments.

    :param values: values by launch argument; empty ones are left to the node.
    """
    declarations = parameters(section)
    options: list[str] = []
    for name, value in values.items():
        parameter = declarations.get(SECTION_FILES.get(name, name))
        if parameter is None or not value.strip():
            continue
        if parameter.kind == "texts":
            value = f"[{', '.join(names(value))}]"
        options += [f"--{name}", value]
    return options


def ros_words(values: Mapping[str, str]) -> list[str]:
    """Return the arguments that follow ``--ros-args``: files and the clock."""
    options: list[str] = []
    for file in values.get("params_file", "").split():
        options += ["--params-file", file]
    if values.get("use_sim_time", "").strip():
        options += ["-p", f"use_sim_time:={str(flag(values, 'use_sim_time')).lower()}"]
    return options


def names(value: str) -> list[str]:
    """Return the names in ``left right``, ``left, right`` or ``[left, right]``."""
    return value.strip().removeprefix("[").removesuffix("]").replace(",", " ").split()


def flag(values: Mapping[str, str], name: str) -> bool:
    """Return whether a launch argument is true.

    :raises ConfigurationError: if it is neither true nor false.
    """
    try:
        return _FLAGS[values[name].strip().lower()]
    except KeyError:
        raise ConfigurationError(f"{name} = {values[name]!r}: must be true or false") from None


def description(
    declared: Sequence[Argument], make: Callable[[Mapping[str, str]], Sequence[object]]
) -> Any:
    """Return the launch description with these arguments.

    :param make: returns the actions for the arguments' values.
    """
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch.launch_description import LaunchDescription
    from launch.substitutions import LaunchConfiguration

    def actions(context: Any) -> Sequence[object]:
        return make({a.name: LaunchConfiguration(a.name).perform(context) for a in declared})

    entries = [
        DeclareLaunchArgument(a.name, default_value=a.default, description=a.text) for a in declared
    ]
    return LaunchDescription([*entries, OpaqueFunction(function=actions)])


def required_node(
    executable: str,
    section: type,
    values: Mapping[str, str],
    namespace: str = "",
    base_arguments: Sequence[str] = (),
    **details: Any,
) -> Any:
    """Return a node of this package whose end also ends the launch.

    :param values: values of the launch arguments, by name.
    :param base_arguments: the launch file's own ``--ros-args``, which ``params_file`` overrides.
    :param details: other arguments of ``launch_ros.actions.Node``.
    """
    from launch_ros.actions import Node

    return Node(
        package=PACKAGE,
        executable=executable,
        name=executable,
        namespace=namespace,
        arguments=command_line(section, values),
        ros_arguments=[*base_arguments, *ros_words(values)],
        output="screen",
        on_exit=_end_launch,
        **details,
    )


def _end_launch(event: Any, _: Any) -> Any:
    """End the launch: launch's own status is 1 after an error, and 0 otherwise."""
    from launch.actions import Shutdown

    if event.returncode:
        raise RuntimeError(f"{event.process_name} ended with status {event.returncode}")
    return Shutdown(reason=f"{event.process_name} has ended")


def rviz(config: Path, namespace: str, fixed_frame: str) -> Any:
    """Return RViz, or a note that it is not installed; the launch continues."""
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix
    from launch.actions import LogInfo
    from launch_ros.actions import Node

    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        return LogInfo(
            msg=f"rviz:=true: rviz2 is not installed ({installation('rviz2')}); "
            "all else runs without it"
        )
    options = ["-d", str(config), *(("-f", fixed_frame) if fixed_frame else ())]
    return Node(package="rviz2", executable="rviz2", namespace=namespace, arguments=options)
