"""What ``generate`` writes: the topics of a simulation as messages, or the columns of a dataset."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.container import Block, Topic, Writer
from imu_sim_ros.bags.encode import (
    IMU,
    ODOMETRY,
    TEMPERATURE,
    VECTOR3_STAMPED,
    ImuEncoder,
    OdometryEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.bags.text_writer import Dataset, States
from imu_sim_ros.config.simulation import SimulationParameters
from imu_sim_ros.errors import InputError
from imu_sim_ros.rotation import rotate_inverse
from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.variance import accel_variance_discrete, gyro_variance_discrete

READINGS: Final = "imu/data_raw"
TRUTH: Final = "ground_truth/odom"
TYPES: Final[dict[str, str]] = {
    READINGS: IMU,
    TRUTH: ODOMETRY,
    "ground_truth/imu": IMU,
    "ground_truth/gyroscope_bias": VECTOR3_STAMPED,
    "ground_truth/accelerometer_bias": VECTOR3_STAMPED,
    "imu/temperature": TEMPERATURE,
}

Encode = Callable[[ImuBlock], tuple[NDArray[np.int64], NDArray[np.uint8]]]


def encoder(name: str, parameters: SimulationParameters, encoding: str) -> Encode:
    """Return what turns a block into the record times and messages of a topic.

    Readings have the stamps of the sensor's clock, and only delivered ones are written; everything
    else has the true times.
    """
    if name == READINGS:
        return _readings(parameters, encoding)
    if name == TRUTH:
        return _truth(parameters, encoding)
    frame = parameters.imu_frame
    if name == "ground_truth/imu":
        ideal = ImuEncoder(frame, encoding)
        return lambda b: (
            b.true_t_ns,
            ideal.encode(b.true_t_ns, b.ideal_gyro, b.ideal_accel),
        )
    if name == "imu/temperature":
        thermometer = TemperatureEncoder(frame, encoding)
        return lambda b: (b.true_t_ns, thermometer.encode(b.true_t_ns, b.temperature))
    vectors = Vector3StampedEncoder(frame, encoding)
    if name == "ground_truth/gyroscope_bias":
        return lambda b: (b.true_t_ns, vectors.encode(b.true_t_ns, b.gyro_bias))
    return lambda b: (b.true_t_ns, vectors.encode(b.true_t_ns, b.accel_bias))


def _readings(parameters: SimulationParameters, encoding: str) -> Encode:
    readings = ImuEncoder(parameters.imu_frame, encoding)
    gyro = gyro_variance_discrete(parameters.imu, parameters.rate)
    accel = accel_variance_discrete(parameters.imu, parameters.rate)

    def encode(block: ImuBlock) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        t_ns, w, f = delivered(block)
        return t_ns, readings.encode(t_ns, w, f, gyro, accel)

    return encode


def _truth(parameters: SimulationParameters, encoding: str) -> Encode:
    odometry = OdometryEncoder(parameters.world_frame, parameters.body_frame, encoding)

    def encode(block: ImuBlock) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        motion, t_ns = block.motion, block.true_t_ns
        velocity_b = rotate_inverse(motion.q_wb, motion.velocity)
        return t_ns, odometry.encode(
            t_ns, motion.position, motion.q_wb, velocity_b, motion.angular_velocity
        )

    return encode


def delivered(
    block: ImuBlock,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return stamps, angular rates and specific forces of the readings that are delivered."""
    rows = block.delivered
    if len(rows) == len(block.t_ns) and bool(np.array_equal(rows, np.arange(len(rows)))):
        return block.t_ns, block.gyro, block.accel
    return block.t_ns[rows], block.gyro[rows], block.accel[rows]


class BagTarget:
    """Blocks of samples into a bag."""

    def __init__(
        self, writer: Writer, parameters: SimulationParameters, names: Mapping[str, str]
    ) -> None:
        """Make the topics.

        :param names: for each topic of TYPES that is written its name in the bag.
        """
        self.writer = writer
        self._topics: list[tuple[Topic, Encode]] = [
            (
                writer.add_topic(resolved(name), TYPES[key]),
                encoder(key, parameters, writer.encoding),
            )
            for key, name in names.items()
        ]

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic."""
        return {topic.name: topic.count for topic, _ in self._topics}

    @property
    def files(self) -> list[Path]:
        """The files of the bag."""
        path = self.writer.path
        return list(path.iterdir()) if path.is_dir() else self.writer.files

    def write(self, block: ImuBlock) -> None:
        """Write the messages of a block."""
        blocks = [Block(topic, *encode(block)) for topic, encode in self._topics]
        self.writer.write_blocks(blocks)


class DatasetTarget:
    """Blocks of samples into text."""

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.files: Sequence[Path] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Rows by topic."""
        files = {READINGS: self.dataset.imu, TRUTH: self.dataset.truth}
        return {resolved(name): file.rows for name, file in files.items() if file is not None}

    def write(self, block: ImuBlock) -> None:
        """Write the rows of a block."""
        if self.dataset.imu is not None:
            self.dataset.write_imu(*delivered(block))
        if self.dataset.truth is not None:
            motion = block.motion
            self.dataset.write_states(
                States(
                    block.true_t_ns,
                    motion.position,
                    motion.q_wb,
                    motion.velocity,
                    block.gyro_bias,
                    block.accel_bias,
                )
            )


def resolved(name: str) -> str:
    """Return a topic's name with its slash, as bags have it."""
    return "/" + name.lstrip("/")


def chosen_topics(
    topics: Sequence[str], imu_only: bool, renamed: Mapping[str, str]
) -> dict[str, str]:
    """Return the topics to write, each with its name in the bag.

    :raises InputError: with a line for every name that is unknown or stands twice.
    """
    names = list(topics) or ([READINGS] if imu_only else [READINGS, TRUTH])
    names = [name.strip().lstrip("/") for name in names]
    problems = list(_topic_problems(names, renamed))
    if problems:
        raise InputError(problems)
    return {name: renamed.get(name, name) for name in names}


def _topic_problems(names: Sequence[str], renamed: Mapping[str, str]) -> Iterator[str]:
    for name in [*names, *renamed]:
        if name not in TYPES:
            yield f"topic {name}: must be one of {', '.join(TYPES)}"
    for name in set(names):
        if names.count(name) > 1:
            yield f"topic {name}: given twice"
    final = [resolved(renamed.get(name, name)) for name in dict.fromkeys(names)]
    for name in dict.fromkeys(final):
        if final.count(name) > 1:
            yield f"topic {name}: two topics would have this name"
