# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The door of everything that is read: any bag, table or folder becomes Readings or States.

A format is a module with ``holds``, ``reading_blocks`` and ``states``, and its place in
:data:`FORMATS`; the first that recognises a path reads it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.core.bad_rows import Skipped, Warned, tell_skipped
from imu_sim_ros.core.conventions import ACCEL_UNITS, GYRO_UNITS, TRIADS
from imu_sim_ros.core.errors import InputError, Remark, warn
from imu_sim_ros.core.records import Readings, States, concatenate, replace_fields
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.formats import bag, text, vio_data_simulation
from imu_sim_ros.formats.choice import AS_RECORDED, Choice
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.inputs.header import UNITS
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.recordings.pairing import pair


class FileFormat(Protocol):
    """A module that reads one format."""

    def holds(self, path: Path) -> bool:
        """Return True if a path is of this format, by its content."""

    def reading_blocks(
        self, path: Path, topic: str | None, frame: str | None, handling: Handling
    ) -> Iterator[Readings]:
        """Yield the readings of one IMU in blocks of bounded size."""

    def imu_topics(self, path: Path) -> Sequence[str | None]:
        """Return the topics of readings, each of one IMU; None: readings without a name."""

    def odometry_topics(self, path: Path) -> list[str]:
        """Return the topics that may be the truth of the readings: those of Odometry."""

    def truth_file(self, path: Path) -> Path | None:
        """Return the file of the states next to the readings of a path; None: there are none."""

    def pose_topics(self, path: Path) -> list[str]:
        """Return the topics of poses, one of each body."""

    def stated_units(self, path: Path, topic: str | None) -> dict[str, str]:
        """Return the units that the file itself states, by triad; it converts those."""

    def states(self, path: Path, topic: str | None, covariance: bool, handling: Handling) -> States:
        """Return poses, with all other quantities of the motion that the source has."""


FORMATS: Final[tuple[FileFormat, ...]] = (vio_data_simulation, text, bag)
"""All formats; the first that recognises a path reads it."""
_STRICT: Final = Handling()


def format_of(path: Path) -> FileFormat:
    """Return the format of a path."""
    return next(entry for entry in FORMATS if entry.holds(path))


def has_topics(path: str | Path) -> bool:
    """Return True for a bag, which may have other sensors and transforms, too; also for no file."""
    return format_of(Path(path)) is bag


def truth_file(path: Path) -> Path | None:
    """Return the file of the states next to the readings of a path; None: there are none."""
    return format_of(path).truth_file(path)


def imu_choices(path: Path, choice: Choice) -> list[Choice]:
    """Return a choice for each IMU of a file; that of merged topics replaces those of both."""
    merged = [name.strip("/") for name in (choice.gyro_topic, choice.accel_topic) if name]
    apart = replace(choice, gyro_topic=None, accel_topic=None)
    return [choice] * choice.merges + [
        replace(apart, topic=name)
        for name in format_of(path).imu_topics(path)
        if name is None or name.strip("/") not in merged
    ]


def reading_blocks(
    path: str | Path, choice: Choice = AS_RECORDED, handling: Handling = _STRICT
) -> Iterator[Readings]:
    """Yield the readings of a file in blocks of bounded size, in SI units.

    The notes of a block are the choices and conversions that it rests on; a remark tells them.

    :raises InputError: for a file that cannot be read; of several topics or frames all are listed.
    """
    path = Path(path)
    if choice.merges:
        yield _merge_triads(path, choice, handling)
        return
    entry = format_of(path)
    if choice.gyro_unit is not None or choice.accel_unit is not None:
        choice = _drop_stated_units(path, choice, entry.stated_units(path, choice.topic))
    notes = choice.notes()
    for note in notes:
        warn(f"{path}: {note}", Remark)
    for block in entry.reading_blocks(path, choice.topic, choice.frame, handling):
        yield _convert_to_si(block, choice, notes)


def read_readings(
    path: str | Path, choice: Choice = AS_RECORDED, skipped: Skipped | None = None
) -> Readings:
    """Return all readings of a file; arguments as for :func:`reading_blocks`.

    :param skipped: receives the number of bad rows or messages that are left out; None: they are
        errors.
    :raises InputError: also for a file without readings of the chosen frame.
    """
    blocks = iter(reading_blocks(path, choice, Handling(skipped)))
    head = next(blocks, None)
    if head is not None:
        return concatenate(chain([head], blocks))
    if choice.frame is not None:
        raise InputError(f"{path}: contains no readings of the frame {choice.frame}")
    return Readings(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), source=str(path))


def _drop_stated_units(path: Path, choice: Choice, header_units: Mapping[str, str]) -> Choice:
    """Return a choice without the units that the file itself states, which are converted by it.

    :raises InputError: for a unit that contradicts the file.
    """
    gyro, accel = header_units.get(TRIADS[0]), header_units.get(TRIADS[1])
    problems = [
        f"{path}: {argument_prefix(name, unit)}: the header says {header_unit}"
        for name, unit, header_unit, units, known_units in (
            ("gyro_unit", choice.gyro_unit, gyro, GYRO_UNITS, UNITS[TRIADS[0]]),
            ("accel_unit", choice.accel_unit, accel, ACCEL_UNITS, UNITS[TRIADS[1]]),
        )
        if unit is not None and header_unit is not None and units[unit] != known_units[header_unit]
    ]
    if problems:
        raise InputError(problems)
    return replace(
        choice,
        gyro_unit=None if gyro else choice.gyro_unit,
        accel_unit=None if accel else choice.accel_unit,
    )


def _convert_to_si(readings: Readings, choice: Choice, notes: tuple[str, ...]) -> Readings:
    """Return readings converted from the units of the choice to SI units, with notes of it."""
    if not notes:
        return readings
    gyro, accel = (
        values if values is None or factor == 1.0 else values * factor
        for values, factor in zip((readings.gyro, readings.accel), choice.factors, strict=True)
    )
    return replace_fields(readings, gyro=gyro, accel=accel, notes=(*readings.notes, *notes))


def _merge_triads(path: Path, choice: Choice, handling: Handling) -> Readings:
    """Return gyroscope and accelerometer of two topics, at the times of the gyroscope.

    Times without an accelerometer, before and after its readings and in its gaps, are left out.

    :raises InputError: if one of the topics is not named, or they have no time in common.
    """
    if choice.gyro_topic is None or choice.accel_topic is None:
        names = f"{argument('gyro_topic')} and {argument('accel_topic')}"
        raise InputError(f"{path}: {names}: name both")
    entry, parts = format_of(path), []
    for topic in (choice.gyro_topic, choice.accel_topic):
        blocks = list(entry.reading_blocks(path, topic, choice.frame, handling))
        if not blocks:
            frame = "" if choice.frame is None else f" of the frame {choice.frame}"
            raise InputError(f"{path}: {topic} contains no readings{frame}")
        parts.append(concatenate(blocks))
    gyroscope, accelerometer = parts
    if gyroscope.gyro is None or accelerometer.accel is None:
        raise InputError(
            f"{path}: {topic} contains no readings of the {triad} [{triad}_absent]"
            for topic, triad, values in (
                (choice.gyro_topic, TRIADS[0], gyroscope.gyro),
                (choice.accel_topic, TRIADS[1], accelerometer.accel),
            )
            if values is None
        )
    try:
        paired = pair(
            gyroscope.t_ns, gyroscope.gyro, accelerometer.t_ns, accelerometer.accel, TRIADS
        )
    except InputError as error:
        source = f"{path}: {choice.gyro_topic} and {choice.accel_topic}"
        raise InputError([f"{source}: {line}" for line in error.problems]) from None
    notes = (*choice.notes(), *paired.notes)
    for note in notes:
        warn(f"{path}: {note}", Remark)
    merged = Readings.unchecked(
        t_ns=gyroscope.t_ns[paired.rows],
        gyro=gyroscope.gyro[paired.rows],
        accel=paired.values,
        frame_id=gyroscope.frame_id,
        source=str(path),
    )
    return _convert_to_si(merged, choice, notes)


def read_states(
    path: str | Path,
    topic: str | None = None,
    skip_bad_rows: bool = False,
    covariance: bool = False,
    warned: Warned | None = None,
    recover: Recover = False,
    is_trajectory: bool = False,
    ordered: bool = True,
) -> States:
    """Return the states of a file: a topic of any type with poses, text, a folder.

    :param topic: topic of a bag; ``/tf:PARENT.CHILD`` are transforms between two frames; None: the
        only one of Odometry, else of PoseStamped, PoseWithCovarianceStamped, TransformStamped,
        Path.
    :param skip_bad_rows: leave out bad rows and messages, and count them in the record.
    :param covariance: read covariances, too, which need five times the memory of all else; zeros
        are unknown, so None.
    :param warned: receives what is wrong with messages, which are passed on as they are.
    :param recover: read a damaged bag as far as possible.
    :param is_trajectory: refuse fewer than two poses, between which there is no motion.
    :param ordered: put the poses into the order of time, see :func:`sort_poses`.
    :raises InputError: for what cannot be read, a clock that goes back, too few poses.
    """
    path = Path(path)
    counts: list[int] = []
    handling = Handling(counts.append if skip_bad_rows else None, warned, recover)
    states = format_of(path).states(path, topic, covariance, handling)
    states = replace_fields(states, skipped=sum(counts))
    if ordered and warned is None:
        states = sort_poses(states, skip_bad_rows)
    if is_trajectory and len(states) < 2:
        name = str(path) if topic is None else f"{path}, {topic}"
        raise InputError(f"{name}: {len(states)} poses; a trajectory needs two or more")
    if warned is not None:
        return states
    # All zeros: unknown (REP-145).
    return replace_fields(
        states,
        covariance=states.covariance if np.any(states.covariance) else None,
        twist_covariance=states.twist_covariance if np.any(states.twist_covariance) else None,
    )


def read_trajectory(
    path: str | Path,
    topic: str | None = None,
    covariance: bool = False,
    skip_bad_rows: bool = False,
) -> States:
    """Return the states of a trajectory of two poses or more, and tell how many rows are bad.

    Arguments as for :func:`read_states`.
    """
    states = read_states(path, topic, skip_bad_rows, covariance, is_trajectory=True)
    if states.skipped:
        tell_skipped(path)(states.skipped)
    return states
