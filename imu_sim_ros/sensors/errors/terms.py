# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every part of a triad's bias is: a term, of one unit or of the units of a batch."""

from abc import ABC, abstractmethod
from typing import NamedTuple

from imu_sim_ros.random_streams import Units
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array


class Surroundings(NamedTuple):
    """What acts on a triad during n readings."""

    temperature_offset: Array
    """(n, ...) temperature above the reference [K]."""
    force: Array | None = None
    """(n, ..., 3) ideal specific force [m/s^2]; None: it is not known yet."""


class ErrorTerm(ABC):
    """A part of the bias of a triad."""

    active = True
    """Whether it adds anything with its present parameters."""
    follows_force = False
    """Whether it depends on the specific force, so that it cannot be computed before that."""

    def configure(self, parameters: TriadParameters) -> None:  # noqa: B027
        """Take the strength that the parameters give, from the next sample on, if it may change."""

    def begin(self, units: Units) -> None:  # noqa: B027
        """Let some units of a batch begin again, from their present seeds, if that matters."""

    @abstractmethod
    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n samples of some units to values (n, ..., 3)."""
