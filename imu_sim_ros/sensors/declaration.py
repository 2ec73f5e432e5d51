# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of a sensor: parameters, model, topics, table, readings, in one place.

A sensor that each IMU has with it has the parameters ``imu.NAME_...`` and the clock, transport and
mount of the IMU. A sensor that the parameter ``sensors`` names has the parameters ``NAME.*``, and a
clock, transport and mount of its own; there may be several of a kind.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from imu_sim_ros.core.records import TimeSeries
from imu_sim_ros.core.timebase import describe_span
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Rows, Samples
from imu_sim_ros.sensors.world import Window, World

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import RowTemplate
    from imu_sim_ros.sensors.deferred import Results


class Model(Protocol):
    """A sensor whose samples are read in order."""

    def configure(self, parameters: Any) -> None:
        """Apply new values of live parameters, from the next sample on.

        :param parameters: what the sensor was made with: those of its IMU, or its own section.
        """

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Start a fault at the first sample at or after a time since the start [s]."""

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""


Payloads = Callable[[Samples, Rows, Any], "RowTemplate | list[bytes] | Results[bytes]"]
"""Turns samples and the rows of them that are sent into messages.

The last argument are the parameters valid for the samples, :attr:`Mounted.valid`, whose type is the
sensor's.
"""
P_co = TypeVar("P_co", bound=MountedParameters, covariant=True)
"""Parameters that a sensor's model is made with: those of its IMU, or its own section.

Covariant, so that sensors of all kinds stand in one table: each function of a declaration is called
only with a sensor that is mounted by the same declaration.
"""


@dataclass(frozen=True)
class Mounted(Generic[P_co]):
    """A sensor on a body."""

    name: str
    """Name in its parameters, faults and random streams: the kind of sensor, or another name if
    there are several of a kind."""
    sensor: "Sensor[P_co]"
    parameters: P_co
    """The parameters that its model is made with: those of its IMU, or its own section."""
    environment: EnvironmentParameters
    """The parameters of its simulation: world, cameras, and the rate and seed of its IMU."""
    frame: str
    """Frame of its messages."""
    space: str = ""
    """Namespace of its topics, with a slash, if there are several of a kind."""

    @property
    def valid(self) -> MountedParameters:
        """The parameters that its messages depend on: those of the simulation, if an IMU has it."""
        return self.environment if self.sensor.with_imu else self.parameters

    @property
    def faulty(self) -> tuple[str, ...]:
        """Names of its targets of faults: its parts, or itself; none if no fault can hit it."""
        parts = self.sensor.faulty_parts
        return (self.name,) if parts is None else parts

    def takes(self, fault: Fault) -> bool:
        """Return whether a fault hits this sensor; one without a name hits sensors with parts."""
        return fault.triad in self.faulty or (not fault.triad and bool(self.sensor.faulty_parts))


@dataclass(frozen=True)
class Topic:
    """One topic of a sensor."""

    name: str
    type: str
    flags: tuple[str, ...] | None
    """The parameters ``publish.*`` that must all be true for the node to publish it; none for what
    is always published. None: only a bag has it, on request."""
    payloads: Callable[[Mounted[Any], str], Payloads]
    """Makes the encoder for a sensor and an encoding, ``cdr`` or ``ros1``."""
    truth: bool = False
    """True if messages bear the true times of all samples, lost ones too; else only delivered
    samples are sent, with their stamps."""
    foreign: bool = False
    """True if its type is in a package that need not be installed: a bag has it on request, a node
    publishes it if it can."""
    sent: Callable[[Samples], Mask] | None = None
    """Returns for which samples (n,) there is a message at all; None: for all."""
    exists: Callable[[Mounted[Any]], bool] = lambda _: True
    """Returns True if a sensor with these parameters has the topic."""
    latched: bool = False
    """True if the last message is kept for later subscribers."""


def topic(
    name: str,
    type_name: str,
    encoder: str,
    values: Callable[[Samples, Rows, Any], Sequence[object]],
    *flags: str,
    truth: bool = False,
    foreign: bool = False,
    in_world: bool = False,
    sent: Callable[[Samples], Mask] | None = None,
) -> Topic:
    """Return a topic whose messages have the stamps, or the true times, of the samples.

    :param encoder: name of a class of ``bags.messages.encode`` that takes frame and encoding.
    :param values: returns what its ``pattern`` takes behind the stamps, of samples, the rows of
        them that are sent, and the valid parameters.
    :param flags: as :class:`Topic` has them, like all that follows.
    :param in_world: its vectors are along the axes of `world_frame`, which its header names, not
        of the sensor's frame.
    """

    def make(mounted: Mounted[MountedParameters], encoding: str) -> Payloads:
        encode: Any = import_module("imu_sim_ros.bags.messages.encode")
        frame = mounted.environment.world_frame if in_world else mounted.frame
        messages = getattr(encode, encoder)(frame, encoding)

        def payloads(samples: Samples, rows: Rows, valid: Any) -> "RowTemplate":
            t_ns = samples.true_t_ns if truth else samples.t_ns
            return messages.pattern(t_ns[rows], *values(samples, rows, valid))

        return payloads

    return Topic(
        name=name,
        type=type_name,
        flags=flags,
        payloads=make,
        truth=truth,
        foreign=foreign,
        sent=sent,
    )


def import_on_call(module: str, name: str) -> Callable[..., Any]:
    """Return a function that calls one of a module, which is imported with the first call.

    Most runs have few sensors, and what makes one is slow to import.
    """
    return lambda *arguments: getattr(import_module(module), name)(*arguments)


class Companion(Protocol):
    """Files that are written next to an output while its samples are made."""

    def write(self, read: Samples) -> None:
        """Write the next samples."""

    def close(self) -> None:
        """Complete the files."""


class Switch(NamedTuple):
    """An option of ``generate``, ``--NAME``, that asks for the files of a sensor."""

    name: str
    parameter: str
    """The flag of its section that the option sets; it also switches the sensor on."""
    text: str
    """Description in ``--help``."""


@dataclass(frozen=True)
class Companions(Generic[P_co]):
    """Files that a sensor's own programs read, next to a bag or a dataset."""

    suffixes: Callable[[P_co], tuple[str, ...]]
    """Returns of its section what the files' names end in; empty: none is wanted."""
    open: Callable[[P_co, EnvironmentParameters, int, Sequence[Path]], Companion]
    """Takes its section, the environment, the time of the IMU's sample 0 [ns], and the files."""
    switch: Switch | None = None
    """None: its parameters alone ask for them."""


@dataclass(frozen=True)
class Serial(Generic[P_co]):
    """Output of a sensor on a serial line: in a node, a pseudo-terminal."""

    where: Callable[[P_co], str]
    """Returns of its section where the terminal is linked; ``pty``: nowhere; empty: it has none."""
    lines: Callable[[Samples, Rows], list[str]]
    """Returns a text in ASCII for each of some rows of samples."""


@dataclass(frozen=True)
class NativeOutputs(Generic[P_co]):
    """Outputs in the formats of a sensor's own programs."""

    companions: Companions[P_co] | None = None
    serial: Serial[P_co] | None = None


class WithImu(NamedTuple):
    """Declaration of a sensor that each IMU has, with the IMU's clock, transport and mount."""

    switches: type | None = None
    """Frozen dataclass of the flags that are the sensor's own parameters ``publish.*``."""
    unit_hint: Callable[[Array], str] | None = None
    """Check of the ideal values from another simulator, for a model that has ``apply``: returns a
    line if the first value, () or (3,), seems to be in another unit, or else nothing. None: the
    sensor takes no ideal values."""


@dataclass(frozen=True)
class Rendering(Generic[P_co]):
    """Declaration of frames and what follows from them, for which a node has other processes."""

    datasets: tuple[str, ...]
    """Formats of datasets with a dedicated place for its quantity, which always contain it."""
    notes: Callable[[Mounted[P_co]], list[str]] = lambda _: []
    """Returns a line for each thing that was decided for it, and that users may want to know."""


def _no_needs(_: MountedParameters) -> tuple[str, ...]:
    """Return the needs of a sensor that reads without any other."""
    return ()


@dataclass(frozen=True)
class Sensor(Generic[P_co]):
    """All that the rest of the package has to know of a sensor."""

    name: str
    """NAME in its parameters, ``imu.NAME_...`` or ``NAME.*``, and in its faults."""
    quantity: str
    """Measured quantity: the name in ``simulate(sensors=...)``, of ``publish.*`` and of a flight;
    for a sensor that ``sensors`` names, its name."""
    section: type
    """Frozen dataclass of the parameters; that of a sensor that ``sensors`` names derives from
    :class:`~imu_sim_ros.sensors.parameters.SensorParameters`."""
    model: Callable[[Mounted[P_co], int, Mapping[str, Any]], Model]
    """Returns a new sensor at its start, from its mount and parameters, the time of the start [ns],
    and the models of the sensors before it by quantity."""
    topics: tuple[Topic, ...]
    """Topics of its messages, the readings before their truth."""
    readings: "type[SensorReadings | TimeSeries] | None"
    """Frozen dataclass of arrays of the samples, returned for a flight in Python. None: the samples
    are too large."""
    with_imu: WithImu | Literal[False] = False
    """False: it has parameters ``NAME.*``, and a clock, transport and mount of its own."""
    table: Table | None = None
    """Table of the readings in datasets of text; None: it has another form there, or none."""
    values: Callable[[Samples], Array] = np.asarray
    """Returns the numbers (n, columns) of the table from all n samples."""
    needs: Callable[[P_co], tuple[str, ...]] = _no_needs
    """Returns quantities or names of the sensors without which it cannot read, from its parameters,
    or from those of its IMU."""
    realised: Callable[[Any, int, str], Any] = lambda parameters, seed, name: parameters
    """Returns its parameters with all constants drawn, from the parameters, a seed and its name;
    only the noise is still random."""
    sees: bool = False
    """True if it sees or ranges: the world then has a scene, which leaves its path free."""
    in_sight: Callable[[Mounted[P_co], World, Array], Mask] | None = None
    """Returns at which times (n,) since the start [s] a sensor that sees has anything of the scene
    in its field of view (n,); None: whenever the scene has surfaces."""
    warnings: Callable[[Mounted[P_co], World, float], list[str]] = lambda *_: []
    """Returns a line for each way in which a world, or a motion of this length [s], is not for
    this sensor, or raises a ConfigurationError if it cannot read there at all."""
    faulty_parts: tuple[str, ...] | None = None
    """Names of the parts that faults hit; empty: no fault hits it; None: the sensor as a whole."""
    text: str = ""
    """Description in one line of ``--help``."""
    presets: str = ""
    """The folder in config/ of the files that ``NAME.preset`` names; empty: it has none."""
    rendering: Rendering[P_co] | None = None
    outputs: NativeOutputs[P_co] | None = None
    """Files and lines for its own programs; None: it has none."""

    @property
    def faults(self) -> bool:
        """True if faults can hit it, or its parts."""
        return self.faulty_parts != ()

    @property
    def switches(self) -> type | None:
        """Dataclass of the flags that are its own parameters ``publish.*``; None: it has none."""
        return self.with_imu.switches if self.with_imu else None

    @property
    def apart(self) -> bool:
        """True if a node makes its samples in a process of their own."""
        return self.rendering is not None

    @property
    def datasets(self) -> tuple[str, ...]:
        """Formats of datasets with a dedicated place for its quantity."""
        return () if self.rendering is None else self.rendering.datasets

    @property
    def companions(self) -> Companions[P_co] | None:
        """Files next to an output; None: it has none."""
        return None if self.outputs is None else self.outputs.companions

    @property
    def serial(self) -> Serial[P_co] | None:
        """Lines on a serial line; None: it has none."""
        return None if self.outputs is None else self.outputs.serial


def takes_ideal_values(sensor: Sensor[MountedParameters]) -> bool:
    """Return True for a sensor of an IMU whose ideal values another simulator can give."""
    return sensor.with_imu is not False and sensor.with_imu.unit_hint is not None


@dataclass(frozen=True, repr=False)
class SensorReadings:
    """The n readings of a sensor that are delivered; fields of one's own follow."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the sensor's clock."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {describe_span(self.t_ns)}>"
