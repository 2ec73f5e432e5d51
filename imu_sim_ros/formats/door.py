# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The door of everything that is read: any bag, table or folder becomes Readings or States.

A format is a module with ``holds``, ``reading_blocks`` and ``states``, and its place in
:data:`FORMATS`; the first that recognises a path reads it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import InputError, Remark, warn
from imu_sim_ros.formats import bag, text
from imu_sim_ros.formats.choice import ACCEL_UNITS, GYRO_UNITS, Choice
from imu_sim_ros.inputs.header import UNITS
from imu_sim_ros.inputs.rows import Skipped, Warned, tell_skipped
from imu_sim_ros.records import Readings, States, concatenated, with_fields


class FileFormat(Protocol):
    """A module that reads one format."""

    def holds(self, path: Path) -> bool:
        """Return True if a path is of this format, by its content."""

    def reading_blocks(
        self, path: Path, topic: str | None, frame: str | None, skipped: Skipped | None
    ) -> Iterator[Readings]:
        """Yield the readings of one IMU in blocks of bounded size."""

    def odometry_topics(self, path: Path) -> list[str]:
        """Return the topics that may be the truth of the readings: those of Odometry."""

    def stated_units(self, path: Path, topic: str | None) -> dict[str, str]:
        """Return the units that the file itself states, by triad; it converts those."""

    def states(
        self,
        path: Path,
        topic: str | None,
        covariance: bool,
        skipped: Skipped | None,
        warned: Warned | None,
        recover: Recover,
    ) -> States:
        """Return poses, with all else that the source knows of the motion."""


FORMATS: Final[tuple[FileFormat, ...]] = (text, bag)
"""All formats; the first that recognises a path reads it."""
_DEFAULT: Final = Choice()


def format_of(path: Path) -> FileFormat:
    """Return the format of a path."""
    return next(entry for entry in FORMATS if entry.holds(path))


def reading_blocks(
    path: str | Path, choice: Choice = _DEFAULT, skipped: Skipped | None = None
) -> Iterator[Readings]:
    """Yield the readings of a file in blocks of bounded size, in SI units.

    :param skipped: receives the number of bad rows or messages that are left out; None: they are
        errors.
    :raises InputError: for a file that cannot be read; of several topics or frames all are listed.
    """
    path = Path(path)
    if choice.gyro_topic is not None or choice.accel_topic is not None:
        yield _merged(path, choice, skipped)
        return
    entry = format_of(path)
    if choice.gyro_unit is not None or choice.accel_unit is not None:
        choice = _without_stated(path, choice, entry.stated_units(path, choice.topic))
    for block in entry.reading_blocks(path, choice.topic, choice.frame, skipped):
        yield _in_si(block, choice)


def read_readings(
    path: str | Path, choice: Choice = _DEFAULT, skipped: Skipped | None = None
) -> Readings:
    """Return all readings of a file; arguments as for :func:`reading_blocks`.

    :raises InputError: also for a file without readings of the chosen frame.
    """
    blocks = list(reading_blocks(path, choice, skipped))
    if not blocks and choice.frame is not None:
        raise InputError(f"{path}: contains no readings of the frame {choice.frame}")
    empty = Readings(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), source=str(path))
    return concatenated(blocks or [empty])


def _without_stated(path: Path, choice: Choice, stated: Mapping[str, str]) -> Choice:
    """Return a choice without the units that the file itself states, which are converted by it.

    :raises InputError: for a unit that contradicts the file.
    """
    gyro, accel = stated.get(TRIADS[0]), stated.get(TRIADS[1])
    problems = [
        f"{path}: {name} = {unit}: the header says {own}"
        for name, unit, own, units, known in (
            ("gyro_unit", choice.gyro_unit, gyro, GYRO_UNITS, UNITS[TRIADS[0]]),
            ("accel_unit", choice.accel_unit, accel, ACCEL_UNITS, UNITS[TRIADS[1]]),
        )
        if unit is not None and own is not None and units[unit] != known[own]
    ]
    if problems:
        raise InputError(problems)
    return replace(
        choice,
        gyro_unit=None if gyro else choice.gyro_unit,
        accel_unit=None if accel else choice.accel_unit,
    )


def _in_si(readings: Readings, choice: Choice) -> Readings:
    """Return readings converted from the units of the choice to SI units."""
    gyro, accel = readings.gyro, readings.accel
    if choice.gyro_unit is not None and gyro is not None:
        gyro = gyro * GYRO_UNITS[choice.gyro_unit]
    if choice.accel_unit is not None and accel is not None:
        accel = accel * ACCEL_UNITS[choice.accel_unit]
    if gyro is readings.gyro and accel is readings.accel:
        return readings
    return with_fields(readings, gyro=gyro, accel=accel)


def _merged(path: Path, choice: Choice, skipped: Skipped | None) -> Readings:
    """Return gyroscope and accelerometer of two topics, at the times of the gyroscope.

    :raises InputError: if one of the topics is not named, or they have no time in common.
    """
    if choice.gyro_topic is None or choice.accel_topic is None:
        raise InputError(f"{path}: gyro_topic and accel_topic: name both")
    gyroscope, accelerometer = (
        concatenated(list(format_of(path).reading_blocks(path, topic, choice.frame, skipped)))
        for topic in (choice.gyro_topic, choice.accel_topic)
    )
    if gyroscope.gyro is None or accelerometer.accel is None:
        topic = choice.gyro_topic if gyroscope.gyro is None else choice.accel_topic
        triad = "gyroscope" if gyroscope.gyro is None else "accelerometer"
        raise InputError(f"{path}: {topic} contains no readings of the {triad}")
    order = np.argsort(accelerometer.t_ns, kind="stable")
    times, values = accelerometer.t_ns[order], accelerometer.accel[order]
    rows = (gyroscope.t_ns >= times[0]) & (gyroscope.t_ns <= times[-1])
    if not rows.any():
        raise InputError(
            f"{path}: {choice.gyro_topic} and {choice.accel_topic} have no time in common"
        )
    t_ns = gyroscope.t_ns[rows]
    start = int(times[0])
    at = (t_ns - start).astype(np.float64)
    known = (times - start).astype(np.float64)
    accel = np.column_stack([np.interp(at, known, axis) for axis in values.T])
    period = float(np.median(np.diff(known))) * 1e-9 if len(known) > 1 else 0.0
    if period > 0.0:
        # Midway between two samples the response is cos(pi f T), the worst case of interpolation.
        warn(
            f"{path}: the accelerometer is interpolated to the times of the gyroscope: at "
            f"{0.25 / period:.3g} Hz up to {1.0 - np.cos(np.pi / 4.0):.0%} of a motion is lost, "
            "and white noise is up to a factor of 1/sqrt(2) smaller",
            Remark,
        )
    merged = Readings.unchecked(
        t_ns=t_ns,
        gyro=gyroscope.gyro[rows],
        accel=accel,
        frame_id=gyroscope.frame_id,
        source=str(path),
    )
    return _in_si(merged, choice)


def read_states(
    path: str | Path,
    topic: str | None = None,
    skip_bad_rows: bool = False,
    covariance: bool = False,
    warned: Warned | None = None,
    recover: Recover = False,
    least: int = 0,
) -> States:
    """Return the states of a file: a topic of any type with poses, text, a folder.

    :param topic: topic of a bag; ``/tf:PARENT.CHILD`` are transforms between two frames; None: the
        only one of Odometry, else of PoseStamped, PoseWithCovarianceStamped, TransformStamped,
        Path.
    :param skip_bad_rows: leave out bad rows and messages, and count them in the record.
    :param covariance: read covariances, too, which need five times the memory of all else.
    :param warned: receives what is wrong with messages, which are passed on as they are.
    :param recover: read a damaged bag as far as possible.
    :param least: smallest number of poses.
    :raises InputError: for what cannot be read, stamps that do not increase, too few poses.
    """
    path = Path(path)
    counts: list[int] = []
    skipped = counts.append if skip_bad_rows else None
    entry = format_of(path)
    states = entry.states(path, topic, covariance, skipped, warned, recover)
    if len(states) < least:
        name = str(path) if topic is None else f"{path}, {topic}"
        raise InputError(f"{name}: {len(states)} poses; a trajectory needs two or more")
    states = with_fields(states, skipped=sum(counts))
    return states if warned is not None else states.in_order()


def read_trajectory(
    path: str | Path,
    topic: str | None = None,
    covariance: bool = False,
    skip_bad_rows: bool = False,
) -> States:
    """Return the states of a trajectory of two poses or more, and tell how many rows are bad.

    Arguments as for :func:`read_states`. A covariance of zeros is unknown, so None.
    """
    states = read_states(path, topic, skip_bad_rows, covariance, least=2)
    if states.skipped:
        tell_skipped(path)(states.skipped)
    return states
