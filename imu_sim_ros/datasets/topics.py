# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation in a bag, or the columns of a dataset.

One home for ``generate``, the public interface and campaigns.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from imu_sim_ros.bags.text.writer import WITH_TABLES, BodyStates, Dataset
from imu_sim_ros.bags.writer import BagTopic, Block, Writer, amount, described
from imu_sim_ros.conventions import (
    IMU_TOPIC,
    TRUTH_TOPIC,
)
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.names import unknown
from imu_sim_ros.sensors import auxiliary_sensors
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.declaration import Sensor
from imu_sim_ros.sensors.registry import find_sensor
from imu_sim_ros.simulation.parameters import SampledParameters, carried
from imu_sim_ros.simulation.playback import BODY
from imu_sim_ros.simulation.topics import (
    MOUNTINGS,
    OF_A_BAG,
    OF_THE_BODY,
    TYPES,
    Encode,
    delivered,
    encoder,
    mountings,
    sensors_of,
    topics_of,
    types,
)
from imu_sim_ros.types import Array, Integers

Blocks = Mapping[str, ImuBlock]
"""Blocks of the simulations of one body by name; a single IMU has an empty name."""
SINGLE = ("",)
"""The names of the IMUs if there is one only."""


def _tables(further: Iterable[str] = ()) -> dict[str, Sensor]:
    """Return the auxiliary sensors by the topic that has a table of its own in a dataset.

    :param further: names of sensors of the body.
    """
    known = (*auxiliary_sensors(), *map(find_sensor, further))
    return {sensor.topics[0].name: sensor for sensor in known}


class _Output(NamedTuple):
    topic: BagTopic
    simulation: str
    parameters: SampledParameters
    encode: Encode


class BagTarget:
    """Blocks of samples into a bag."""

    def __init__(
        self,
        writer: Writer,
        parameters: Mapping[str, SampledParameters],
        names: Mapping[str, str],
    ) -> None:
        """Make the topics.

        :param parameters: of each simulation, by name.
        :param names: for each topic of :func:`offered` that is written its name in the bag.
        """
        self.writer = writer
        simulated = imus_of(parameters)
        self.body = body_of(simulated)
        further = tuple(carried(parameters[self.body]))
        sources, known = offered(simulated, further), types(further)
        self.world_frame = parameters[self.body].world_frame
        self.fastest = max(simulation.rate for simulation in parameters.values())
        self._outputs = [
            _Output(
                writer.add_topic(resolved(name), known[key]),
                simulation,
                parameters[simulation],
                self._encoder(key, parameters, simulation),
            )
            for (simulation, key), name in ((sources[full], name) for full, name in names.items())
        ]

    def _encoder(
        self, key: str, parameters: Mapping[str, SampledParameters], simulation: str
    ) -> Encode:
        if key == MOUNTINGS:  # one message for all sensors
            imus = [one for name, one in parameters.items() if name != BODY]
            return mountings(imus, parameters[self.body], self.writer.encoding)
        return encoder(key, parameters[simulation], self.writer.encoding)

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

    def write(self, blocks: Blocks) -> None:
        """Write the messages of a window of time, all topics in order."""
        self.writer.write_blocks(self.messages(blocks))

    def messages(self, blocks: Blocks) -> list[Block]:
        """Return the messages of a window of time, by topic."""
        made = [
            (topic, encode(blocks[name], parameters))
            for topic, name, parameters, encode in self._outputs
            if name in blocks
        ]
        return [Block(topic, m.t_ns, m.payloads) for topic, m in made if len(m.t_ns)]


class DatasetTarget:
    """Blocks of samples into text."""

    def __init__(
        self, dataset: Dataset, imus: Sequence[str] = SINGLE, further: Sequence[str] = ()
    ) -> None:
        """Join simulations with the files of a dataset.

        :param imus: the names of the IMUs: imu0, imu1, ... of the dataset.
        :param further: names of the sensors of the body.
        """
        self._tables = {one.table.name: one for one in _tables(further).values()}
        self._further = tuple(further)
        self.dataset = dataset
        self.files: Sequence[Path] = ()
        self._imus = tuple(imus)
        # EuRoC's states hold biases: each IMU has its own. Poses alone are the body's.
        self._states = self._imus if dataset.form == "euroc" else (body_of(imus),)

    def described(self) -> str:
        """Return how much was written."""
        return amount(self.dataset.rows, self.dataset.last_ns, "rows")

    @property
    def counts(self) -> dict[str, int]:
        """Rows by topic."""
        readings = zip(self._imus, self.dataset.imus, strict=False)  # a TUM file has none
        states = zip(self._states, self.dataset.truths, strict=False)
        return {
            **{resolved(f"{name}/{IMU_TOPIC}"): file.rows for name, file in readings},
            **{resolved(f"{_space(name)}{TRUTH_TOPIC}"): file.rows for name, file in states},
            **{
                resolved(
                    f"{_space(self._of(kind, k))}{self._tables[kind].topics[0].name}"
                ): file.rows
                for (kind, k), file in self.dataset.tables.items()
            },
        }

    def write(self, blocks: Blocks) -> None:
        """Write the rows of a window of time."""
        for k, name in enumerate(self._imus[: len(self.dataset.imus)]):
            if name in blocks:
                self.dataset.write_imu(*delivered(blocks[name]), k)
        for kind, k in self.dataset.tables:
            name = self._of(kind, k)
            if name in blocks:
                self.dataset.write_table(kind, k, *_rows(self._tables[kind], blocks[name]))
        for k, name in enumerate(self._states[: len(self.dataset.truths)]):
            if name in blocks:
                self.dataset.write_states(_states(blocks[name]), k)

    def _of(self, kind: str, k: int) -> str:
        """Return the name of the simulation that a table is from."""
        return body_of(self._imus) if self._tables[kind].name in self._further else self._imus[k]


def _states(block: ImuBlock) -> BodyStates:
    motion = block.motion
    return BodyStates(
        block.true_t_ns,
        motion.position,
        motion.q_wb,
        motion.velocity,
        block.gyro_bias,
        block.accel_bias,
    )


def _rows(sensor: Sensor, block: ImuBlock) -> tuple[Integers, Array]:
    """Return stamps (n,) and values (n, m) of the samples of a sensor."""
    read = block.auxiliary[sensor.quantity]
    return read.t_ns[read.delivered], sensor.values(read)[read.delivered]


def in_tables(
    names: Iterable[str], form: str, imus: Sequence[str] = SINGLE, further: Sequence[str] = ()
) -> list[tuple[Table, int]]:
    """Return the tables that sensors have in a dataset, each with the number of the IMU.

    :param names: of topics that are written.
    :param further: names of the sensors of the body; their tables have the number 0.
    :raises InputError: with a line for each topic that the form does not have.
    """
    known, having, tables, unfit = offered(imus, further), _tables(further), [], []
    for name in names:
        imu, key = known[name]
        if key in having and form in WITH_TABLES:
            tables.append((having[key].table, list(imus).index(imu) if imu in imus else 0))
        elif key not in (IMU_TOPIC, TRUTH_TOPIC):
            unfit.append(f"topic {name}: does not exist in {form}")
    if unfit:
        raise InputError(unfit)
    return tables


def usual_topics(further: Iterable[str], form: str | None, path: Path, imu_only: bool) -> list[str]:
    """Return the topics of sensors of the body that are written if none is named.

    :param form: of a dataset, which has tables of readings; None: of a bag, which has all
        but those of packages that need not be installed.
    :param imu_only: leave out the truth.
    """
    if form is not None and (form not in WITH_TABLES or path.suffix.lower() == ".csv"):
        return []
    if form is not None:
        return [topics_of(name)[0].name for name in further]
    topics = [topic for name in further for topic in topics_of(name) if not topic.foreign]
    return [topic.name for topic in topics if not (imu_only and topic.truth)]


def resolved(name: str) -> str:
    """Return a topic's name with its slash, as bags have it."""
    return "/" + name.lstrip("/")


def imus_of(simulations: Mapping[str, object]) -> list[str]:
    """Return the names of the IMUs among simulations of one body."""
    return [name for name in simulations if name != BODY]


def body_of(imus: Sequence[str]) -> str:
    """Return the name of the simulation that provides the truth of IMUs."""
    return "" if tuple(imus) == SINGLE else BODY


def _space(name: str) -> str:
    """Return the namespace of a simulation's topics."""
    return "" if name in ("", BODY) else f"{name}/"


def offered(
    imus: Sequence[str] = SINGLE, further: Iterable[str] = ()
) -> dict[str, tuple[str, str]]:
    """Return all topics as the simulator node names them: each one's simulation and own name.

    Several IMUs have a namespace each; the body's motion is the truth of all.

    :param further: names of the sensors of the body.
    """
    body = body_of(imus)
    own = {
        f"{_space(name)}{key}": (name, key)
        for name in imus
        for key in TYPES
        if key not in OF_THE_BODY
    }
    of_body = (
        *OF_THE_BODY,
        *OF_A_BAG,
        *(topic.name for name in further for topic in topics_of(name)),
    )
    return {**own, **{key: (body, key) for key in of_body}}


def sensors(
    names: Iterable[str], imus: Sequence[str] = SINGLE, further: Sequence[str] = ()
) -> dict[str, frozenset[str]]:
    """Return the other sensors to read for each IMU, by name, for topics of :func:`offered`.

    :param further: names of the sensors of the body.
    """
    known = offered(imus, further)
    pairs = [known[name] for name in names if name in known]
    every = dict.fromkeys([*imus, body_of(imus)])
    return {imu: sensors_of((key for name, key in pairs if name == imu), further) for imu in every}


def chosen_topics(
    topics: Sequence[str],
    imu_only: bool,
    renamed: Mapping[str, str],
    imus: Sequence[str] = SINGLE,
    more: Iterable[str] = (),
    further: Sequence[str] = (),
) -> dict[str, str]:
    """Return the topics to write, each with its name in the bag.

    :param topics: a name without a namespace selects that topic of every IMU.
    :param imus: the names of the IMUs.
    :param more: topics in addition to those of the IMUs and the body: of cameras.
    :param further: names of the sensors of the body.
    :raises InputError: with a line for every name that is unknown or given twice.
    """
    more, known = tuple(more), offered(imus, further)
    wanted = list(topics) or [IMU_TOPIC, *([] if imu_only else [TRUTH_TOPIC]), *more]
    names: list[str] = []
    for name in (name.strip().lstrip("/") for name in wanted):
        of_all = [full for full, (_, key) in known.items() if key == name and full != name]
        names += of_all if of_all else [name]
    problems = list(_topic_problems(names, renamed, tuple(dict.fromkeys((*known, *more)))))
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
