# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters in, a bag or a dataset out, as fast as the machine can."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros import arguments
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.threads import prefetch
from imu_sim_ros.bags.write import (
    check_split,
    check_writer,
    dataset_form,
    open_writer,
)
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets import camera_outputs, truth_files
from imu_sim_ros.datasets.topics import (
    BagTarget,
    DatasetTarget,
    chosen_topics,
    in_tables,
    usual_topics,
)
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.jobs.output import Form, Watcher, checked_form, checked_place, is_file
from imu_sim_ros.jobs.simulate import GivenMotion, Moving, given_layers
from imu_sim_ros.machine import cores
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.declaration import Companion
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import has_scene, imus, values_of
from imu_sim_ros.simulation.playback import (
    SimulatorParameters,
    load_simulator,
    of_the_node,
)
from imu_sim_ros.simulation.sensors import imus_in, mounted
from imu_sim_ros.simulation.topics import offered, sensors_of
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.common_parameters import PoseReader
from imu_sim_ros.trajectory.motion import Trajectory

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig import Rig

BLOCK_SIZE: Final = 16384
_MAX_JOBS: Final = 1024


def load_body(given: Mapping[str, object]) -> SimulatorParameters:
    """Return the body that parameters by dotted name describe, with what suits what sees.

    :raises ConfigurationError: with a line for each problem.
    """
    if has_scene(given):
        from imu_sim_ros.simulation.cameras import fitted

        given = fitted(given)
    return load_simulator(given)


def _values(body: SimulatorParameters) -> dict[str, Any]:
    """Return everything that decides the samples and frames, by dotted name."""
    values = values_of(body)
    node = set(of_the_node(values))
    return {name: value for name, value in values.items() if name not in node}


@dataclass(frozen=True)
class GenerateOptions:
    """Further outputs, and options of speed."""

    imu_only: bool = False
    """Without the truth."""
    with_configs: bool = False
    """Write each stack's configuration to OUTPUT_configs."""
    jobs: int = field(default_factory=cores)
    """Threads that render images."""


@dataclass(frozen=True)
class Generated:
    """What :func:`generate` wrote."""

    output: Path
    messages: dict[str, int]
    """Messages by topic, rows by table, images by camera."""
    samples: int
    """Number of samples of all IMUs."""
    bytes: int
    wall_s: float
    warnings: tuple[str, ...] = ()
    """Settings that are allowed but may be unintended, a line each."""
    notes: tuple[str, ...] = ()
    """What was made of recorded poses, of cameras' axes and of a place around the path."""

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "output": str(self.output),
            "messages": self.messages,
            "samples": self.samples,
            "wall_s": self.wall_s,
            "bytes": self.bytes,
        }

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<Generated {self.output.name}: {counts}>"


def generate(
    output: str | Path,
    *,
    imu: str | Path | Mapping[str, Any] | None = None,
    trajectory: Moving = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    cameras: str | Path | Sequence[str | Path] = (),
    scene: str | Path | None = None,
    params_file: str | Path | None = None,
    format: str | None = None,
    storage: str | None = None,
    compression: str | None = None,
    split_duration: float = 0.0,
    split_size: int = 0,
    topics: str | Sequence[str] = (),
    imu_only: bool = False,
    rename: Mapping[str, str] | None = None,
    with_configs: bool = False,
    jobs: int | None = None,
    force: bool = False,
    **parameters: Any,
) -> Generated:
    """Write a bag or a dataset of any duration, as the program ``generate`` does.

    :param output: ``NAME.bag`` is a ROS 1 bag, ``NAME.mcap`` one MCAP file, ``NAME.csv`` and
        ``NAME.tum`` are tables, anything else a rosbag2 folder. Parent folders are created.
    :param cameras: names in config/cameras or parameter files: cam0, cam1, ... in this order.
    :param scene: a name in config/scenes, a parameter file, or a file of points or a mesh.
    :param format: a dataset in place of a bag: ``euroc``, ``csv``, ``tum``, ``tracks``, ...
    :param storage: ``mcap``, ``sqlite3`` or ``ros1``; ``compression``: ``none``, ``lz4``, ...
    :param split_duration: length of each file [s], and ``split_size``: its size [bytes]; 0: all.
    :param topics: by default the readings, ``ground_truth/odom`` and those of other sensors.
    :param imu_only: leave out the truth.
    :param rename: new names for topics, ``{"imu/data_raw": "/imu0"}``.
    :param with_configs: write the configuration of each stack to OUTPUT_configs.
    :param jobs: threads that render images; by default one for each processor.
    :param force: replace what exists, but never a file that is read.

    The other arguments are those of :func:`simulate`.

    :returns: path of the output, and number of messages of each topic.
    :raises ConfigurationError: with a line for each problem with an argument or a parameter.
    :raises InputError: for a file that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> ims.generate(folder / "made.mcap", imu="mpu6000", duration=2, seed=1)
    <Generated made.mcap: 400 /imu/data_raw, 400 /ground_truth/odom>
    """
    bag = (storage, compression, split_duration, split_size)
    form = checked_form(camera_outputs.FORMATS, format, *bag, topics, rename)
    imu_only = arguments.switch("imu_only", imu_only)
    with_configs = arguments.switch("with_configs", with_configs)
    options = GenerateOptions(imu_only, with_configs, cores() if jobs is None else jobs)
    own, motion = given_layers(imu, trajectory, duration, rate, seed, parameters)
    file = None if params_file is None else arguments.path("params_file", params_file)
    below = {} if file is None else files.load(file, "simulator")
    built = load_body({**below, **_of_cameras(cameras, scene), **own})
    return _written(checked_place(output, force), form, options, built, motion, force)


def _written(
    path: Path,
    form: Form,
    options: GenerateOptions,
    built: SimulatorParameters,
    motion: GivenMotion,
    force: bool,
) -> Generated:
    """Write an output; its warnings and notes are a part of the result."""
    read = [word for word in flatten(built).values() if is_file(word)]
    warnings: list[str] = []
    notes: list[str] = []
    watcher = Watcher(warnings.append, notes.append)
    found = write(
        path, form, options, built, Outputs(read, force), watcher, motion.pose_reader, motion.given
    )
    return dataclasses.replace(found, warnings=tuple(warnings), notes=tuple(notes))


def _of_cameras(
    cameras: str | Path | Sequence[str | Path], scene: str | Path | None
) -> dict[str, object]:
    """Return the parameters of cameras that are given by name or file."""
    allowed = "a name or the path of a file"
    several = [cameras] if isinstance(cameras, str | Path) else cameras
    if not isinstance(several, list | tuple):
        arguments.refuse("cameras", cameras, "names or paths of files", wrong_type=True)
    return camera_layer(
        [str(arguments.path("cameras", one, allowed)) for one in several],
        None if scene is None else str(arguments.path("scene", scene, allowed)),
    )


def camera_layer(cameras: Sequence[str], scene: str | None) -> dict[str, object]:
    """Return the parameters, by dotted name, of cameras cam0, cam1, ... and of their scene.

    :param cameras: names in config/cameras, or files.
    :param scene: a name in config/scenes or a file.
    """
    result: dict[str, object] = {}
    if cameras:
        result["cameras"] = [f"cam{k}" for k in range(len(cameras))]
        result.update({f"cam{k}.camera.preset": name for k, name in enumerate(cameras)})
    if scene is not None:
        from imu_sim_ros.sensors.camera.rig_parameters import scene_layer

        result.update(scene_layer(scene))
    return result


def write(
    path: Path,
    form: Form,
    options: GenerateOptions,
    parameters: SimulatorParameters,
    written: Outputs,
    watcher: Watcher,
    pose_reader: PoseReader,
    trajectory: Trajectory | None = None,
) -> Generated:
    """Write an output, its realised truth and its configurations.

    :param written: receives all that is written.
    :param pose_reader: reads a file of poses.
    :param trajectory: a bare motion that was given as an object.
    :raises ConfigurationError: for what cannot be simulated.
    :raises InputError: for what cannot be written.
    """
    started = time.perf_counter()
    if not path.name:  # the files next to it are named after it
        raise InputError(f"{str(path)!r}: is not a file name")
    job = _Job(path, form, options, parameters, watcher)
    written.add(path, kept=True)
    if options.with_configs:
        written.add(truth_files.configs(path), companion_of=path)
    truths: dict[Path, str] = {}
    if job.dataset not in _WITHOUT_READINGS and not path.parent.is_file():  # one line is enough
        truths = truth_files.new_truths(path, parameters)
        for place in truths:
            written.add(place, companion_of=path, kept=True)
        for place in itertools.chain.from_iterable(job.companions.values()):
            written.add(place, companion_of=path)
    with written:
        for place, text in truths.items():
            written.where(place).write_text(text, encoding="utf-8")
        result = job.run(written, pose_reader, trajectory)
    return dataclasses.replace(result, wall_s=time.perf_counter() - started)


_WITHOUT_READINGS: Final = ("tum", "vio_data_simulation")


class _Job:
    """One output that is written."""

    def __init__(
        self,
        path: Path,
        form: Form,
        options: GenerateOptions,
        parameters: SimulatorParameters,
        watcher: Watcher,
    ) -> None:
        self.path, self.form, self.options = path, form, options
        self.parameters, self.watcher = parameters, watcher
        self.sensors = mounted(parameters)
        self.dataset = dataset_form(path, form.dataset, form.of_bags_only())
        self.companions: dict[str, list[Path]] = {}
        if self.dataset not in _WITHOUT_READINGS:
            self.companions = truth_files.companions(path, parameters)
        usual = usual_topics(self.sensors, self.dataset, path, options.imu_only)
        self.names = chosen_topics(
            form.topics, form.renamed, self.sensors, usual, self._camera_topics()
        )
        fastest = max(one.environment.rate for one in self.sensors.values())
        check_split(form.split_duration, 1.0 / fastest, parameters.duration or 0.0)
        if parameters.cameras:
            arguments.whole("jobs", options.jobs, f"from 1 to {_MAX_JOBS}", 1, _MAX_JOBS)
        if self.dataset is None:
            check_writer(path, form.storage, form.compression)

    def _camera_topics(self) -> list[str]:
        """Return the topics that the cameras have in a bag; none in any other form."""
        if not self.parameters.cameras or self.dataset is not None:
            return []
        from imu_sim_ros.datasets.features import camera_topics

        return list(camera_topics(self.parameters.rig))

    def run(
        self, written: Outputs, pose_reader: PoseReader, trajectory: Trajectory | None
    ) -> Generated:
        """Write the output and its configurations."""
        simulator = self.parameters
        wanted = sensors_of(self.names, offered(self.sensors)) | self.companions.keys() | {POSE}
        moving = build_trajectory(simulator.trajectory, pose_reader, trajectory)
        body = Body(simulator, trajectory=moving, sensors=wanted)
        if body.total is None:
            raise ConfigurationError(
                "duration = 0: this trajectory has no end; give a duration, for instance 20s"
            )
        for warning in body.warnings():
            self.watcher.warn(warning)
        output = written.where(self.path)
        cameras = self._cameras(body)
        for note in body.notes():
            self.watcher.note(note)
        with self._target(output, cameras) as target:
            written.describe(self.path, target.described)
            with self._companions(body, written) as companions:
                samples = self._write(body, target, companions)
        if self.dataset == "tum_vi":
            from imu_sim_ros.datasets.configurations import write_tum_vi_calibration

            write_tum_vi_calibration(output / "dso", simulator, self.parameters.rig)
        if self.options.with_configs:
            self._write_configs(written.where(truth_files.configs(self.path)), body)
        return Generated(
            self.path,
            target.counts,
            samples,
            sum(file.stat().st_size for file in target.files if file.is_file()),
            0.0,
        )

    def _cameras(self, body: Body) -> Rig | None:
        """Return the cameras on the body, with their scene."""
        if not self.parameters.cameras:
            return None
        from imu_sim_ros.simulation.cameras import rig_on

        cameras = rig_on(self.parameters.rig, body)
        body.scene = cameras.scene
        for name in cameras.views:
            for line in cameras.warnings(name):
                self.watcher.warn(f"{name}: {line}")
            for line in cameras.notes(name):
                self.watcher.note(f"{name}: {line}")
        return cameras

    def _write_configs(self, folder: Path, body: Body) -> None:
        """Write each stack's configuration, and all parameters."""
        from imu_sim_ros.datasets.configurations import bagcreater_topics, write_configs

        topics = self.names
        if self.form.dataset == "csv":
            topics = bagcreater_topics(imus(body.parameters))
        for warning in write_configs(folder, body, topics, self.parameters.rig):
            self.watcher.warn(warning)
        fitted = f"\n{body.scene.note}" if body.scene is not None and body.scene.note else ""
        files.write(
            _values(self.parameters),
            folder / "simulation.yaml",
            comment=f"All parameters of {self.path.name}:\n"
            f"generate --params-file simulation.yaml generates the same samples.{fitted}",
        )

    @contextmanager
    def _bag(self, output: Path, cameras: Rig | None) -> Iterator[Any]:
        """Open a bag; it is complete when the block ends without an error."""
        known, form = offered(self.sensors), self.form
        with open_writer(
            output, form.storage, form.compression, form.split_duration, form.split_size
        ) as writer:
            own = {name: new for name, new in self.names.items() if name in known}
            bag = BagTarget(writer, self.sensors, own)
            if cameras is None:
                yield bag
                return
            of_cameras = {name: new for name, new in self.names.items() if name not in known}
            from imu_sim_ros.datasets.camera_bag import CameraBag

            with CameraBag(bag, cameras, of_cameras, self.options.jobs) as target:
                yield target

    @contextmanager
    def _target(self, output: Path, cameras: Rig | None) -> Iterator[Any]:
        """Open the output; it is complete when the block ends without an error."""
        form = self.dataset
        camera_outputs.check_form(form, output, cameras, len(imus_in(self.sensors)))
        if form is None:
            with self._bag(output, cameras) as bag:
                yield bag
        elif form in camera_outputs.CAMERA_FORMATS:
            assert cameras is not None
            with camera_outputs.opened(
                form,
                output,
                cameras,
                self.names,
                self.sensors,
                self.options.jobs,
                self.watcher.warn,
            ) as folder:
                yield folder
        else:
            with self._tables(form, output, cameras) as tables:
                yield tables

    @contextmanager
    def _tables(self, form: str, output: Path, cameras: Rig | None) -> Iterator[Any]:
        """Open tables of text, with images on request."""
        tables = in_tables(self.names, form, self.sensors)
        states, every = TRUTH_TOPIC in self.names, imus_in(self.sensors)
        with text_writer.Dataset(output, form, states, len(every), tables) as dataset:
            target = DatasetTarget(dataset, self.sensors)
            if cameras is None:
                yield target
            else:
                from imu_sim_ros.datasets.images import ImageFolders

                comment = f"simulated by imu_sim_ros, seed {self.parameters.seed}"
                with ImageFolders(output, cameras, form, self.options.jobs, comment) as images:
                    target = camera_outputs.CameraTarget(dataset, images, self.sensors)
                    yield target
            if form == "euroc":
                from imu_sim_ros.datasets.configurations import describe

                describe(output, states, tables, self.sensors)
        target.files = dataset.files

    @contextmanager
    def _companions(self, body: Body, written: Outputs) -> Iterator[dict[str, Companion]]:
        """Open the files that sensors have next to the output, by sensor."""
        opened = {}
        with ExitStack() as stack:
            for name, places in self.companions.items():
                one = self.sensors[name]
                wanted = one.sensor.companions
                assert wanted is not None
                files = [written.where(place) for place in places]
                made = wanted.open(one.own, one.environment, body.t0_ns, files)
                opened[name] = stack.enter_context(closing(made))
            yield opened

    def _write(self, body: Body, target: Any, companions: Mapping[str, Companion]) -> int:
        """Write all samples, which a thread of its own makes; return how many those of IMUs are."""
        every, samples = imus_in(self.sensors), 0
        with self.watcher.progress(body.total or 0) as advance:
            windows = prefetch(
                body.windows(min(BLOCK_SIZE, getattr(target, "block_size", BLOCK_SIZE)))
            )
            try:
                for read in windows:
                    target.write(read)
                    for name, companion in companions.items():
                        companion.write(read[name])
                    counts = [len(read[name].t_ns) for name in every]
                    samples += sum(counts)
                    advance(max(counts))
            finally:
                windows.close()
        return samples
