# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the nodes' programs share: arguments, start, spinning, signals and the exit status."""

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol

from imu_sim_ros.errors import ConfigurationError, ImuSimError
from imu_sim_ros.nodes.arguments import help_text, ros_arguments

_HEARTBEAT_NS: Final = 50_000_000
"""A reader learns of a lost packet from the next heartbeat: Fast DDS's own period is 3 s."""

_SUPPRESSION_NS: Final = 20_000_000
"""Requests that come sooner are taken as being under way. With Fast DDS's own value, 0, every
message wakes one more thread: a quarter of the whole processor time at 1 kHz."""

_ANNOUNCEMENT_NS: Final = 500_000_000
"""A participant that starts later may miss the answer to its first announcement, and waits for our
next one then: Fast DDS's own period is 3 s."""

_BYTES_PER_MINUTE: Final = 4_000_000_000
"""No limit in practice. But with a limit a thread of its own makes the announcements. Without, Fast
DDS (to version 3 at least) announces a new participant before it listens itself, and whoever
answers at once is not heard: in half of all starts discovery then takes up to 3 s."""

_PROFILE: Final = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com"><profiles>
  <participant profile_name="imu_sim_ros_participant" is_default_profile="true"><rtps>
    <builtin><discovery_config><leaseAnnouncement>
      <sec>0</sec><nanosec>%d</nanosec>
    </leaseAnnouncement></discovery_config></builtin>
    <throughputController>
      <bytesPerPeriod>%d</bytesPerPeriod><periodMillisecs>60000</periodMillisecs>
    </throughputController>
  </rtps></participant>
  <data_writer profile_name="imu_sim_ros" is_default_profile="true"><times>
    <heartbeatPeriod><sec>0</sec><nanosec>%d</nanosec></heartbeatPeriod>
    <nackSupressionDuration><sec>0</sec><nanosec>%d</nanosec></nackSupressionDuration>
  </times></data_writer>
</profiles></dds>
"""
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


class Program(Protocol):
    """A node that can be run: it spins until ``done`` has a result, its exit status."""

    done: Any
    """rclpy Future; a thread of the node may set its result."""

    def close(self) -> None:
        """End threads and close files; called once, whatever the reason for the end."""


def main(
    name: str,
    text: str,
    section: type,
    create: Callable[[], Program],
    values: Mapping[str, object] | None = None,
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a node until it is done or a signal ends it.

    :param name: the executable's name.
    :param text: what it does, for ``--help``.
    :param section: its parameters.
    :param create: makes the node; rclpy is initialised by then.
    :param values: chosen values that decide which parameters exist.
    :param arguments: the command line without the program's name.
    :returns: exit status: the node's own, 0 after SIGINT or SIGTERM, 2 after printing one line for
        each thing that is wrong with the parameters.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if "--help" in arguments or "-h" in arguments:
        print(help_text(name, text, section, values or {}), end="")
        return 0
    try:
        with tempfile.TemporaryDirectory() as folder:
            set_profile(Path(folder))
            program = _start(ros_arguments(arguments, section, values or {}, Path(folder)), create)
        return _spin(program) if program is not None else 0
    except ImuSimError as error:
        for problem in error.problems:
            print(f"{name}: {problem}", file=sys.stderr)
        return 2
    finally:
        _shut_down()


def set_profile(folder: Path) -> None:
    """Give Fast DDS a profile, unless the user has one; other middlewares do not look at it."""
    if any(name in os.environ for name in _PROFILE_VARIABLES):
        return
    path = folder / "fastdds.xml"
    numbers = (_ANNOUNCEMENT_NS, _BYTES_PER_MINUTE, _HEARTBEAT_NS, _SUPPRESSION_NS)
    path.write_text(_PROFILE % numbers, encoding="utf-8")
    os.environ[_PROFILE_VARIABLES[0]] = str(path)


def _start(arguments: Sequence[str], create: Callable[[], Program]) -> Program | None:
    """Return the node; None where a signal came first."""
    import rclpy
    from rclpy.executors import ExternalShutdownException

    try:
        rclpy.init(args=["", *arguments])
    except RuntimeError as error:  # rcl's own classes have no other parent
        raise ConfigurationError(f"--ros-args: {' '.join(str(error).split())}") from None
    try:
        return create()
    except (KeyboardInterrupt, ExternalShutdownException):
        return None
    except RuntimeError:
        if rclpy.ok():
            raise
        return None  # SIGTERM ended ROS below a node that was only half made


def _spin(program: Any) -> int:
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(program)
    try:
        executor.spin_until_future_complete(program.done)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:  # rcl's own classes have no other parent
        if program.context.ok():
            raise
        # SIGTERM has ended ROS below a callback that was running.
    finally:
        # The node is closing already; a second Ctrl-C must not break that off.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        program.close()
        program.destroy_node()
        executor.shutdown(timeout_sec=0.5)
    return int(program.done.result() or 0) if program.done.done() else 0


def _shut_down() -> None:
    import rclpy

    rclpy.try_shutdown()
