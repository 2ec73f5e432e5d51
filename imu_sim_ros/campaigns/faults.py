# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The faults of a campaign: which fault of the sensor occurs when."""

from collections.abc import Mapping
from dataclasses import dataclass

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import shown
from imu_sim_ros.sensors import with_faults
from imu_sim_ros.sensors.faults import Fault


@dataclass(frozen=True)
class TimedFault:
    """A fault and its start time."""

    at: float
    """[s] after the start."""
    fault: Fault


def read_faults(content: object) -> tuple[TimedFault, ...]:
    """Return the faults that a plan's ``faults`` describe.

    :raises ConfigurationError: with a line for each problem.
    """
    if content is None:
        return ()
    if not isinstance(content, list):
        raise ConfigurationError(f"faults = {shown(content)}: must be a list of faults")
    found, problems = [], []
    for number, entry in enumerate(content):
        try:
            found.append(_fault(f"faults[{number}]", entry))
        except ConfigurationError as error:
            problems += [f"faults[{number}]: {line}" for line in error.problems]
        except (TypeError, ValueError) as error:
            problems.append(f"faults[{number}] = {shown(entry)}: {error}")
    if problems:
        raise ConfigurationError(problems)
    return tuple(found)


def _fault(where: str, entry: object) -> TimedFault:
    if not isinstance(entry, Mapping):
        raise ConfigurationError(
            f"{shown(entry)}: must hold at, kind, and optionally duration, value and triad"
        )
    unknown = set(entry) - {"at", "kind", "duration", "value", "triad"}
    if unknown:
        raise ConfigurationError(f"{', '.join(sorted(map(str, unknown)))}: unknown")
    at = entry.get("at", 0.0)
    if isinstance(at, bool) or not isinstance(at, int | float) or not 0.0 <= at < 1e9:
        raise ConfigurationError(f"at = {shown(at)}: must be a time of at least 0 s")
    triad = str(entry.get("triad", ""))
    if triad in with_faults():
        raise ConfigurationError(f"triad = {triad}: a campaign simulates the IMU alone")
    value = entry.get("value", 0.0)
    values = tuple(float(v) for v in value) if isinstance(value, list) else float(value)
    return TimedFault(
        float(at),
        Fault(
            str(entry.get("kind")),
            duration=float(entry.get("duration", float("inf"))),
            value=values,  # type: ignore[arg-type]
            triad=triad,
        ),
    )
