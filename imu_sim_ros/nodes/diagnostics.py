# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages about a node: a status, and injected faults."""

from collections.abc import Mapping
from typing import Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.parameters import SampledParameters

PERIOD: Final = 1.0
"""Time between two statuses of a node [s]."""


def diagnostics(
    stamp: Time, level: bytes, name: str, text: str, hardware: str, values: Mapping[str, object]
) -> DiagnosticArray:
    """Return a message with one status."""
    status = DiagnosticStatus(
        level=level,
        name=name,
        message=text,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def drawn_constants(imus: Mapping[str, SampledParameters]) -> dict[str, str]:
    """Return the seed of each IMU and the constants that it has drawn, by parameter.

    :param imus: IMUs by name; a single one has an empty name.
    """
    result: dict[str, str] = {}
    for name, parameters in imus.items():
        prefix = f"{name}." if name else ""
        result[f"{prefix}seed"] = str(parameters.seed)
        configured = flatten(parameters.imu)
        for key, value in flatten(realise_imu(parameters.imu, parameters.seed)).items():
            if value != configured[key] and isinstance(value, tuple) and not key.endswith("_sigma"):
                numbers = " ".join(f"{number:.9g}" for number in value)
                result[f"{prefix}imu.{key}"] = numbers
    return result


def fault_message(name: str, fault: Fault, imu: str, stamp: Time) -> DiagnosticArray:
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
