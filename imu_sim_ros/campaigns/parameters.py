# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a campaign and of its estimators."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import suggestion
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.parameters.kinds import choice, flag, integer, number, text

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


_ALIGN = choice(
    "plan", ("plan", *ALIGNMENTS), "alignment with the truth; plan: that of all other estimators"
)


@dataclass(frozen=True)
class DeadReckonEstimator:
    """Dead reckoning from the true initial state."""

    type: str = choice("dead_reckon", KINDS, "kind of the estimator")
    method: str = choice("midpoint", METHODS, "how position and velocity are integrated")
    attitude_update: str = choice("so3", ATTITUDE_UPDATES, "how the attitude is integrated")
    align: str = _ALIGN


@dataclass(frozen=True)
class CommandEstimator:
    """A program of any kind that reads a dataset and writes a trajectory."""

    type: str = choice("command", KINDS, "kind of the estimator")
    command: str = text(
        "",
        "the program and its arguments; in braces: " + ", ".join(PLACES),
    )
    dataset: str = choice("euroc", DATASETS, "format of the dataset written for it")
    estimate: str = choice("tum", ESTIMATES, "format of the trajectory it writes")
    estimate_topic: str = text("", "topic of the trajectory in a bag; empty: the only one")
    align: str = _ALIGN
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
