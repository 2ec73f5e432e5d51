# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameter reference as Markdown, from the one description of every parameter.

``python -m imu_sim_ros.commands.parameter_reference > docs/reference/parameters.md``
"""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.commands import program
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Parameter, Value
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import sensors_of_imus, switchable_sensors
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.scene_parameters import TYPES as SCENES
from imu_sim_ros.sensors.camera.scene_parameters import SceneParameters
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.trajectory.parameters import TYPES, TrajectoryParameters

_PARTS = (*TRIADS, *(sensor.name for sensor in sensors_of_imus()))
"""First words of the parameters of an IMU's sensors, below ``imu.``."""
_INTRODUCTION = """\
# Parameters

This page lists every parameter with its unit, default and range. `make reference` writes it.

The same names serve everywhere: in ROS 2 parameter files (`--params-file` of nodes and commands),
as `-p NAME:=VALUE` after `--ros-args`, as `--NAME VALUE` of a node and as `--set NAME=VALUE` of a
command. A vector is a list of three, or one number for all three axes; gravity given as a number is
its magnitude, downwards; a matrix is a list of nine numbers, row by row. A relative path in a file
is that of a file next to it; if there is none, it is relative to the working directory. Parameters
marked with * take a new value while the node runs; all others are fixed when it starts. An unknown
name or a value out of range is an error, and all errors are reported together.
"""
_NODES = {
    "Simulation": """\
Node `simulator`, command `generate`. `imu.preset` names a file in `config/imus` ({imus}) or any
parameter file; `trajectory.type` a file in `config/trajectories` ({trajectories}) or one of the
kinds below.
""",
    "Cameras": """\
Cameras of `simulator` and `generate`. `cameras` names them (`--camera` does so as well); `camera.*`
holds for all, `NAME.camera.*` for one. `camera.preset` names a file in `config/cameras`
({cameras}) or any parameter file, and `scene.type` a file in `config/scenes` ({scenes}) or one of
the kinds below.
""",
    "Integrator": """\
Node `integrator`. What a parameter file says below `imu.` for the simulator, and the integrator has
no use for, is ignored, so that both can be given the same file.
""",
    "Error model": """\
Node and Python's `ErrorModel`, command `add_errors`. `imu.*`, `inject.*`, `temperature.*` and the
general parameters are those of the simulation; what concerns a trajectory is passed over, so that
both can be given the same file. A sensor of the IMU of which a topic is published subscribes to its
ideal values, on the topic of its readings and `/ideal` (`imu/mag/ideal`, `imu/pressure/ideal`); for
an orientation, the readings must come with one.
""",
    "Recorder": """\
Node `recorder`. Arguments without `--` are topics, `-o` stands for `--output`, and durations may
have a unit (`20s`, `10min`, `4h`).
""",
}


def reference() -> str:
    """Return the whole reference."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    """Yield the Markdown of the page, section by section."""
    yield _INTRODUCTION
    yield from _node("Simulation")
    simulator = parameters(SimulatorParameters)
    settings = {name: p for name, p in simulator.items() if not name.startswith("trajectory.")}
    for heading, rows in _groups(settings).items():
        yield f"### {heading}\n"
        yield from _table(rows)
    yield from _kinds("trajectory", TrajectoryParameters, TYPES)
    yield from _node("Cameras")
    rig = parameters(RigParameters)
    rig_rows = {name: rig[name] for name in ("cameras", "features.layout")}
    yield from _table({**rig_rows, **_below("camera", CameraParameters)})
    yield from _kinds("scene", SceneParameters, SCENES)
    for name, sensor in switchable_sensors().items():
        yield f"## Sensor {name}\n"
        yield f"Used if `sensors` contains `{sensor.name}`: {sensor.text}.\n"
        yield from _table(_below(name, sensor.section))
    yield from _node("Integrator", parameters(IntegratorParameters))
    names = ("input.", "odometry", "publish.")
    error_model = parameters(ErrorNodeParameters).items()
    yield from _node("Error model", {name: p for name, p in error_model if name.startswith(names)})
    yield from _node("Recorder", parameters(RecorderParameters))


def _node(heading: str, rows: Mapping[str, Parameter] | None = None) -> Iterator[str]:
    """Yield the beginning of a part, and its table if it has only one."""
    folders = ("imus", "trajectories", "cameras", "scenes")
    yield f"## {heading}\n"
    yield _NODES[heading].format(**{name: ", ".join(files.names(name)) for name in folders})
    if rows is not None:
        yield from _table(rows)


def _below(prefix: str, section: type) -> dict[str, Parameter]:
    """Return the parameters of a section by their names below a prefix."""
    return {f"{prefix}.{name}": parameter for name, parameter in parameters(section).items()}


def _kinds(name: str, shared: type, kinds: Mapping[str, type]) -> Iterator[str]:
    """Yield tables in Markdown: the parameters that all kinds share, then those of each kind.

    :param name: name of the section that has kinds, for instance ``trajectory``.
    :param shared: section of the parameters that all kinds share.
    :param kinds: section of each kind by its name, the value of ``NAME.type``.
    """
    shared_rows = _below(name, shared)
    yield f"### Every {name}\n"
    yield from _table(shared_rows)
    for kind, section in kinds.items():
        yield f"### {name}.type: {kind}\n"
        yield f"{(section.__doc__ or '').strip().split(chr(10))[0]}\n"
        kind_rows = _below(name, section)
        yield from _table({key: kind_rows[key] for key in kind_rows if key not in shared_rows})


def _groups(rows: Mapping[str, Parameter]) -> dict[str, dict[str, Parameter]]:
    """Return parameters by heading, in the order of the first of each."""
    groups: dict[str, dict[str, Parameter]] = {}
    for name, parameter in rows.items():
        section, dot, rest = name.partition(".")
        prefix = rest.partition("_")[0]
        if not dot:
            heading = "General"
        elif section != "imu":
            heading = section.replace("_", " ").capitalize()
        else:
            heading = f"IMU: {prefix if prefix in _PARTS else 'mounting, sampling and timing'}"
        groups.setdefault(heading, {})[name] = parameter
    return groups


def _table(rows: Mapping[str, Parameter]) -> Iterator[str]:
    """Yield a table of parameters in Markdown."""
    if not rows:
        yield "It has no parameters of its own.\n"
        return
    yield "| parameter | default | unit | allowed | meaning |"
    yield "|---|---|---|---|---|"
    for name, parameter in rows.items():
        yield _row(name, parameter)
    yield ""


def _row(name: str, parameter: Parameter) -> str:
    """Return the row of a parameter in the table."""
    allowed = parameter.allowed_text().removesuffix(f" [{parameter.unit}]")
    cells: Iterable[str] = (
        f"`{name}`" + (" \\*" if parameter.live else ""),
        f"`{_plain(parameter.default)}`",
        parameter.unit,
        allowed,
        parameter.text,
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _plain(value: Value) -> str:
    """Return a default in the notation of YAML; three equal numbers as one."""
    if isinstance(value, tuple):
        same_number = len(value) == 3 and len(set(value)) == 1
        return _plain(value[0]) if same_number else f"[{', '.join(map(_plain, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value or "''"
    return f"{value:g}" if isinstance(value, float) else str(value)


def main(arguments: list[str] | None = None) -> int:
    """Print the reference."""
    parser = program.Parser("parameter_reference", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.parse_args(arguments)
    return program.run("parameter_reference", lambda: print(reference(), end=""))


if __name__ == "__main__":
    sys.exit(main())
