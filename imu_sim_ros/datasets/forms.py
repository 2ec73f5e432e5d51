# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Formats in which the samples of a body are written: bags, and datasets of text and images.

``generate``, the Python interface and campaigns write through this module.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.schemas import LATCHED
from imu_sim_ros.bags.text.writer import FORMATS as TEXT_FORMATS
from imu_sim_ros.bags.text.writer import WITH_TABLES, Dataset
from imu_sim_ros.bags.writer import (
    AS_NAMED,
    BagOptions,
    BagTopic,
    Block,
    Writer,
    describe_amount,
    topics_summary,
)
from imu_sim_ros.core.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import unknown_name_line
from imu_sim_ros.core.records import States
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.deferred import Results
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import all_tables, imus_in
from imu_sim_ros.simulation.topics import (
    MOUNTS,
    Encode,
    Messages,
    Offered,
    WindowSamples,
    delivered_readings,
    delivered_rows,
    published_topics,
    resolve_topic,
    sensor_topics,
)

Warn = Callable[[str], object]
"""Receiver of a warning."""
CAMERA_FORMATS: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
FORMATS: Final = (*TEXT_FORMATS, *CAMERA_FORMATS)
"""All formats of datasets."""


def check_form(
    form: str | None, path: Path, sensors: Mapping[str, Mounted[MountedParameters]]
) -> None:
    """Refuse cameras and IMUs that a format cannot hold, and a format without the cameras it needs.

    :raises InputError: with the arguments to give.
    """
    imus = len(imus_in(sensors))
    seeing = [o.sensor for o in sensors.values() if o.sensor.sees and o.sensor.datasets]
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: has room for one IMU, not {imus}")
    if form is not None and seeing:
        forms = seeing[0].datasets
        if form not in forms or path.suffix == ".csv":
            raise InputError(
                f"{argument_prefix('cameras')}: need a bag, or a folder and "
                f"{argument('format')}: {', '.join(forms)}"
            )
    if not seeing and form in CAMERA_FORMATS:
        raise InputError(f"format {form}: needs a camera; {argument('cameras')} names one")
    if form == "vio_data_simulation" and len(seeing) > 1:
        raise InputError(f"format {form}: has room for one camera, not {len(seeing)}")


def _usual_topics(
    sensors: Mapping[str, Mounted[MountedParameters]], form: str | None, path: Path, imu_only: bool
) -> list[str]:
    """Return the topics that are written by default: those that a node usually publishes.

    A dataset has tables of readings; a bag has all topics except those of optional packages.
    """
    is_text = form is not None
    tables = is_text and form in WITH_TABLES and path.suffix.lower() != ".csv"
    names = []
    for name, offer in published_topics(sensors, SimulatorParameters().publish).items():
        topic, sensor, companions = (
            offer.topic,
            offer.mounted.sensor,
            offer.mounted.sensor.companions,
        )
        if topic.foreign or (imu_only and topic.truth):
            continue
        if form in sensor.datasets:
            continue  # the dataset has files of this sensor
        if (
            is_text
            and sensor.table is None
            and companions
            and companions.suffixes(offer.mounted.parameters)
        ):
            continue  # the companions hold these readings
        if is_text and sensor.table is not None and not (tables and topic is sensor.topics[0]):
            continue
        names.append(name)
    if not is_text and any(
        mount.sensor.sees and not mount.sensor.apart for mount in sensors.values()
    ):
        names.append(MOUNTS)  # placing points in the world needs the mounts; camera stacks do not
    return names


ALL: Final = "all"
"""Name that stands for every available topic."""


def _has_messages(offer: Offered) -> bool:
    """Return whether a topic has messages with the parameters of its sensor."""
    try:
        offer.encoder()
    except ConfigurationError:
        return False
    return True


def topics_to_write(
    sensors: Mapping[str, Mounted[MountedParameters]],
    form: str | None,
    path: Path,
    topics: Sequence[str] = (),
    renamed: Mapping[str, str] = MappingProxyType({}),
    imu_only: bool = False,
) -> dict[str, str]:
    """Return the topics to write, each with its name in the bag.

    :param form: format of a dataset; None: a bag.
    :param topics: topics; one without its namespace selects that of every IMU; ``all``: every one;
            empty: the default topics.
    :param imu_only: leave out the truth from the default topics.
    :raises InputError: with a line for every name that is unknown or given twice.
    """
    topics_by_name = sensor_topics(sensors)
    names: list[str] = []
    requested: Sequence[str] = topics or _usual_topics(sensors, form, path, imu_only)
    if ALL in topics:
        if len(topics) > 1:
            raise InputError(f"topics = {', '.join(topics)}: {ALL} stands for every topic, alone")
        requested = [name for name, offer in topics_by_name.items() if _has_messages(offer)]
    for name in (name.strip().lstrip("/") for name in requested):
        matches = [full for full, offer in topics_by_name.items() if offer.topic.name == name]
        names += matches if matches and name not in topics_by_name else [name]
    problems = [
        unknown_name_line("topic", name, tuple(topics_by_name))
        for name in [*names, *renamed]
        if name not in topics_by_name
    ]
    problems += [f"topic {name}: given twice" for name in set(names) if names.count(name) > 1]
    names_in_bag = [resolve_topic(renamed.get(name, name)) for name in dict.fromkeys(names)]
    problems += [
        f"topic {name}: two topics would have this name"
        for name in dict.fromkeys(names_in_bag)
        if names_in_bag.count(name) > 1
    ]
    if problems:
        raise InputError(problems)
    return {name: renamed.get(name, name) for name in names}


def dataset_tables(
    names: Iterable[str], form: str, sensors: Mapping[str, Mounted[MountedParameters]]
) -> list[tuple[Table, int]]:
    """Return the tables of sensors in a dataset, each with the number of the IMU.

    :param names: names of the topics that are written.
    :raises InputError: with a line for each topic that the format does not have.
    """
    tables_by_topic = {
        f"{table.mounted.space}{table.mounted.sensor.topics[0].name}": table
        for table in all_tables(sensors)
    }
    topics, tables, problems = sensor_topics(sensors), [], []
    for name in names:
        if name in tables_by_topic and form in WITH_TABLES:
            tables.append((tables_by_topic[name].table, tables_by_topic[name].number))
        elif topics[name].topic.name not in (IMU_TOPIC, TRUTH_TOPIC):
            problems.append(f"topic {name}: does not exist in {form}")
    if problems:
        raise InputError(problems)
    return tables


class OpenOutput(Protocol):
    """An output, or a part of one, that receives the samples of a body."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic, rows by table, images by camera."""

    def summary(self) -> str:
        """Return the amount of data written, as text."""

    def write(self, window: WindowSamples) -> None:
        """Write the samples of a window of time."""


class _Output(NamedTuple):
    """A topic of a bag and the source of its messages."""

    topic: BagTopic
    sensor: str
    """Name of the sensor."""
    valid: Any
    """Parameters that the messages depend on."""
    encode: Encode
    """Encoder of the samples."""


class BagTarget:
    """Output of samples into a bag."""

    def __init__(
        self,
        writer: Writer,
        sensors: Mapping[str, Mounted[MountedParameters]],
        names: Mapping[str, str],
    ) -> None:
        """Add the topics to the bag.

        :param sensors: sensors of the body.
        :param names: name in the bag of each topic that is written.
        """
        self._writer = writer
        topics = sensor_topics(sensors)
        self._outputs = []
        for full, name in names.items():
            sensor, mounted, topic = topics[full]
            qos = [LATCHED] if topic.latched else None
            bag_topic = writer.add_topic(resolve_topic(name), topic.type, qos)
            encode = topics[full].encoder(writer.encoding)
            self._outputs.append(_Output(bag_topic, sensor, mounted.valid, encode))
        self._pending: list[tuple[BagTopic, Messages]] = []

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic."""
        return {output.topic.name: output.topic.count for output in self._outputs}

    def summary(self) -> str:
        """Return the amount of data written, as text."""
        return topics_summary(output.topic for output in self._outputs)

    def write(self, window: WindowSamples) -> None:
        """Write the messages of a window of time, all topics in order.

        Messages that threads encode are written with the next window, so that threads never wait.
        """
        messages_by_topic = [
            (topic, encode(window[name], valid)) for topic, name, valid, encode in self._outputs
        ]
        self.finish()
        self._pending = [
            (topic, messages) for topic, messages in messages_by_topic if len(messages.record_t_ns)
        ]
        if not any(isinstance(messages.payloads, Results) for _, messages in messages_by_topic):
            self.finish()

    def finish(self) -> None:
        """Write the messages that threads have encoded."""
        pending, self._pending = self._pending, []
        self._writer.write_blocks(
            [Block(t, messages.record_t_ns, messages.made()) for t, messages in pending]
        )


class DatasetTarget:
    """Output of samples into text tables, with tracks or images of cameras."""

    def __init__(
        self,
        dataset: Dataset,
        sensors: Mapping[str, Mounted[MountedParameters]],
        camera_files: OpenOutput | None,
    ) -> None:
        """Connect the sensors of a body with the files of a dataset.

        :param sensors: sensors of the body; its IMUs are imu0, imu1, ... of the dataset.
        :param camera_files: files of the cameras, tracks or images; None: there are none.
        """
        self.dataset, self._sensors, self._camera_files = dataset, sensors, camera_files
        self._imus = imus_in(sensors)
        self._tables = {(table.table.name, table.number): table for table in all_tables(sensors)}
        # States of EuRoC contain biases, so each IMU has its own. Poses alone are those of the
        # body.
        self._states = self._imus if dataset.form == "euroc" else [POSE]

    def summary(self) -> str:
        """Return the amount of data written, as text, with that of each camera."""
        rows = describe_amount(self.dataset.rows, self.dataset.last_ns, "rows")
        return rows if self._camera_files is None else f"{rows}, {self._camera_files.summary()}"

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows by topic, and of images by camera."""
        row_counts: dict[str, int] = {}
        # A TUM file has states and no readings.
        for name, readings_file in zip(self._imus, self.dataset.imus, strict=False):
            topic = self._sensors[name].space + IMU_TOPIC
            row_counts[resolve_topic(topic)] = readings_file.rows
        for name, states_file in zip(self._states, self.dataset.truths, strict=False):
            topic = self._sensors[name].space + TRUTH_TOPIC
            row_counts[resolve_topic(topic)] = states_file.rows
        for key, table_file in self.dataset.tables.items():
            mounted = self._tables[key].mounted
            topic = f"{mounted.space}{mounted.sensor.topics[0].name}"
            row_counts[resolve_topic(topic)] = table_file.rows
        image_counts = {} if self._camera_files is None else self._camera_files.counts
        return row_counts | image_counts

    def write(self, window: WindowSamples) -> None:
        """Write the rows of a window of time, and the data of its cameras."""
        for k, name in enumerate(self._imus[: len(self.dataset.imus)]):
            self.dataset.write_imu(*delivered_readings(window[name]), k)
        for kind, k in self.dataset.tables:
            _, _, name, mounted = self._tables[kind, k]
            samples, rows = window[name], delivered_rows(window[name])
            self.dataset.write_table(
                kind, k, samples.t_ns[rows], mounted.sensor.values(samples)[rows]
            )
        for k, name in enumerate(self._states[: len(self.dataset.truths)]):
            self.dataset.write_states(*_states(window[name]), k)
        if self._camera_files is not None:
            self._camera_files.write(window)


def _states(samples: Samples) -> tuple[States, Array | None]:
    """Return the true states at an IMU's samples, and its biases (n, 6); None: a pose has none."""
    motion = samples.values.get("motion", samples)
    states = States.unchecked(
        t_ns=samples.true_t_ns, position=motion.position, q_wb=motion.q_wb, velocity=motion.velocity
    )
    if "gyro_bias" not in samples.values:
        return states, None
    return states, np.concatenate(
        [samples.values["gyro_bias"], samples.values["accel_bias"]], axis=1
    )


@contextmanager
def open_output(
    form: str | None,
    output: Path,
    names: Mapping[str, str],
    sensors: Mapping[str, Mounted[MountedParameters]],
    world: World | None = None,
    jobs: int = 1,
    warn: Warn = lambda line: None,
    bag: BagOptions = AS_NAMED,
) -> Iterator[OpenOutput]:
    """Open an output for windows of samples; it is complete if the block ends without an error.

    :param form: format of a dataset; None: a bag.
    :param names: name in a bag of each topic that is written.
    :param sensors: sensors of the body.
    :param world: world that sensors see, with threads that make images; None: no sensor sees.
    :param jobs: number of the threads.
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
        with TumVi(output, sensors, world, jobs, warn) as sequence:
            yield sequence
        write_tum_vi_calibration(output / "dso", world.environment)
    elif form == "vio_data_simulation":
        from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

        assert world is not None
        with VioDataSimulation(output, sensors, world, warn) as folder:
            yield folder
    else:
        states, imus = TRUTH_TOPIC in names, len(imus_in(sensors))
        tables = [] if form == "tracks" else dataset_tables(names, form, sensors)
        text = "csv" if form == "tracks" else form
        with (
            Dataset(output, text, states, imus, tables) as dataset,
            _camera_files(form, output, sensors, world, jobs, warn) as camera_files,
        ):
            yield DatasetTarget(dataset, sensors, camera_files)
            if form == "euroc":
                from imu_sim_ros.datasets.configurations import describe

                describe(output, states, tables, sensors)


def _camera_files(
    form: str,
    folder: Path,
    sensors: Mapping[str, Mounted[MountedParameters]],
    world: World | None,
    jobs: int,
    warn: Warn,
) -> AbstractContextManager[OpenOutput | None]:
    """Return the files of cameras in a folder of tables; None if it has none."""
    if not any(
        sensor.sensor.sees and form in sensor.sensor.datasets for sensor in sensors.values()
    ):
        return nullcontext()
    assert world is not None
    if form == "tracks":
        from imu_sim_ros.datasets.tracks import TrackFiles

        return TrackFiles(folder, sensors, world, warn)
    from imu_sim_ros.datasets.images import ImageFolders

    return ImageFolders(folder, sensors, world, form, jobs, warn)
