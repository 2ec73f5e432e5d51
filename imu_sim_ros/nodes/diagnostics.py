# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages about a node: a status, and injected faults."""

from collections.abc import Mapping
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from imu_sim_ros.sensors.faults import Fault

PERIOD: Final = 1.0
"""Between two statuses of a node [s]."""


def diagnostics(
    stamp: Any, level: bytes, name: str, words: str, hardware: str, values: Mapping[str, Any]
) -> DiagnosticArray:
    """Return a message with one status.

    :param stamp: builtin_interfaces/Time.
    """
    status = DiagnosticStatus(
        level=level,
        name=name,
        message=words,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def fault_message(name: str, fault: Fault, imu: str, stamp: Any) -> DiagnosticArray:
    """Return the message for ``ground_truth/faults``; its stamp is that of the first sample hit.

    :param imu: the IMU's name, if there are several.
    """
    values = {
        "kind": fault.kind,
        "imu": imu,
        "triad": fault.triad,
        "duration [s]": f"{fault.duration:.9g}",
        "value": " ".join(f"{value:.9g}" for value in fault.axis_values()),
    }
    return diagnostics(stamp, DiagnosticStatus.ERROR, name, f"injected {fault.kind}", imu, values)
