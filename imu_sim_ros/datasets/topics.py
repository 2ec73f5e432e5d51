# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation in a bag, or the columns of a dataset.

One home for ``generate``, the public interface and campaigns.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from imu_sim_ros.bags import Block, Topic, Writer, amount, described
from imu_sim_ros.bags.text import Dataset, States
from imu_sim_ros.config import SimulationParameters
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.sensor import ImuBlock
from imu_sim_ros.topics import TYPES, Encode, delivered, encoder


class BagTarget:
    """Blocks of samples into a bag."""

    def __init__(
        self, writer: Writer, parameters: SimulationParameters, names: Mapping[str, str]
    ) -> None:
        """Make the topics.

        :param names: for each topic of TYPES that is written its name in the bag.
        """
        self.writer = writer
        self._parameters = parameters
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

    def described(self) -> str:
        """Return how much was written."""
        return described(topic for topic, _ in self._topics)

    @property
    def files(self) -> list[Path]:
        """The files of the bag."""
        path = self.writer.path
        return list(path.iterdir()) if path.is_dir() else self.writer.files

    def write(self, block: ImuBlock) -> None:
        """Write the messages of a block."""
        made = [(topic, encode(block, self._parameters)) for topic, encode in self._topics]
        self.writer.write_blocks([Block(topic, m.t_ns, m.payloads) for topic, m in made])


class DatasetTarget:
    """Blocks of samples into text."""

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.files: Sequence[Path] = ()

    def described(self) -> str:
        """Return how much was written."""
        return amount(self.dataset.rows, self.dataset.last_ns, "rows")

    @property
    def counts(self) -> dict[str, int]:
        """Rows by topic."""
        files = {IMU_TOPIC: self.dataset.imu, TRUTH_TOPIC: self.dataset.truth}
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
    names = list(topics) or ([IMU_TOPIC] if imu_only else [IMU_TOPIC, TRUTH_TOPIC])
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
