# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help, version and tab completion of the nodes. Needs no ROS."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from imu_sim_ros import __version__, completion, program
from imu_sim_ros.parameters.kinds import Parameter
from imu_sim_ros.parameters.sections import parameters


class NodeHelp(NamedTuple):
    """The help of a node."""

    text: str
    section: Callable[[], type]
    """Returns its parameters, which a node that runs does not import of the others."""
    examples: tuple[str, ...]


def _simulator() -> type:
    from imu_sim_ros.simulation.playback import SimulatorParameters

    return SimulatorParameters


def _integrator() -> type:
    from imu_sim_ros.navigation.parameters import IntegratorParameters

    return IntegratorParameters


def _error_model() -> type:
    from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters

    return ErrorNodeParameters


def _recorder() -> type:
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
        if text.startswith("examples:"):
            return text
        paragraphs = text.strip().split("\n\n")
        return "\n\n".join(
            super(NodeFormatter, self)._fill_text(p, width, indent) for p in paragraphs
        )


def answer(name: str, arguments: list[str]) -> int | None:
    """Answer requests that need no running node: help, version, tab completion.

    :returns: the exit status; None: the node is to run.
    """
    if completion.is_requested():
        completion.complete(parser(name))
    own = arguments[: arguments.index("--ros-args")] if "--ros-args" in arguments else arguments
    if "--help" in own or "-h" in own:
        return program.run(name, lambda: print(parser(name).format_help(), end=""))
    if "--version" in own:
        return program.run(name, lambda: print(f"imu_sim_ros {__version__}"))
    return None


def parser(name: str) -> argparse.ArgumentParser:
    """Return a parser with a node's parameters, for its help and for tab completion."""
    program = PROGRAMS[name]
    examples = "".join(f"\n  {line}" for line in program.examples)
    result = argparse.ArgumentParser(
        prog=name,
        usage=f"{name} [--PARAMETER VALUE ...] [--ros-args ...]",
        description=program.text,
        epilog=f"examples:{examples}",
        formatter_class=NodeFormatter,
        allow_abbrev=False,
    )
    result.add_argument("--debug", action="store_true", help="show the traceback of an error")
    result.add_argument("--version", action="store_true", help="print the package's version")
    group = result.add_argument_group("parameters (* may change while the node runs)")
    known = dict(parameters(program.section()))
    if name == "simulator":
        from imu_sim_ros.sensors import all_sensors

        for sensor in all_sensors()[0]:
            own = parameters(sensor.section)
            known |= {f"{sensor.name}.{key}": parameter for key, parameter in own.items()}
    for key, parameter in known.items():
        mark = " *" if parameter.live else ""
        words = f"{parameter.text}{mark} ({parameter.allowed()}; default {_plainly(parameter)})"
        group.add_argument(f"--{key}", metavar="VALUE", help=words.replace("%", "%%"))
    return result


def of_other_nodes(section: type, names: Iterable[str]) -> list[str]:
    """Return the names among some that are parameters of other nodes only."""
    own = parameters(section)
    rest = [name for name in names if name not in own]
    if not rest:
        return []
    others = {name for program in PROGRAMS.values() for name in parameters(program.section())}
    passed_over: Mapping[str, Parameter] = getattr(section, "passed_over", dict)()
    return [name for name in rest if name in others and name not in passed_over]


def _plainly(parameter: Parameter) -> str:
    default = parameter.default
    if isinstance(default, tuple):
        return "[" + ", ".join(str(entry) for entry in default) + "]"
    return repr(default) if isinstance(default, str) else str(default).lower()
