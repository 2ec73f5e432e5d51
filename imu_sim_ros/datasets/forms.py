# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The forms in which the samples of a body are written: bags, and datasets of text and images.

One home for ``generate``, the public interface and campaigns.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.bags.messages.schemas import LATCHED
from imu_sim_ros.bags.text.writer import FORMATS as TEXT_FORMATS
from imu_sim_ros.bags.text.writer import WITH_TABLES, Dataset
from imu_sim_ros.bags.writer import (
    AS_NAMED,
    BagOptions,
    BagTopic,
    Block,
    Writer,
    amount,
    described,
    open_writer,
)
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.names import unknown
from imu_sim_ros.records import States
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.deferred import Results
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import all_tables, imus_in
from imu_sim_ros.simulation.topics import (
    MOUNTS,
    Encode,
    Messages,
    Offered,
    Read,
    delivered,
    delivered_rows,
    offered,
    published,
    resolved,
)
from imu_sim_ros.types import Array

Warn = Callable[[str], object]
"""Receives a warning."""
OF_WHAT_IS_SEEN: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
FORMATS: Final = (*TEXT_FORMATS, *OF_WHAT_IS_SEEN)
"""All datasets."""


def check_form(form: str | None, path: Path, sensors: Mapping[str, Mounted]) -> None:
    """Refuse cameras and IMUs if a form has no place for them, and a form that needs some.

    :raises InputError: with what to give.
    """
    imus = len(imus_in(sensors))
    seeing = [o.sensor for o in sensors.values() if o.sensor.sees and o.sensor.datasets]
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: has room for one IMU, not {imus}")
    if form is not None and seeing:
        forms = seeing[0].datasets
        if form not in forms or path.suffix == ".csv":
            raise InputError(f"cameras: need a bag, or a folder and --format {', '.join(forms)}")
    if not seeing and form in OF_WHAT_IS_SEEN:
        raise InputError(f"format {form}: needs a camera; --camera names one")
    if form == "vio_data_simulation" and len(seeing) > 1:
        raise InputError(f"format {form}: has room for one camera, not {len(seeing)}")


def _usual_topics(
    sensors: Mapping[str, Mounted], form: str | None, path: Path, imu_only: bool
) -> list[str]:
    """Return the topics that are written if none is named: those that a node usually publishes.

    A dataset has tables of readings; a bag has all but those of packages that need not be
    installed.
    """
    in_text = form is not None
    tables = in_text and form in WITH_TABLES and path.suffix.lower() != ".csv"
    found = []
    for name, one in published(sensors, SimulatorParameters().publish).items():
        topic, sensor, own_files = one.topic, one.mounted.sensor, one.mounted.sensor.companions
        if topic.foreign or (imu_only and topic.truth):
            continue
        if form in sensor.datasets:
            continue  # it has a place of its own there
        if in_text and sensor.table is None and own_files and own_files.suffixes(one.mounted.own):
            continue  # they hold what a dataset has no place for
        if in_text and sensor.table is not None and not (tables and topic is sensor.topics[0]):
            continue
        found.append(name)
    if not in_text and any(one.sensor.sees and not one.sensor.apart for one in sensors.values()):
        found.append(MOUNTS)  # who places points in the world needs them; stacks of cameras do not
    return found


ALL: Final = "all"
"""Name that stands for every topic that is offered."""


def _is_made(one: Offered) -> bool:
    """Return whether a topic has messages with the parameters of its sensor."""
    try:
        one.encoder()
    except ConfigurationError:
        return False
    return True


def chosen_topics(
    sensors: Mapping[str, Mounted],
    form: str | None,
    path: Path,
    topics: Sequence[str] = (),
    renamed: Mapping[str, str] = MappingProxyType({}),
    imu_only: bool = False,
) -> dict[str, str]:
    """Return the topics to write, each with its name in the bag.

    :param form: of a dataset; None: of a bag.
    :param topics: one without its namespace selects the topic of every IMU; ``all``: every one;
        empty: the usual ones.
    :param imu_only: leave out the truth from the usual ones.
    :raises InputError: with a line for every name that is unknown or given twice.
    """
    known = offered(sensors)
    names: list[str] = []
    wanted: Sequence[str] = topics or _usual_topics(sensors, form, path, imu_only)
    if ALL in topics:
        if len(topics) > 1:
            raise InputError(f"topics = {', '.join(topics)}: {ALL} stands for every topic, alone")
        wanted = [name for name, one in known.items() if _is_made(one)]
    for name in (name.strip().lstrip("/") for name in wanted):
        of_all = [full for full, one in known.items() if one.topic.name == name]
        names += of_all if of_all and name not in known else [name]
    problems = [
        unknown("topic", name, tuple(known)) for name in [*names, *renamed] if name not in known
    ]
    problems += [f"topic {name}: given twice" for name in set(names) if names.count(name) > 1]
    final = [resolved(renamed.get(name, name)) for name in dict.fromkeys(names)]
    problems += [
        f"topic {name}: two topics would have this name"
        for name in dict.fromkeys(final)
        if final.count(name) > 1
    ]
    if problems:
        raise InputError(problems)
    return {name: renamed.get(name, name) for name in names}


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


class OpenOutput(Protocol):
    """An output, or a part of one, that receives the samples of a body."""

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic, rows by table, images by camera."""

    def described(self) -> str:
        """Return how much was written."""

    def write(self, read: Read) -> None:
        """Write the samples of a window of time."""


class _Output(NamedTuple):
    topic: BagTopic
    sensor: str
    valid: Any
    encode: Encode


class BagTarget:
    """Samples into a bag."""

    def __init__(
        self, writer: Writer, sensors: Mapping[str, Mounted], names: Mapping[str, str]
    ) -> None:
        """Make the topics.

        :param sensors: of the body.
        :param names: for each topic of the sensors that is written its name in the bag.
        """
        self._writer = writer
        known = offered(sensors)
        self._outputs = []
        for full, name in names.items():
            sensor, mounted, topic = known[full]
            qos = [LATCHED] if topic.latched else None
            made = writer.add_topic(resolved(name), topic.type, qos)
            encode = known[full].encoder(writer.encoding)
            self._outputs.append(_Output(made, sensor, mounted.valid, encode))
        self._waiting: list[tuple[BagTopic, Messages]] = []

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic."""
        return {output.topic.name: output.topic.count for output in self._outputs}

    def described(self) -> str:
        """Return how much was written."""
        return described(output.topic for output in self._outputs)

    def write(self, read: Read) -> None:
        """Write the messages of a window of time, all topics in order.

        What threads make of it is written with the window after it, so that they never wait.
        """
        made = [(topic, encode(read[name], valid)) for topic, name, valid, encode in self._outputs]
        self.finish()
        self._waiting = [(topic, each) for topic, each in made if len(each.record_t_ns)]
        if not any(isinstance(each.payloads, Results) for _, each in made):
            self.finish()

    def finish(self) -> None:
        """Write the messages that still wait for threads."""
        made, self._waiting = self._waiting, []
        self._writer.write_blocks([Block(t, each.record_t_ns, each.made()) for t, each in made])


class DatasetTarget:
    """Samples into text."""

    def __init__(
        self, dataset: Dataset, sensors: Mapping[str, Mounted], seen: OpenOutput | None
    ) -> None:
        """Join the sensors of a body with the files of a dataset.

        :param sensors: its IMUs are imu0, imu1, ... of the dataset.
        :param seen: the files of what sensors see, tracks or images; None: it has none.
        """
        self.dataset, self._sensors, self._seen = dataset, sensors, seen
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
            self.dataset.write_states(*_states(read[name]), k)
        if self._seen is not None:
            self._seen.write(read)


def _states(read: Any) -> tuple[States, Array | None]:
    """Return the true states at the samples of an IMU, and its biases (n, 6); None: of a pose."""
    motion = read.values.get("motion", read)
    states = States.unchecked(
        t_ns=read.true_t_ns, position=motion.position, q_wb=motion.q_wb, velocity=motion.velocity
    )
    if "gyro_bias" not in read.values:
        return states, None
    return states, np.concatenate([read.values["gyro_bias"], read.values["accel_bias"]], axis=1)


@contextmanager
def opened(
    form: str | None,
    output: Path,
    names: Mapping[str, str],
    sensors: Mapping[str, Mounted],
    world: World | None = None,
    jobs: int = 1,
    warn: Warn = lambda line: None,
    bag: BagOptions = AS_NAMED,
) -> Iterator[OpenOutput]:
    """Open an output for windows of samples; it is complete when the block ends without an error.

    :param form: of a dataset; None: a bag.
    :param names: for each topic of the sensors that is written its name in a bag.
    :param sensors: of the body.
    :param world: that sensors see, with threads that make images; None: none sees.
    :param jobs: number of these threads.
    """
    if form is None:
        with open_writer(output, bag) as writer:
            messages = BagTarget(writer, sensors, names)
            yield messages
            messages.finish()
    elif form == "tum_vi":
        from imu_sim_ros.datasets.configurations import write_tum_vi_calibration
        from imu_sim_ros.datasets.tum_vi import TumVi

        assert world is not None
        with TumVi(output, sensors, world, jobs) as sequence:
            yield sequence
        write_tum_vi_calibration(output / "dso", world.environment)
    elif form == "vio_data_simulation":
        from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

        assert world is not None
        with VioDataSimulation(output, sensors, world, warn) as folder:
            yield folder
    else:
        states, imus = TRUTH_TOPIC in names, len(imus_in(sensors))
        tables = [] if form == "tracks" else in_tables(names, form, sensors)
        text = "csv" if form == "tracks" else form
        with (
            Dataset(output, text, states, imus, tables) as dataset,
            _seen(form, output, sensors, world, jobs, warn) as seen,
        ):
            yield DatasetTarget(dataset, sensors, seen)
            if form == "euroc":
                from imu_sim_ros.datasets.configurations import describe

                describe(output, states, tables, sensors)


def _seen(
    form: str,
    folder: Path,
    sensors: Mapping[str, Mounted],
    world: World | None,
    jobs: int,
    warn: Warn,
) -> AbstractContextManager[OpenOutput | None]:
    """Return the files of what sensors see in a folder of tables; None if it has none."""
    if not any(one.sensor.sees and form in one.sensor.datasets for one in sensors.values()):
        return nullcontext()
    assert world is not None
    if form == "tracks":
        from imu_sim_ros.datasets.tracks import TrackFiles

        return TrackFiles(folder, sensors, world, warn)
    from imu_sim_ros.datasets.images import ImageFolders

    return ImageFolders(folder, sensors, world, form, jobs)
