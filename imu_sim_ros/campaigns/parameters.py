# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a campaign, of its estimators, and of the faults that it injects."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import short_repr, suggestion
from imu_sim_ros.navigation.coverage import ALLOWANCE, LEAST
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.parameters.kinds import choice, flag, integer, number, text
from imu_sim_ros.recordings.order import POSES_GAP
from imu_sim_ros.sensors.faults import Fault

ALIGNMENTS = ("none", "yaw", "se3", "sim3")
DATASETS = ("euroc", "tracks", "rosbag2", "ros1", "mcap")
ESTIMATES = ("tum", "euroc", "bag")
CALIBRATIONS = ("allan", "six_position", "turntable", "temperature")
KINDS = ("dead_reckon", "command", *CALIBRATIONS)
KEEP = ("none", "failed", "all")
PLACES = ("dataset", "config", "estimate", "folder", "seed", "python", "share", "plan")
"""Placeholders of a command."""


@dataclass(frozen=True)
class CampaignParameters:
    """Options of all runs of a campaign."""

    name: str = text("campaign", "title of the campaign")
    retries: int = integer(
        2,
        "how many times a run is restarted after its worker process died",
        minimum=0,
        maximum=100,
    )
    diverged_above: float = number(
        0.0,
        "final position error above which a run counts as failed: diverged; 0: no limit",
        unit="m",
        minimum=0.0,
    )
    keep: str = choice("none", KEEP, "which run folders of commands are kept")
    align: str = choice(
        "auto",
        ("auto", *ALIGNMENTS),
        "alignment of every trajectory with the truth before its errors are computed; auto: yaw if "
        "an estimator is a program, else none",
    )


@dataclass(frozen=True)
class TrajectoryEstimator:
    """Parameters that all estimators of trajectories have."""

    align: str = choice(
        "plan",
        ("plan", *ALIGNMENTS),
        "alignment with the truth; plan: that of all other estimators",
    )
    coverage: float = number(
        LEAST,
        "share of the truth's time that has to be estimated; a run with less is failed",
        minimum=0.0,
        maximum=1.0,
    )
    max_gap: float = number(
        POSES_GAP,
        "poses further apart have a gap between them, which is not covered",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    initialisation_allowance: float = number(
        ALLOWANCE,
        "time before the first pose that does not count for the coverage, up to a quarter of the "
        "truth's time",
        unit="s",
        minimum=0.0,
    )


@dataclass(frozen=True)
class DeadReckonEstimator(TrajectoryEstimator):
    """Dead reckoning from the true initial state."""

    type: str = choice("dead_reckon", KINDS, "kind of the estimator")
    method: str = choice("midpoint", METHODS, "how position and velocity are integrated")
    attitude_update: str = choice("so3", ATTITUDE_UPDATES, "how the attitude is integrated")


@dataclass(frozen=True)
class CommandEstimator(TrajectoryEstimator):
    """A program of any kind that reads a dataset and writes a trajectory."""

    type: str = choice("command", KINDS, "kind of the estimator")
    command: str = text(
        "",
        "the program and its arguments; in braces: " + ", ".join(PLACES),
    )
    dataset: str = choice("euroc", DATASETS, "format of the dataset written for it")
    estimate: str = choice("tum", ESTIMATES, "format of the trajectory it writes")
    estimate_topic: str = text("", "topic of the trajectory in a bag; empty: the only one")
    timeout: float = number(
        600.0, "time after which it is terminated", unit="s", minimum=0.0, above_minimum=True
    )
    memory_limit: float = number(0.0, "address space it may use; 0: no limit", unit="B", minimum=0)
    disk_limit: float = number(
        2e9,
        "largest size of its folder, captured output included",
        unit="B",
        minimum=0.0,
        above_minimum=True,
    )
    shell: bool = flag(False, "run the command by /bin/sh instead of directly")

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield problems that involve several parameters."""
        if not self.command.strip():
            yield f"{prefix}command = {self.command!r}: must name a program"


@dataclass(frozen=True)
class CalibrationEstimator:
    """Comparison of the result of ``allan`` or ``calibrate`` with the sensor of the record."""

    type: str = choice("allan", KINDS, "kind of the estimator")
    model: str = choice("standard", ("standard", "gauss_markov"), "for allan: the noise model")


def find_estimator(kind: str) -> type:
    """Return the parameters of a kind of estimator.

    :raises ConfigurationError: for an unknown kind.
    """
    kinds = {
        "dead_reckon": DeadReckonEstimator,
        "command": CommandEstimator,
        **dict.fromkeys(CALIBRATIONS, CalibrationEstimator),
    }
    if kind not in kinds:
        raise ConfigurationError(f"type = {kind!r}: {suggestion(kind, kinds)}")
    return kinds[kind]


@dataclass(frozen=True)
class TimedFault:
    """A fault and its start time."""

    start: float
    """Time after the start of the run [s]."""
    fault: Fault


def read_faults(content: object) -> tuple[TimedFault, ...]:
    """Return the faults that a plan's ``faults`` describe.

    :raises ConfigurationError: with a line for each problem.
    """
    if content is None:
        return ()
    if not isinstance(content, list):
        raise ConfigurationError(f"faults = {short_repr(content)}: must be a list of faults")
    faults, problems = [], Problems()
    for k, entry in enumerate(content):
        try:
            with problems.collect(prefix=f"faults[{k}]: "):
                faults.append(_fault(entry))
        except (TypeError, ValueError) as error:
            problems.append(f"faults[{k}] = {short_repr(entry)}: {error}")
    problems.tell()
    return tuple(faults)


def _fault(entry: object) -> TimedFault:
    """Return a fault of the plan with its time."""
    if not isinstance(entry, Mapping):
        raise ConfigurationError(
            f"{short_repr(entry)}: must hold at, kind, and optionally duration, value and triad"
        )
    unknown = set(entry) - {"at", "kind", "duration", "value", "triad"}
    if unknown:
        raise ConfigurationError(f"{', '.join(sorted(map(str, unknown)))}: unknown")
    start = entry.get("at", 0.0)
    if isinstance(start, bool) or not isinstance(start, int | float) or not 0.0 <= start < 1e9:
        raise ConfigurationError(f"at = {short_repr(start)}: must be a time of at least 0 s")
    triad = str(entry.get("triad", ""))
    if triad not in ("", *TRIADS):
        raise ConfigurationError(
            f"triad = {triad}: a campaign simulates the IMU alone, {' and '.join(TRIADS)}"
        )
    value = entry.get("value", 0.0)
    values = tuple(float(v) for v in value) if isinstance(value, list) else float(value)
    return TimedFault(
        float(start),
        Fault(
            str(entry.get("kind")),
            duration=float(entry.get("duration", float("inf"))),
            value=values,  # type: ignore[arg-type]
            triad=triad,
        ),
    )
