# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation in a bag, or the columns of a dataset.

One home for ``generate``, the public interface and campaigns.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.schemas import LATCHED
from imu_sim_ros.bags.text.writer import WITH_TABLES, BodyStates, Dataset
from imu_sim_ros.bags.writer import BagTopic, Block, Writer, amount, described
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.names import unknown
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.deferred import Results
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import imus_in
from imu_sim_ros.simulation.topics import (
    MOUNTS,
    Encode,
    Messages,
    Offered,
    delivered,
    delivered_rows,
    is_published,
    offered,
)

Read = Mapping[str, Any]
"""Samples of the sensors of one body in a window of time, by name."""


class _Output(NamedTuple):
    topic: BagTopic
    sensor: str
    valid: Any
    encode: Encode


class BagTarget:
    """Samples into a bag; use as a context manager.

    What threads make of a window is written with the window after it, so that they never wait.
    """

    def __init__(
        self, writer: Writer, sensors: Mapping[str, Mounted], names: Mapping[str, str]
    ) -> None:
        """Make the topics.

        :param sensors: of the body.
        :param names: for each topic of the sensors that is written its name in the bag.
        """
        self.writer = writer
        known = offered(sensors)
        self.world_frame = sensors[POSE].environment.world_frame
        self.fastest = max(one.environment.rate for one in sensors.values())
        self._outputs = []
        for full, name in names.items():
            sensor, mounted, topic = known[full]
            qos = [LATCHED] if topic.latched else None
            made = writer.add_topic(resolved(name), topic.type, qos)
            encode = known[full].encoder(writer.encoding)
            self._outputs.append(_Output(made, sensor, mounted.valid, encode))
        self._waiting: deque[list[tuple[BagTopic, Messages]]] = deque()

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic."""
        return {output.topic.name: output.topic.count for output in self._outputs}

    def described(self) -> str:
        """Return how much was written."""
        return described(output.topic for output in self._outputs)

    @property
    def files(self) -> list[Path]:
        """The files of the bag."""
        path = self.writer.path
        return list(path.iterdir()) if path.is_dir() else self.writer.files

    def write(self, read: Read) -> None:
        """Write the messages of a window of time, all topics in order."""
        made = [(topic, encode(read[name], valid)) for topic, name, valid, encode in self._outputs]
        self._waiting.append([(topic, each) for topic, each in made if len(each.t_ns)])
        under_way = any(isinstance(each.payloads, Results) for _, each in made)
        while len(self._waiting) > under_way:
            self._put()

    def _put(self) -> None:
        """Write the messages of the first window that waits."""
        made = self._waiting.popleft()
        self.writer.write_blocks([Block(t, each.t_ns, each.made()) for t, each in made])

    def __enter__(self) -> "BagTarget":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        while self._waiting and error is None:
            self._put()


class InTable(NamedTuple):
    """The rows of a sensor in a dataset."""

    table: Table
    number: int
    """Of its IMU among the IMUs, or among the sensors of its kind."""
    name: str
    mounted: Mounted


def all_tables(sensors: Mapping[str, Mounted]) -> list[InTable]:
    """Return the tables of the sensors that have one of their own in a dataset."""
    numbers: Counter[str] = Counter()
    found = []
    for name, one in sensors.items():
        table = one.sensor.table
        if table is not None:
            found.append(InTable(table, numbers[table.name], name, one))
            numbers[table.name] += 1
    return found


class DatasetTarget:
    """Samples into text."""

    def __init__(self, dataset: Dataset, sensors: Mapping[str, Mounted], seen: Any = None) -> None:
        """Join the sensors of a body with the files of a dataset.

        :param sensors: its IMUs are imu0, imu1, ... of the dataset.
        :param seen: the files of what sensors see, tracks or images; None: it has none.
        """
        self.dataset, self._sensors, self._seen = dataset, sensors, seen
        self.files: Sequence[Path] = ()
        self._imus = imus_in(sensors)
        self._tables = {(one.table.name, one.number): one for one in all_tables(sensors)}
        # EuRoC's states hold biases: each IMU has its own. Poses alone are the body's.
        self._states = self._imus if dataset.form == "euroc" else [POSE]

    def described(self) -> str:
        """Return how much was written, and of what each camera saw."""
        rows = amount(self.dataset.rows, self.dataset.last_ns, "rows")
        return rows if self._seen is None else f"{rows}, {self._seen.described()}"

    @property
    def counts(self) -> dict[str, int]:
        """Rows by topic, images by camera."""
        readings = zip(self._imus, self.dataset.imus, strict=False)  # a TUM file has none
        states = zip(self._states, self.dataset.truths, strict=False)
        tables = ((self._tables[key], file) for key, file in self.dataset.tables.items())
        return {
            **{resolved(self._sensors[name].space + IMU_TOPIC): f.rows for name, f in readings},
            **{resolved(self._sensors[name].space + TRUTH_TOPIC): f.rows for name, f in states},
            **{
                resolved(f"{one.mounted.space}{one.mounted.sensor.topics[0].name}"): file.rows
                for one, file in tables
            },
            **({} if self._seen is None else self._seen.counts),
        }

    def write(self, read: Read) -> None:
        """Write the rows of a window of time, and what is seen in it."""
        for k, name in enumerate(self._imus[: len(self.dataset.imus)]):
            self.dataset.write_imu(*delivered(read[name]), k)
        for kind, k in self.dataset.tables:
            _, _, name, mounted = self._tables[kind, k]
            samples, rows = read[name], delivered_rows(read[name])
            self.dataset.write_table(
                kind, k, samples.t_ns[rows], mounted.sensor.values(samples)[rows]
            )
        for k, name in enumerate(self._states[: len(self.dataset.truths)]):
            self.dataset.write_states(_states(read[name]), k)
        if self._seen is not None:
            self._seen.write(read)


def _states(read: Any) -> BodyStates:
    """Return the true states at the samples of an IMU, or of the pose, which has no biases."""
    t_ns = read.true_t_ns
    motion, none = read.values.get("motion", read), np.zeros((len(t_ns), 3))
    biases = (read.values.get(name, none) for name in ("gyro_bias", "accel_bias"))
    return BodyStates(t_ns, motion.position, motion.q_wb, motion.velocity, *biases)


def in_tables(
    names: Iterable[str], form: str, sensors: Mapping[str, Mounted]
) -> list[tuple[Table, int]]:
    """Return the tables that sensors have in a dataset, each with the number of the IMU.

    :param names: of topics that are written.
    :raises InputError: with a line for each topic that the form does not have.
    """
    having = {
        f"{one.mounted.space}{one.mounted.sensor.topics[0].name}": one
        for one in all_tables(sensors)
    }
    known, tables, unfit = offered(sensors), [], []
    for name in names:
        if name in having and form in WITH_TABLES:
            tables.append((having[name].table, having[name].number))
        elif known[name].topic.name not in (IMU_TOPIC, TRUTH_TOPIC):
            unfit.append(f"topic {name}: does not exist in {form}")
    if unfit:
        raise InputError(unfit)
    return tables


def usual_topics(
    sensors: Mapping[str, Mounted], form: str | None, path: Path, imu_only: bool
) -> list[str]:
    """Return the topics that are written if none is named: those that a node usually publishes.

    :param form: of a dataset, which has tables of readings; None: of a bag, which has all
        but those of packages that need not be installed.
    :param imu_only: leave out the truth.
    """
    usual = SimulatorParameters().publish
    in_text = form is not None
    tables = in_text and form in WITH_TABLES and path.suffix.lower() != ".csv"

    def written(one: Offered) -> bool:
        sensor, own_files = one.mounted.sensor, one.mounted.sensor.companions
        if form in sensor.datasets:
            return False  # it has a place of its own there
        if in_text and sensor.table is None and own_files and own_files.suffixes(one.mounted.own):
            return False  # they hold what a dataset has no place for
        if in_text and sensor.table is not None and not (tables and one.topic is sensor.topics[0]):
            return False
        return not (one.topic.foreign or (imu_only and one.topic.truth))

    known = offered(sensors).items()
    found = [name for name, one in known if is_published(one.topic, usual) and written(one)]
    if not in_text and any(one.sensor.sees and not one.sensor.apart for one in sensors.values()):
        found.append(MOUNTS)  # who places points in the world needs them; stacks of cameras do not
    return found


def resolved(name: str) -> str:
    """Return a topic's name with its slash, as bags have it."""
    return "/" + name.lstrip("/")


def chosen_topics(
    topics: Sequence[str],
    renamed: Mapping[str, str],
    sensors: Mapping[str, Mounted],
    usual: Iterable[str],
) -> dict[str, str]:
    """Return the topics to write, each with its name in the bag.

    :param topics: one without its namespace selects the topic of every IMU; none: the usual ones.
    :raises InputError: with a line for every name that is unknown or given twice.
    """
    known = offered(sensors)
    wanted = list(topics) or list(usual)
    names: list[str] = []
    for name in (name.strip().lstrip("/") for name in wanted):
        of_all = [full for full, one in known.items() if one.topic.name == name]
        names += of_all if of_all and name not in known else [name]
    problems = list(_topic_problems(names, renamed, tuple(known)))
    if problems:
        raise InputError(problems)
    return {name: renamed.get(name, name) for name in names}


def _topic_problems(
    names: Sequence[str], renamed: Mapping[str, str], known: Sequence[str]
) -> Iterator[str]:
    for name in [*names, *renamed]:
        if name not in known:
            yield unknown("topic", name, known)
    for name in set(names):
        if names.count(name) > 1:
            yield f"topic {name}: given twice"
    final = [resolved(renamed.get(name, name)) for name in dict.fromkeys(names)]
    for name in dict.fromkeys(final):
        if final.count(name) > 1:
            yield f"topic {name}: two topics would have this name"
