# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How an auxiliary sensor of a board is declared: model, topics, table, readings, in one place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.timebase import span
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.types import Times

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import Pattern


class Samples(Protocol):
    """n samples of a sensor in the window of an IMU's block; further arrays hold the values."""

    @property
    def true_t_ns(self) -> Times:
        """(n,) true times [ns]."""

    @property
    def t_ns(self) -> Times:
        """(n,) the stamps of the messages, with the errors of the board's clock [ns]."""

    @property
    def release_t_ns(self) -> Times:
        """(n,) when a message leaves the driver [ns]."""

    @property
    def delivered(self) -> Times:
        """(m,) rows that are delivered, in order."""


class Model(Protocol):
    """A sensor whose samples are read in order."""

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault begin with the first sample not before the IMU's sample ``first``."""

    def read(
        self, block: ImuBlock, trajectory: Trajectory, temperature: TemperatureProfile
    ) -> Samples:
        """Return the samples that were not read yet and lie before the end of the IMU's block."""


class Now(Protocol):
    """The parameters that are valid for a block."""

    @property
    def imu(self) -> ImuParameters:
        """The board."""

    @property
    def rate(self) -> float:
        """Of the IMU [Hz]."""


Payloads = Callable[[Any, Any, ImuBlock, Now], "Pattern"]
"""Turns samples, the rows of them that are sent and the IMU's block into messages."""


@dataclass(frozen=True)
class Topic:
    """One topic of a sensor."""

    name: str
    type: str
    flags: tuple[str, ...]
    """The parameters ``publish.*`` that must all be true for the node to publish it."""
    payloads: Callable[[str, str], Payloads]
    """Makes the encoder for a frame and an encoding, ``cdr`` or ``ros1``."""
    truth: bool = False
    """At the true times of all samples, lost ones too; else what is delivered, as stamped."""


@dataclass(frozen=True)
class Table:
    """The table of a sensor in a dataset."""

    name: str
    """A key of ``bags.text.writer.BESIDE``."""
    values: Callable[[Any], NDArray[np.float64]]
    """(n, columns) of all n samples."""


@dataclass(frozen=True)
class Sensor:
    """All that the rest of the package has to know of an auxiliary sensor."""

    name: str
    """Of its parameters, ``imu.NAME_...``, and of its faults."""
    quantity: str
    """What it measures: the name in ``simulate(sensors=...)``, of ``publish.*`` and of a flight."""
    model: Callable[[ImuParameters, EnvironmentParameters, int, Mapping[str, Model]], Model]
    """Makes it: board, environment, time of the IMU's sample 0 [ns], the sensors before it."""
    topics: tuple[Topic, ...]
    """The readings first."""
    table: Table
    readings: "type[AuxiliaryReadings]"
    """What Python returns of a flight: a frozen dataclass of arrays of :class:`Samples`."""
    needs: Callable[[ImuParameters], tuple[str, ...]] = lambda imu: ()
    """Quantities of other sensors without which it cannot read."""
    realised: Callable[[Any, int], Any] = lambda parameters, seed: parameters
    """Its parameters for a seed, with nothing left to draw but the noise."""
    faults: bool = True


class AuxiliaryReadings:
    """n readings with stamps."""

    t_ns: Times

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {span(self.t_ns)}>"
