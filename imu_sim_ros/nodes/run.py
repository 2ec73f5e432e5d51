# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common parts of the nodes' programs: arguments, start, spinning, signals, exit status."""

import itertools
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros.core.errors import ConfigurationError, explain
from imu_sim_ros.core.spelling import use_spelling
from imu_sim_ros.nodes import fast_dds, help, signals
from imu_sim_ros.nodes.arguments import ros_arguments

if TYPE_CHECKING:
    from imu_sim_ros.nodes.parameters import ConfiguredNode

_SWITCH_INTERVAL: Final = 0.001
"""Time after which a thread passes the interpreter on [s]; with Python's 5 ms, readings wait longer
for the callbacks of diagnostics, parameters and discovery."""
_SHUTDOWN: Final = 0.1
"""Longest wait of the shutdown for callbacks that are waiting themselves [s]."""


def main(
    name: str,
    create: "Callable[[], ConfiguredNode[Any]]",
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a node until its ending is reached or a signal ends it.

    :param name: the executable's name.
    :param create: makes the node; rclpy is initialised by then.
    :param arguments: the command line without the program's name.
    :returns: exit status: the node's own; 0 after SIGINT, SIGTERM or SIGHUP; 2 after printing one
        line for each problem with the parameters; 1 after any other error.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    status = help.answer_requests(name, list(arguments))
    if status is not None:
        return status
    arguments, debug = parse_debug_option(arguments)
    sys.setswitchinterval(_SWITCH_INTERVAL)
    watch = signals.watch()
    try:
        watch.begin()
        with use_spelling("node"), tempfile.TemporaryDirectory() as folder:
            fast_dds.set_profile(Path(folder))
            for path in fast_dds.remove_torn_segments():
                print(
                    f"{name}: {path}: a killed program of another user left it half initialised; "
                    "nodes of its ROS domain may hang until it is removed",
                    file=sys.stderr,
                )
            section = help.PROGRAMS[name].section()
            _start(ros_arguments(arguments, section, Path(folder)))
            node = create()
        with use_spelling("node"):
            _spin(node, watch)
        error = node.lifetime.failure
        if error is not None:
            report(name, error, debug)
        return node.lifetime.status or 0
    except Exception as error:
        report(name, error, debug)
        return explain(error)[1]
    finally:
        _shut_down()
        watch.close()


def parse_debug_option(arguments: Sequence[str]) -> tuple[list[str], bool]:
    """Return the arguments without ``--debug``, and whether errors are to show a traceback.

    ROS's own ``--log-level debug`` (or ``NODE:=debug``) requests it as well, and stays.
    """
    remaining_arguments = [argument for argument in arguments if argument != "--debug"]
    levels = [
        value for flag, value in itertools.pairwise(remaining_arguments) if flag == "--log-level"
    ]
    is_ros_debug = any(level.lower().rpartition(":=")[2] == "debug" for level in levels)
    return remaining_arguments, is_ros_debug or len(remaining_arguments) < len(arguments)


def report(name: str, error: BaseException, debug: bool) -> None:
    """Print an error, one line for each problem; on request with its traceback first."""
    if debug:
        traceback.print_exception(error)
    for line in explain(error)[0]:
        print(f"{name}: {line}", file=sys.stderr, flush=True)


def _start(arguments: Sequence[str]) -> None:
    """Initialise ROS without its signal handlers."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    try:
        rclpy.init(args=["", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl's own classes have no other parent
        raise ConfigurationError(f"--ros-args: {' '.join(str(error).split())}") from None


def _spin(node: "ConfiguredNode[Any]", watch: signals.EndSignals) -> None:
    """Run the node to its end, and close it at any end."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    watch.deliver_to(node.lifetime.finish)
    try:
        while not node.lifetime.reached:
            executor.spin_once()
    finally:
        node.close()
        node.destroy_node()
        executor.shutdown(timeout_sec=_SHUTDOWN)


def _shut_down() -> None:
    """Shut rclpy down, if it is running."""
    import rclpy

    rclpy.try_shutdown()
