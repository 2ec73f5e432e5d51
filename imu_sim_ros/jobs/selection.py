# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of all jobs that read readings: topics, frame and units."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Final, TypeAlias

from imu_sim_ros.core import arguments
from imu_sim_ros.core.conventions import ACCEL_UNITS, GYRO_UNITS
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.terminal.signatures import Heading, Text

Selection: TypeAlias = tuple[str | None, str | None, str | None, str | None, str | None]
"""Frame, gyroscope's and accelerometer's topic, gyroscope's and accelerometer's unit."""
NOTHING: Final[Selection] = (None, None, None, None, None)
READINGS: Final = Heading("readings")
Frame = Annotated[
    str | None,
    "--frame FRAME",
    Text("frame of the readings, if a topic carries several IMUs"),
    READINGS,
]
GyroTopic = Annotated[
    str | None,
    "--gyro-topic TOPIC",
    Text("topic of the gyroscope, if the accelerometer has another one"),
    READINGS,
]
AccelTopic = Annotated[
    str | None,
    "--accel-topic TOPIC",
    Text("topic of the accelerometer, interpolated to the times of the gyroscope"),
    READINGS,
]
GyroUnit = Annotated[
    str | None,
    "--gyro-unit",
    tuple(GYRO_UNITS),
    Text("unit of the gyroscope in the input (default: rad/s, or that of a table's header)"),
    READINGS,
]
AccelUnit = Annotated[
    str | None,
    "--accel-unit",
    tuple(ACCEL_UNITS),
    Text("unit of the accelerometer in the input (default: m/s^2, or that of a table's header)"),
    READINGS,
]


def input_lines(notes: Sequence[str]) -> Iterator[str]:
    """Yield the notes of readings as lines of a result's text."""
    return (f"input: {note}" for note in notes)


def check_choice(
    topic: str | None,
    frame: str | None,
    gyro_topic: str | None,
    accel_topic: str | None,
    gyro_unit: str | None,
    accel_unit: str | None,
    *,
    of_a_file: bool,
    topic_name: str = "topic",
) -> Choice:
    """Return the checked choice of topics, frame and units that are read from a file.

    :param of_a_file: True if the readings are in a file; else nothing can be chosen.
    :param topic_name: name of the argument that is the topic.
    :raises ConfigurationError: for an argument that is no name, no known unit, or contradicts
        another one.
    """
    topic = arguments.topic(topic_name, topic, of_a_file=of_a_file)
    gyro_topic = arguments.topic("gyro_topic", gyro_topic, of_a_file=of_a_file)
    accel_topic = arguments.topic("accel_topic", accel_topic, of_a_file=of_a_file)
    if (gyro_topic is None) != (accel_topic is None):
        name = "gyro_topic" if gyro_topic is None else "accel_topic"
        arguments.refuse(name, None, "a topic, as the other triad has one")
    if topic is not None and gyro_topic is not None:
        arguments.refuse(topic_name, topic, "omitted beside gyro_topic and accel_topic")
    if frame is not None:
        frame = arguments.text("frame", frame, "a name")
    if gyro_unit is not None:
        arguments.choice("gyro_unit", gyro_unit, tuple(GYRO_UNITS))
    if accel_unit is not None:
        arguments.choice("accel_unit", accel_unit, tuple(ACCEL_UNITS))
    chosen = {"frame": frame, "gyro_unit": gyro_unit, "accel_unit": accel_unit}
    for name, value in chosen.items() if not of_a_file else ():
        if value is not None:
            arguments.refuse(name, value, "omitted: the readings are not in a file")
    return Choice(topic, gyro_topic, accel_topic, frame, gyro_unit, accel_unit)
