# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Setup of Fast DDS: a profile, and shared memory without the remains of killed processes.

Fast DDS opens the segment of a port by ``boost::interprocess::managed_open_or_create`` (in
``SharedMemGlobal::open_port_internal``; seen in 2.14): its creator writes 2 into its first word
when it is ready, and every process that opens it waits for that, without limit. A process that is
killed in between leaves a file that makes every later participant of that domain hang while it
starts.
"""

import os
import re
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

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
"""Profile for Fast DDS 3 (Kilted and later), whose elements have other names."""
_FIRST_WITH_3: Final = 9
"""Major version of rmw_fastrtps; Jazzy has 8."""
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")

_PROFILE_FILE: Final = "imu_sim_ros_fastdds.xml"

FOLDER: Final = Path("/dev/shm")
_READY: Final = (2).to_bytes(4, "little")
_LONGEST_CREATION: Final = 1.0
"""A segment that is not ready after this time never will be; it takes microseconds [s]."""


def remove_torn_segments(folder: Path = FOLDER) -> list[Path]:
    """Remove the segments of ports that were never finished.

    :param folder: folder of shared memory.
    :returns: those that cannot be removed because they belong to another user.
    """
    foreign: list[Path] = []
    for path in folder.glob("fastrtps_port*"):
        if path.name.endswith("_el") or not _is_torn(path):
            continue
        try:
            path.unlink()
        except FileNotFoundError:
            continue
        except OSError:
            foreign.append(path)
    return foreign


def _is_torn(path: Path) -> bool:
    """Return whether a segment was created a while ago and is not ready."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _LONGEST_CREATION:
            with path.open("rb") as file:
                return file.read(len(_READY)) != _READY
    return False


def set_profile(folder: Path) -> None:
    """Set a profile of Fast DDS, unless the user has one; other middlewares ignore it."""
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
            match = re.search(r"<version>(\d+)\.", manifest.read_text(encoding="utf-8"))
            return int(match[1]) if match else 0
    return 0


def environment_of_child(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment for a child process, which makes a profile of its own."""
    return {
        name: value
        for name, value in environment.items()
        if name not in _PROFILE_VARIABLES or Path(value).name != _PROFILE_FILE
    }
