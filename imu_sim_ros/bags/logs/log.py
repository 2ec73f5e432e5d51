# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A log of many sensors as a bag: arrays of each sensor become messages, piece by piece."""

import io
import os
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.encode import (
    Encoder,
    FluidPressureEncoder,
    ImuEncoder,
    MagneticFieldEncoder,
    NavSatFixEncoder,
    OdometryEncoder,
    PoseStampedEncoder,
    TemperatureEncoder,
    TwistWithCovarianceEncoder,
)
from imu_sim_ros.bags.reader import END_NS, Bag, Recover, Timed
from imu_sim_ros.core.conventions import BODY_FRAME, IMU_FRAME, TRIADS, WORLD_FRAME
from imu_sim_ros.core.errors import InputError, Remark, name_source, warn
from imu_sim_ros.core.rotation import (
    conjugate,
    interpolate,
    log,
    multiply,
    normalise,
    rotate_inverse,
)
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Times
from imu_sim_ros.recordings.findings.clipping import ClippingCounts
from imu_sim_ros.recordings.pairing import pair as pair_triads

_ROWS: Final = 1 << 14
"""Messages of all topics in a piece, which bounds the memory of encoding."""
_STDERR: Final = 2
"""Descriptor of the standard error."""
_LONGEST_OUTPUT: Final = 1 << 16
"""Output of a library that is looked at [bytes]."""
_ABSENT: Final = (-1.0, *[0.0] * 8)
"""Covariance that marks a triad as absent from a message (REP-145)."""


@dataclass(frozen=True)
class LogStream:
    """n messages of one topic."""

    name: str
    """Name of the topic, which ROS accepts."""
    type: str
    """Type of the messages."""
    t_ns: Times
    """(n,) stamps."""
    encode: Callable[[slice], Bytes]
    """Returns the messages (m, size) of some rows, in the encoding of ROS 2."""
    aliases: tuple[str, ...] = ()
    """Names that the log's own tools have for the topic."""
    remarks: tuple[str, ...] = ()
    """Lines about its values, of which users are told when its messages are read."""


@dataclass(frozen=True)
class Contents:
    """Topics of a log, and lines about its damage."""

    streams: Sequence[LogStream]
    """Topics with messages."""
    preferred: Mapping[str, Sequence[str]] = field(default_factory=lambda: MappingProxyType({}))
    """Names of topics by type, of which the first that exists is read if the user names none."""
    clippings: Sequence[ClippingCounts] = ()
    """Counts of clipped readings."""
    damage: tuple[str, ...] = ()
    """Lines about parts that could not be read."""
    remarks: tuple[str, ...] = ()
    """Lines about values that were left out or derived."""
    derived: Callable[[str], LogStream | None] = lambda name: None
    """Returns a topic that is computed when a user names it; None: the name is none of these."""


class LogFormat(Protocol):
    """A module that reads one kind of log."""

    MEMORY: int
    """Memory that reading takes, in sizes of the file, if all of it are readings."""

    def holds(self, path: Path, magic: bytes) -> bool:
        """Return True if a path is of this kind.

        :param magic: first bytes of a file; empty for a folder.
        """

    def contents(self, path: Path) -> Contents:
        """Return the topics of a log.

        :raises InputError: for a log that cannot be read.
        """


class LogBag(Bag):
    """A log as a bag of ROS 2 messages."""

    encoding = "cdr"

    def __init__(self, path: Path, contents: Contents, recover: Recover = False) -> None:
        """Initialise with the contents of a log.

        :param recover: True: damage is in ``damage`` alone; False: there is a warning of it, too.
        """
        super().__init__(path)
        self._contents = contents
        self._streams: dict[TopicInfo, LogStream] = {}
        for stream in contents.streams:
            self._add(stream)
        self.clippings = contents.clippings
        self.damage += contents.damage
        for line in (*contents.remarks, *(() if recover else contents.damage)):
            warn(f"{path}: {line}", Remark)

    def _add(self, stream: LogStream) -> TopicInfo:
        """Add a topic to those of the bag, and return its description."""
        schema = schemas.schema(stream.type, self.encoding)
        info = TopicInfo(stream.name, stream.type, len(stream.t_ns), schema, ())
        self._streams[info] = stream
        self.topics = list(self._streams)
        return info

    def find(self, name: str) -> TopicInfo | None:
        """Return the topic of a name, as it is listed or as the log's own tools name it."""
        plain = name.strip("/")
        for info, stream in self._streams.items():
            if plain == info.name.strip("/") or plain in stream.aliases:
                return info
        derived = self._contents.derived(plain)
        return None if derived is None else self._add(derived)

    def default(self, type_name: str) -> str | None:
        """Return the preferred topic of a type, with a remark if there are others; None: none."""
        fitting = [info.name for info in self.topics if info.type == type_name]
        preferred = self._contents.preferred.get(type_name, ())
        name = next((name for name in preferred if name in fitting), None)
        if name is not None and len(fitting) > 1:
            rest = ", ".join(topic for topic in fitting if topic != name)
            warn(f"{self.path}: read: {name}; it also has {rest}", Remark)
        return name

    def _read_by_time(self, names: Collection[str]) -> Iterator[Timed]:
        """Yield the messages of topics in pieces of time."""
        chosen = [
            # A record time never decreases, whatever the stamps do.
            (info, stream, np.maximum.accumulate(stream.t_ns))
            for info, stream in self._streams.items()
            if info.name in names and info.count
        ]
        if not chosen:
            return
        for line in (line for _, stream, _ in chosen for line in stream.remarks):
            warn(f"{self.path}: {line}", Remark)
        times = np.sort(np.concatenate([record_ns for _, _, record_ns in chosen]))
        ends = [*np.unique(times[_ROWS::_ROWS]).tolist(), END_NS]
        starts = [0] * len(chosen)
        for end_ns in ends:
            blocks = []
            for k, (info, stream, record_ns) in enumerate(chosen):
                stop = int(np.searchsorted(record_ns, end_ns))
                rows = slice(starts[k], stop)
                if stop > starts[k]:
                    with name_source(self.path):
                        payloads = stream.encode(rows)
                    blocks.append(MessageBlock(info, record_ns[rows], payloads))
                starts[k] = stop
            yield Timed(end_ns, blocks)


def stream(
    name: str, encoder: Encoder, t_ns: Times, *columns: Array, aliases: Sequence[str] = ()
) -> LogStream:
    """Return the messages of an encoder.

    :param columns: (n, ...) arguments of its ``encode`` after the stamps.
    """

    def encode(rows: slice) -> Bytes:
        return encoder.encode(t_ns[rows], *(column[rows] for column in columns))

    return LogStream(name, encoder.type_name, t_ns, encode, tuple(aliases))


def imu(
    name: str,
    t_ns: Times,
    gyro: Array | None,
    accel: Array | None,
    *,
    q_wi: Array | None = None,
    frame_id: str = IMU_FRAME,
    aliases: Sequence[str] = (),
) -> LogStream:
    """Return readings in FLU; a triad that is None is marked as absent.

    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    :param q_wi: (n, 4) orientations of the sensor in ENU; None: it reports none.
    """
    encoder = ImuEncoder(
        frame_id,
        gyro_covariance=_ABSENT if gyro is None else 0.0,
        accel_covariance=_ABSENT if accel is None else 0.0,
    )
    zeros = np.zeros((len(t_ns), 3))
    columns = [zeros if triad is None else triad for triad in (gyro, accel)]
    if q_wi is not None:
        columns.append(normalise(q_wi))
    return stream(name, encoder, t_ns, *columns, aliases=aliases)


def odometry(
    name: str,
    t_ns: Times,
    position: Array,
    q_wb: Array,
    velocity: Array,
    rates: Array | None = None,
    variances: tuple[Array, Array, Array] | None = None,
    frame_id: str = WORLD_FRAME,
    aliases: Sequence[str] = (),
) -> LogStream:
    """Return poses with velocities.

    :param position: (n, 3) positions [m].
    :param q_wb: (n, 4) attitudes.
    :param velocity: (n, 3) in the world [m/s].
    :param rates: (n, 3) in the body [rad/s]; None: those of the attitude.
    :param variances: (n, 3) of position [m^2], of rotation about the world's axes [rad^2], and of
        velocity in the body [m^2/s^2]; None: unknown.
    """
    q_wb = normalise(q_wb)
    rates = body_rates(t_ns, q_wb) if rates is None else rates
    columns = [position, q_wb, rotate_inverse(q_wb, velocity), rates]
    if variances is not None:
        at_position, at_rotation, at_velocity = variances
        unknown = np.zeros_like(at_velocity)
        columns += [_diagonal(at_position, at_rotation), _diagonal(at_velocity, unknown)]
    encoder = OdometryEncoder(frame_id, BODY_FRAME)
    return stream(name, encoder, t_ns, *columns, aliases=aliases)


def poses(
    name: str,
    t_ns: Times,
    position: Array,
    q_wb: Array,
    frame_id: str = WORLD_FRAME,
    aliases: Sequence[str] = (),
) -> LogStream:
    """Return poses without velocities: positions (n, 3) [m], attitudes (n, 4)."""
    encoder = PoseStampedEncoder(frame_id)
    return stream(name, encoder, t_ns, position, normalise(q_wb), aliases=aliases)


def temperature(name: str, t_ns: Times, values: Array, frame_id: str = IMU_FRAME) -> LogStream:
    """Return temperatures (n,) [degC]."""
    return stream(name, TemperatureEncoder(frame_id), t_ns, values)


def magnetic_field(
    name: str, t_ns: Times, field_t: Array, aliases: Sequence[str] = ()
) -> LogStream:
    """Return magnetic fields (n, 3) in FLU [T]."""
    return stream(name, MagneticFieldEncoder(IMU_FRAME), t_ns, field_t, aliases=aliases)


def pressure(name: str, t_ns: Times, values: Array, aliases: Sequence[str] = ()) -> LogStream:
    """Return pressures (n,) [Pa]."""
    return stream(name, FluidPressureEncoder(BODY_FRAME), t_ns, values, aliases=aliases)


def fix(
    name: str,
    t_ns: Times,
    position: tuple[Array, Array, Array],
    has_fix: Mask,
    deviations: tuple[Array, Array],
    aliases: Sequence[str] = (),
) -> LogStream:
    """Return positions of a GNSS receiver.

    :param position: (n,) latitude and longitude [deg], and altitude above the ellipsoid [m].
    :param has_fix: (n,) True where the receiver has a position.
    :param deviations: (n,) horizontal and vertical standard deviation [m].
    """
    horizontal, vertical = (np.nan_to_num(deviation) ** 2 for deviation in deviations)
    variance = np.column_stack([horizontal, horizontal, vertical])
    status = np.where(has_fix, 0, -1)
    encoder = NavSatFixEncoder(BODY_FRAME)
    return stream(name, encoder, t_ns, *position, status, variance, aliases=aliases)


def velocity(name: str, t_ns: Times, velocity_enu: Array, deviation: Array) -> LogStream:
    """Return velocities of a GNSS receiver.

    :param velocity_enu: (n, 3) velocities [m/s].
    :param deviation: (n,) standard deviation of each axis [m/s].
    """
    variance = np.tile(np.nan_to_num(deviation)[:, None] ** 2, 3)
    return stream(name, TwistWithCovarianceEncoder(WORLD_FRAME), t_ns, velocity_enu, variance)


def body_rates(t_ns: Times, q_wb: Array) -> Array:
    """Return the angular rates (n, 3) of attitudes (n, 4) [rad/s], by central differences."""
    start, end, seconds = _neighbours(t_ns)
    return log(multiply(conjugate(q_wb[start]), q_wb[end])) / seconds


def velocities(t_ns: Times, position: Array) -> Array:
    """Return the velocities (n, 3) of positions (n, 3) [m/s], by central differences."""
    start, end, seconds = _neighbours(t_ns)
    return (position[end] - position[start]) / seconds


def _neighbours(t_ns: Times) -> tuple[Integers, Integers, Array]:
    """Return the rows before and after each row, and the times (n, 1) between these two [s]."""
    rows = np.arange(len(t_ns))
    start, end = np.maximum(rows - 1, 0), np.minimum(rows + 1, len(t_ns) - 1)
    seconds = (t_ns[end] - t_ns[start]) * 1e-9
    return start, end, np.where(seconds > 0.0, seconds, np.inf)[:, None]


def attitudes_at(t_ns: Times, at_ns: Times, q_wb: Array) -> Array:
    """Return attitudes (m, 4) at the times ``at_ns`` (m,), on the shortest arc between two.

    :param t_ns: (n,) times of the attitudes (n, 4), in any order.
    """
    order = np.argsort(t_ns, kind="stable")
    times, q = t_ns[order], normalise(q_wb[order])
    if len(times) < 2:
        return np.tile(q, (len(at_ns), 1))
    end = np.clip(np.searchsorted(times, at_ns), 1, len(times) - 1)
    start = end - 1
    step = np.maximum(times[end] - times[start], 1)
    share = np.clip((at_ns - times[start]) / step, 0.0, 1.0)
    return interpolate(q[start], q[end], share)


@dataclass(frozen=True)
class LogTriad:
    """n readings of one triad, which has a topic of its own in the log."""

    topic: str
    """Name of the topic."""
    aliases: tuple[str, ...]
    """Names that the log's own tools have for it."""
    t_ns: Times
    """(n,) stamps."""
    values: Array
    """(n, 3) readings in FLU [rad/s] or [m/s^2]."""


@dataclass(frozen=True)
class LogOrientations:
    """n orientations that a device reports."""

    t_ns: Times
    """(n,) stamps."""
    q_wi: Array
    """(n, 4) orientations of the sensor in ENU."""


def pair(
    gyro: LogTriad | None,
    accel: LogTriad | None,
    remarks: list[str],
    orientations: LogOrientations | None = None,
) -> Iterator[LogStream]:
    """Yield the readings of two triads of one IMU: each at its own times, with the other one.

    Equal times are one topic, which bears both names. Of others, the second triad is interpolated
    to the times of the first.

    :param remarks: receives lines about the interpolation.
    :param orientations: reported orientations, interpolated to the times of the readings.
    """
    if gyro is None or accel is None:
        for triad in (gyro, accel):
            if triad is not None:
                yield _alone(triad, triad is gyro, orientations)
        return
    if np.array_equal(gyro.t_ns, accel.t_ns):
        names = (*gyro.aliases, *accel.aliases, accel.topic.strip("/"))
        q_wi = _orientations_at(orientations, gyro.t_ns)
        yield imu(gyro.topic, gyro.t_ns, gyro.values, accel.values, q_wi=q_wi, aliases=names)
        return
    for triad, companion in ((gyro, accel), (accel, gyro)):
        names = TRIADS if triad is gyro else TRIADS[::-1]
        try:
            paired = pair_triads(triad.t_ns, triad.values, companion.t_ns, companion.values, names)
        except InputError as error:
            remarks.append(f"{triad.topic}: {error}; it has no {names[1]}")
            yield _alone(triad, triad is gyro, orientations)
            continue
        remarks += [f"{triad.topic}: {note}" for note in paired.notes]
        t_ns, values = triad.t_ns[paired.rows], triad.values[paired.rows]
        columns = (values, paired.values) if triad is gyro else (paired.values, values)
        q_wi = _orientations_at(orientations, t_ns)
        yield imu(triad.topic, t_ns, *columns, q_wi=q_wi, aliases=triad.aliases)


def _orientations_at(orientations: LogOrientations | None, t_ns: Times) -> Array | None:
    """Return orientations (n, 4) at the times of readings; None: the device reports none."""
    if orientations is None:
        return None
    return attitudes_at(orientations.t_ns, t_ns, orientations.q_wi)


def _alone(
    triad: LogTriad, is_gyro: bool, orientations: LogOrientations | None = None
) -> LogStream:
    """Return the readings of a triad that has no partner; the other triad is marked as absent."""
    columns = (triad.values, None) if is_gyro else (None, triad.values)
    q_wi = _orientations_at(orientations, triad.t_ns)
    return imu(triad.topic, triad.t_ns, *columns, q_wi=q_wi, aliases=triad.aliases)


@contextmanager
def capture_output(lines: list[str]) -> Iterator[None]:
    """Catch the lines that a library prints about a log, by Python or to the descriptor itself.

    :param lines: receives the lines after the block.
    """
    text = io.StringIO()
    with tempfile.TemporaryFile() as file:
        sys.stderr.flush()
        terminal = os.dup(_STDERR)
        os.dup2(file.fileno(), _STDERR)
        try:
            with redirect_stdout(text), redirect_stderr(text):
                yield
        finally:
            os.dup2(terminal, _STDERR)
            os.close(terminal)
        file.seek(0)
        content = file.read(_LONGEST_OUTPUT).decode("utf-8", "replace")
    lines += [line for line in (text.getvalue() + content).splitlines() if line.strip()]


def refuse_empty(path: Path, kind: str, names: Sequence[str]) -> InputError:
    """Return the error to raise for a log in which no topic is known.

    :param names: topics that the log has.
    """
    contents = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return InputError(
        f"{path}: {kind} without sensors or poses; it has {contents or 'no messages'}"
    )


def _diagonal(*variances: Array) -> Array:
    """Return diagonal matrices (n, 6, 6) of two times three variances (n, 3)."""
    diagonal = np.concatenate(variances, axis=1)
    return diagonal[:, :, None] * np.eye(6)
