# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common parts of the nodes' programs: arguments, start, spinning, signals, exit status."""

import itertools
import os
import re
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Protocol

from imu_sim_ros.errors import ConfigurationError, explain
from imu_sim_ros.nodes import help, shared_memory, signals
from imu_sim_ros.nodes.arguments import ros_arguments

_HEARTBEAT_NS: Final = 50_000_000
"""A reader detects a lost packet at the next heartbeat; Fast DDS's own period is 3 s."""

_SUPPRESSION_NS: Final = 20_000_000
"""Requests that arrive sooner are taken as already answered. With Fast DDS's own value, 0, every
message wakes one more thread: a quarter of the whole processor time at 1 kHz."""

_ANNOUNCEMENT_NS: Final = 500_000_000
"""A participant that starts later may miss the answer to its first announcement, and waits for our
next one then: Fast DDS's own period is 3 s."""

_BYTES_PER_MINUTE: Final = 2_000_000_000
"""No limit in practice, but with a limit a thread of its own makes the announcements. Without one,
Fast DDS (up to version 3 at least) announces a new participant before it listens itself, and an
immediate answer is lost: in half of all starts discovery then takes up to 3 s."""

_PROFILE: Final = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com"><profiles>
  <participant profile_name="imu_sim_ros_participant" is_default_profile="true"><rtps>
    <builtin><discovery_config><leaseAnnouncement>
      <sec>0</sec><nanosec>%(announcement)d</nanosec>
    </leaseAnnouncement></discovery_config></builtin>
    <throughputController>
      <bytesPerPeriod>%(bytes)d</bytesPerPeriod><periodMillisecs>60000</periodMillisecs>
    </throughputController>
  </rtps></participant>
  <data_writer profile_name="imu_sim_ros" is_default_profile="true"><times>
    <heartbeatPeriod><sec>0</sec><nanosec>%(heartbeat)d</nanosec></heartbeatPeriod>
    <nackSupressionDuration>
      <sec>0</sec><nanosec>%(suppression)d</nanosec>
    </nackSupressionDuration>
  </times></data_writer>
</profiles></dds>
"""
_PROFILE_3: Final = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com"><profiles>
  <participant profile_name="imu_sim_ros_participant" is_default_profile="true"><rtps>
    <flow_controller_descriptor_list><flow_controller_descriptor>
      <name>imu_sim_ros_announcements</name><scheduler>FIFO</scheduler>
      <max_bytes_per_period>%(bytes)d</max_bytes_per_period><period_ms>60000</period_ms>
    </flow_controller_descriptor></flow_controller_descriptor_list>
    <builtin>
      <discovery_config><leaseAnnouncement>
        <sec>0</sec><nanosec>%(announcement)d</nanosec>
      </leaseAnnouncement></discovery_config>
      <flow_controller_name>imu_sim_ros_announcements</flow_controller_name>
    </builtin>
  </rtps></participant>
  <data_writer profile_name="imu_sim_ros" is_default_profile="true"><times>
    <heartbeat_period><sec>0</sec><nanosec>%(heartbeat)d</nanosec></heartbeat_period>
    <nack_supression_duration>
      <sec>0</sec><nanosec>%(suppression)d</nanosec>
    </nack_supression_duration>
  </times></data_writer>
</profiles></dds>
"""
"""The same for Fast DDS 3 (Kilted and later), which gave the elements other names."""
_FIRST_WITH_3: Final = 9
"""Major version of rmw_fastrtps; Jazzy has 8."""
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")

_PROFILE_FILE: Final = "imu_sim_ros_fastdds.xml"

_SHUTDOWN: Final = 0.1
"""[s] How long shutdown waits for callbacks that are themselves still waiting."""


class Program(Protocol):
    """A node that can be run until its ending is reached."""

    lifetime: Any
    """:class:`imu_sim_ros.nodes.lifetime.Lifetime`."""

    def close(self) -> None:
        """End threads and close files; called once, whatever the reason for the end."""

    def destroy_node(self) -> None:
        """As rclpy defines it."""


def main(name: str, create: Callable[[], Program], arguments: Sequence[str] | None = None) -> int:
    """Run a node until its ending is reached or a signal ends it.

    :param name: the executable's name.
    :param create: makes the node; rclpy is initialised by then.
    :param arguments: the command line without the program's name.
    :returns: exit status: the node's own; 0 after SIGINT, SIGTERM or SIGHUP; 2 after printing one
        line for each problem with the parameters; 1 after any other error.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    status = help.answer(name, list(arguments))
    if status is not None:
        return status
    arguments, debug = debugging(arguments)
    watch = signals.watch()
    try:
        watch.begin()
        with tempfile.TemporaryDirectory() as folder:
            set_profile(Path(folder))
            for path in shared_memory.remove_torn_segments():
                print(
                    f"{name}: {path}: a killed program of another user left it half initialised; "
                    "nodes of its ROS domain may hang until it is removed",
                    file=sys.stderr,
                )
            section = help.PROGRAMS[name].section
            program = _start(ros_arguments(arguments, section, Path(folder)), create)
        _spin(program, watch)
        error = program.lifetime.failure
        if error is not None:
            report(name, error, debug)
        return int(program.lifetime.status or 0)
    except Exception as error:
        report(name, error, debug)
        return explain(error)[1]
    finally:
        _shut_down()
        watch.close()


def debugging(arguments: Sequence[str]) -> tuple[list[str], bool]:
    """Return the arguments without ``--debug``, and whether errors are to show a traceback.

    ROS's own ``--log-level debug`` (or ``NODE:=debug``) requests it as well, and stays.
    """
    rest = [argument for argument in arguments if argument != "--debug"]
    levels = [value for flag, value in itertools.pairwise(rest) if flag == "--log-level"]
    of_ros = any(level.lower().rpartition(":=")[2] == "debug" for level in levels)
    return rest, of_ros or len(rest) < len(arguments)


def report(name: str, error: BaseException, debug: bool) -> None:
    """Print an error, one line for each problem; on request with its traceback first."""
    if debug:
        traceback.print_exception(error)
    for line in explain(error)[0]:
        print(f"{name}: {line}", file=sys.stderr, flush=True)


def set_profile(folder: Path) -> None:
    """Give Fast DDS a profile, unless the user has one; other middlewares ignore it."""
    if any(name in os.environ for name in _PROFILE_VARIABLES):
        return
    path = folder / _PROFILE_FILE
    numbers = {
        "announcement": _ANNOUNCEMENT_NS,
        "bytes": _BYTES_PER_MINUTE,
        "heartbeat": _HEARTBEAT_NS,
        "suppression": _SUPPRESSION_NS,
    }
    newer = _rmw_fastrtps_version() >= _FIRST_WITH_3
    path.write_text((_PROFILE_3 if newer else _PROFILE) % numbers, encoding="utf-8")
    os.environ[_PROFILE_VARIABLES[newer]] = str(path)


def _rmw_fastrtps_version() -> int:
    """Return the major version of the middleware's layer on Fast DDS; 0: it is not installed."""
    # Wheels of ROS set the path only when rclpy is imported, which is too late for the profile.
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        manifest = Path(prefix) / "share/rmw_fastrtps_shared_cpp/package.xml"
        with suppress(OSError):
            found = re.search(r"<version>(\d+)\.", manifest.read_text(encoding="utf-8"))
            return int(found[1]) if found else 0
    return 0


def without_own_profile(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment for a child process, which makes a profile of its own."""
    return {
        name: value
        for name, value in environment.items()
        if name not in _PROFILE_VARIABLES or Path(value).name != _PROFILE_FILE
    }


def _start(arguments: Sequence[str], create: Callable[[], Program]) -> Program:
    """Initialise ROS without its signal handlers, and make the node."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    try:
        rclpy.init(args=["", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl's own classes have no other parent
        raise ConfigurationError(f"--ros-args: {' '.join(str(error).split())}") from None
    return create()


def _spin(program: Any, watch: signals.EndSignals) -> None:
    """Run the node until its ending is reached, and close it whatever happens."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(program)
    watch.deliver_to(program.lifetime.finish)
    try:
        while not program.lifetime.reached:
            executor.spin_once()
    finally:
        program.close()
        program.destroy_node()
        executor.shutdown(timeout_sec=_SHUTDOWN)


def _shut_down() -> None:
    import rclpy

    rclpy.try_shutdown()
