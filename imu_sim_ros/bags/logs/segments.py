# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Segments of a moving person as topics of poses: names, and axes with z up.

A file whose y or x axis is up has its axes exchanged in a circle, those of the world and those of
the segments alike: with U of :func:`~imu_sim_ros.core.rotation.upright`, ``p_w = U p_file`` and
``R_wb = U R_file U^T``. A segment that is parallel to the world in the file is parallel to it here,
too.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs.log import LogStream
from imu_sim_ros.bags.messages.encode import POSE_STAMPED, PoseStampedEncoder
from imu_sim_ros.core.conventions import AXES, WORLD_FRAME
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.names import ros_name
from imu_sim_ros.core.rotation import normalise, upright
from imu_sim_ros.core.timebase import LOWEST_RATE, sample_times_ns
from imu_sim_ros.core.types import Array, Bytes, Times

UNITS: Final[Mapping[str, float]] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inches": 0.0254}
"""Lengths of the units of motion captures [m]."""
_FASTEST: Final = 1e5
"""Highest rate of frames [Hz]."""
_LAST_SECOND: Final = 2**31
"""End of the stamps that a message of ROS holds [s]."""

Poses = Callable[[slice], tuple[Array, Array]]
"""Returns positions (m, 3) [m] and attitudes (m, 4) of some frames."""


class Segment(NamedTuple):
    """One rigid part of a body."""

    name: str
    """Name in the file."""
    t_ns: Times
    """(n,) times of its poses since the start of the file."""
    poses: Poses
    """Returns the poses of a slice of its rows."""
    label: str = ""
    """Another name that it has in the file."""
    remarks: tuple[str, ...] = ()
    """Lines about its axes and missing poses."""


def axes_sentence(axis: str) -> str:
    """Return a sentence that names the axes of the file that become x, y and z here."""
    texts = []
    for row in upright(axis):
        index = int(np.flatnonzero(row)[0])
        texts.append(("-" if row[index] < 0.0 else "") + AXES[index])
    return f"{axis} is up: x, y, z are its {', '.join(texts)}"


def convert_to_z_up(position: Array, q_file: Array, axis: str, unit: float) -> tuple[Array, Array]:
    """Return positions (n, 3) [m] and attitudes (n, 4) in a world with z up.

    :param position: (n, 3) in units of the file.
    :param q_file: (n, 4) attitudes of the segment's axes in the file.
    :param axis: axis of the file that points up, as for
        :func:`imu_sim_ros.core.rotation.upright`.
    :param unit: length of the unit [m].
    """
    matrix = upright(axis)
    vectors = q_file[:, 1:] @ matrix.T
    return unit * position @ matrix.T, np.column_stack([q_file[:, 0], vectors])


def frame_times(count: int, rate: float) -> Times:
    """Return the times of frames since the first one (n,) [ns].

    :param rate: frames per second [Hz].
    :raises InputError: for a rate that is none, and times beyond those of a message.
    """
    if not (LOWEST_RATE <= rate <= _FASTEST) or count / rate >= _LAST_SECOND:
        raise InputError(f"damaged: {count} frames at {rate:g} Hz")
    return sample_times_ns(0, count, rate)


def streams(segments: Sequence[Segment]) -> list[LogStream]:
    """Return a topic of PoseStamped for each segment; equal names get numbers.

    A topic is also found by the segment's name in the file.
    """
    topics: dict[str, LogStream] = {}
    for segment in segments:
        plain = f"/{ros_name(segment.name)}"
        name = next(
            candidate
            for candidate in (plain, *(f"{plain}_{k}" for k in range(2, len(segments) + 2)))
            if candidate not in topics
        )
        topics[name] = stream(name, segment)
    return [*topics.values()]


def stream(name: str, segment: Segment) -> LogStream:
    """Return the topic of a segment.

    :param name: name of the topic, with a slash.
    """
    encoder = PoseStampedEncoder(WORLD_FRAME)

    def encode(rows: slice) -> Bytes:
        position, q_wb = segment.poses(rows)
        return encoder.encode(segment.t_ns[rows], position, normalise(q_wb))

    return LogStream(
        name, POSE_STAMPED, segment.t_ns, encode, (segment.name, segment.label), segment.remarks
    )
