# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help, version and tab completion of the nodes. Needs no ROS."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from imu_sim_ros import __version__
from imu_sim_ros.commands import completion, program
from imu_sim_ros.parameters.kinds import Parameter
from imu_sim_ros.parameters.sections import ignored_parameters, parameters
from imu_sim_ros.sensors import all_sensors


class NodeHelp(NamedTuple):
    """The help of a node."""

    text: str
    section: Callable[[], type]
    """Function that returns the class of its parameters; a running node imports its own only."""
    examples: tuple[str, ...]
    main: tuple[str, ...] = ()
    """Parameters in the short help, those that users set first; empty: all."""


def _simulator() -> type:
    """Return the class of the simulator's parameters."""
    from imu_sim_ros.simulation.playback import SimulatorParameters

    return SimulatorParameters


def _integrator() -> type:
    """Return the class of the integrator's parameters."""
    from imu_sim_ros.navigation.parameters import IntegratorParameters

    return IntegratorParameters


def _error_model() -> type:
    """Return the class of the error model's parameters."""
    from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters

    return ErrorNodeParameters


def _recorder() -> type:
    """Return the class of the recorder's parameters."""
    from imu_sim_ros.bags.recorder_parameters import RecorderParameters

    return RecorderParameters


PROGRAMS: Final = {
    "simulator": NodeHelp(
        "Publish the readings of simulated sensors together with the ground truth.",
        _simulator,
        (
            "simulator --imu mpu6000 --trajectory figure_eight --rate 400",
            "simulator --trajectory flight.csv --ros-args -r imu/data_raw:=/imu0",
            "simulator --ros-args --params-file run.yaml -p seed:=7",
        ),
        (
            *("imu", "trajectory", "rate", "seed", "duration", "real_time_factor"),
            *("sensors", "imus", "cameras", "imu_frame", "gravity"),
            *("imu.gyroscope_noise_density", "imu.gyroscope_bias", "imu.lever_arm"),
            *("publish.biases", "publish.orientation", "publish.tf_rate"),
        ),
    ),
    "integrator": NodeHelp(
        """Integrate imu/data_raw and publish dead_reckoned/odom for every reading.

On request, the node also publishes dead_reckoned/path, dead_reckoned/roll_pitch_yaw (degrees) and
the errors against ground_truth/odom, dead_reckoned/position_error and
dead_reckoned/attitude_error. The noise for the covariance comes from imu.* or, if none is given,
from imu/data_raw/parameters, which the simulator publishes. The service ~/reset starts again at
initial_state.""",
        _integrator,
        (
            "integrator --initial_state truth --error true",
            "integrator --method rk4 --path_rate 5 --ros-args -r imu/data_raw:=/imu0",
        ),
        (
            *("method", "attitude_update", "initial_state", "initial_position"),
            *("calibration", "imu", "gravity", "covariance", "error", "path_rate"),
        ),
    ),
    "error_model": NodeHelp(
        """Add a sensor's errors to the ideal readings of another simulator.

The node subscribes to imu/ideal (sensor_msgs/Imu), or with --odometry true to odom/ideal
(nav_msgs/Odometry), and publishes imu/data_raw; on request also imu/data, imu/temperature and the
ground truth of readings and biases. Declare the input with --input.gravity, --input.axes and so on.
The service ~/reset starts again with the next reading.""",
        _error_model,
        (
            "error_model --imu bmi088 --rate 1000 --seed 3 --ros-args -r imu/ideal:=/imu",
            "error_model --imu adis16448 --rate 250 --publish.biases true",
            "error_model --imu mpu6000 --input.axes frd --input.gravity missing",
        ),
        (
            *("imu", "rate", "seed", "odometry", "input.rate", "input.gravity", "input.axes"),
            *("input.place", "imu.lever_arm", "imu.gyroscope_bias", "imu_frame"),
            *("publish.ground_truth_imu", "publish.biases", "publish.orientation"),
        ),
    ),
    "recorder": NodeHelp(
        """Record topics into a bag: rosbag2 with MCAP or SQLite storage, or ROS 1.

Arguments without -- are topics; without any, all topics are recorded. -o is --output (default: a
folder named after the time; NAME.bag is ROS 1), -d is --duration and accepts units such as 20s and
10min.

If the recorder is killed, at most the last second is lost; convert_bag --recover makes a complete
bag. The exit status is 0 after Ctrl-C, SIGTERM, duration or max_size, and 1 if writing failed.""",
        _recorder,
        (
            "recorder",
            "recorder -o flight imu/data_raw /ground_truth/odom",
            "recorder -o flight.bag --duration 20s",
        ),
    ),
}


class NodeFormatter(argparse.HelpFormatter):
    """Wraps paragraphs one by one, and leaves the examples unchanged."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        """Fill each paragraph, and keep the line breaks of the examples."""
        return "\n\n".join(
            paragraph
            if paragraph.startswith("examples:")
            else super(NodeFormatter, self)._fill_text(paragraph, width, indent)
            for paragraph in text.strip().split("\n\n")
        )


def answer_requests(name: str, arguments: list[str]) -> int | None:
    """Answer requests that need no running node: help, version, tab completion.

    :returns: the exit status; None: the node is to run.
    """
    if completion.is_requested():
        completion.complete(parser(name))
    options = arguments[: arguments.index("--ros-args")] if "--ros-args" in arguments else arguments
    if "--help-all" in options:
        return program.run(name, lambda: print(parser(name).format_help(), end=""))
    if "--help" in options or "-h" in options:
        return program.run(name, lambda: print(main_parameter_parser(name).format_help(), end=""))
    if "--version" in options:
        return program.run(name, lambda: print(f"imu_sim_ros {__version__}"))
    return None


def parser(name: str) -> argparse.ArgumentParser:
    """Return a parser with all parameters of a node, for its whole help and for tab completion."""
    node = PROGRAMS[name]
    parser = _parser(name, node)
    group = parser.add_argument_group("parameters (* may change while the node runs)")
    for key, parameter in _parameters(name).items():
        mark = " *" if parameter.live else ""
        text = f"{parameter.text}{mark} ({parameter.allowed_text()}; default {_plainly(parameter)})"
        group.add_argument(f"--{key}", metavar="VALUE", help=text.replace("%", "%%"))
    return parser


def main_parameter_parser(name: str) -> argparse.ArgumentParser:
    """Return a parser with the main parameters of a node, for its short help."""
    node = PROGRAMS[name]
    if not node.main:
        return parser(name)
    declarations = _parameters(name)
    short = _parser(name, node)
    group = short.add_argument_group(
        "main parameters",
        f"--help-all describes all {len(declarations)} with their ranges and defaults.",
    )
    for key in node.main:
        parameter = declarations[SECTION_FILES.get(key, key)]
        text = _BRIEF.get(key) or parameter.text.partition(";")[0]
        if parameter.unit and "[" not in text:
            text += f" [{parameter.unit}]"
        group.add_argument(f"--{key}", metavar="VALUE", help=text.replace("%", "%%"))
    return short


SECTION_FILES: Final = {"imu": "imu.preset", "trajectory": "trajectory.type", "nmea": "gnss.nmea"}
"""Parameters that name a file for a whole section, by the short option that stands for them."""
_BRIEF: Final = {
    "imu": "IMU: a name such as mpu6000, or a file",
    "trajectory": "motion: a name such as figure_eight, or a file of parameters or poses",
    "sensors": "further sensors, such as [gnss, wheels, cam0]",
    "imus": "names of several IMUs on the body",
    "imu.gyroscope_noise_density": "white noise, as all imu.* of the sensor",
    "publish.biases": "publish the true biases below ground_truth/",
    "publish.orientation": "publish imu/data, with an orientation",
    "publish.tf_rate": "rate of the body's transform on /tf [Hz]",
    "cameras": "names of cameras, such as [cam0, cam1]",
}
"""Texts of the short help where the parameter's own says more than a beginner needs."""


def _parser(name: str, node: NodeHelp) -> argparse.ArgumentParser:
    """Return a parser with description, examples and options, without parameters."""
    examples = "".join(f"\n  {line}" for line in node.examples)
    parser = argparse.ArgumentParser(
        prog=name,
        usage=f"{name} [--PARAMETER VALUE ...] [--ros-args ...]",
        description=f"{node.text}\n\nexamples:{examples}",
        formatter_class=NodeFormatter,
        allow_abbrev=False,
    )
    if node.main:
        parser.add_argument("--help-all", action="store_true", help="describe all parameters")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser.add_argument("--version", action="store_true", help="print the package's version")
    return parser


def _parameters(name: str) -> dict[str, Parameter]:
    """Return the parameters of a node, with those of all sensors for the simulator."""
    declarations = dict(parameters(PROGRAMS[name].section()))
    if name == "simulator":
        for sensor in all_sensors()[0]:
            sensor_parameters = parameters(sensor.section)
            declarations |= {
                f"{sensor.name}.{key}": parameter for key, parameter in sensor_parameters.items()
            }
    return declarations


def parameters_of_other_nodes(section: type, names: Iterable[str]) -> list[str]:
    """Return the names among some that are parameters of other nodes only."""
    declarations = parameters(section)
    rest = [name for name in names if name not in declarations]
    if not rest:
        return []
    all_names = {name for program in PROGRAMS.values() for name in parameters(program.section())}
    ignored: Mapping[str, Parameter] = ignored_parameters(section)
    return [name for name in rest if name in all_names and name not in ignored]


def _plainly(parameter: Parameter) -> str:
    """Return a default as a parameter file has it."""
    default = parameter.default
    if isinstance(default, tuple):
        return "[" + ", ".join(str(entry) for entry in default) + "]"
    return repr(default) if isinstance(default, str) else str(default).lower()
