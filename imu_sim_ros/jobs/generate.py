# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters in, a bag or a dataset out, as fast as the machine can."""

from __future__ import annotations

import glob
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from imu_sim_ros.bags.outputs import Outputs, Target
from imu_sim_ros.bags.threads import core_count, prefetch, thread_pool
from imu_sim_ros.bags.writer import BagOptions, check_split
from imu_sim_ros.core import arguments
from imu_sim_ros.core.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.records import States
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.datasets import truth_files
from imu_sim_ros.datasets.forms import (
    FORMATS,
    check_form,
    open_output,
    topics_to_write,
)
from imu_sim_ros.jobs.segments import Segments, segment_layer
from imu_sim_ros.jobs.simulate import GivenMotion, Moving, argument_layers, collect_pose_problems
from imu_sim_ros.jobs.writing import (
    OUTPUT,
    Compression,
    DiscardPartial,
    Force,
    Form,
    Format,
    Journal,
    Output,
    ParameterFiles,
    Parameters,
    Rename,
    SkipBadRows,
    SplitDuration,
    SplitSize,
    Storage,
    counts_text,
    form_of_output,
    outputs,
    parameter_files,
    time_and_speed,
)
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors import switchable_sensors, switches
from imu_sim_ros.sensors.declaration import Companion, Mounted
from imu_sim_ros.sensors.imu.presets import load_all
from imu_sim_ros.sensors.parameters import MountedParameters, RatedParameters
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import (
    SimulationParameters,
    imus,
    join_layers,
    name_sensors,
    values_of,
)
from imu_sim_ros.simulation.parameters import segments as segments_of_imus
from imu_sim_ros.simulation.playback import (
    live_parameter_names,
    load_simulator,
)
from imu_sim_ros.simulation.sensors import imus_in, mount_sensors
from imu_sim_ros.simulation.topics import sensor_topics
from imu_sim_ros.terminal.progress import progress
from imu_sim_ros.terminal.signatures import Heading, Text
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.parameters import PoseReader

if TYPE_CHECKING:
    from concurrent.futures import Executor

BLOCK_SIZE: Final = 16384
"""Samples of an IMU that are computed and written at once."""
_MAX_JOBS: Final = 1024
"""Largest number of threads that encode images."""
_WITHOUT_READINGS: Final = ("tum", "vio_data_simulation")
"""Datasets of which no sensor has files next to them."""


@dataclass(frozen=True)
class Generated:
    """Result of :func:`generate`: the output and its counts."""

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
    """Parameters without effect, and how poses, axes of cameras and the place were interpreted."""

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "output": str(self.output),
            "messages": self.messages,
            "samples": self.samples,
            "wall_s": self.wall_s,
            "bytes": self.bytes,
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report that ``generate`` prints."""
        speed = time_and_speed(sum(self.messages.values()), self.wall_s, "messages")
        yield f"{self.output}: {counts_text(self.messages)}; {self.bytes / 1e6:,.1f} MB in {speed}"

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<Generated {self.output.name}: {counts}>"


_SIMULATION: Final = Heading("simulation")
_CAMERAS: Final = Heading("cameras")
_EVERY: Final = ", ".join(sensor_topics(mount_sensors(SimulationParameters())))
_WRITTEN: Final = Text(
    f"topics to write (default: {IMU_TOPIC},{TRUTH_TOPIC}); all, or some of {_EVERY}"
)
OF_SENSORS: Final = Heading("sensors of the body (--set sensors=[NAME,...])")


def generate(
    output: Output,
    *,
    params_file: ParameterFiles = None,
    imu: Annotated[
        str | Path | Mapping[str, object] | None,
        "NAME|FILE",
        Text("IMU: a preset (see --list-imus) or a file"),
        _SIMULATION,
    ] = None,
    trajectory: Annotated[
        Moving,
        "NAME|FILE",
        Text(
            "motion: a preset (see --list-trajectories), a parameter file, a route (GPX, KML), or "
            "recorded poses (TUM, EuRoC, bag)"
        ),
        _SIMULATION,
    ] = None,
    segments: Annotated[
        Segments,
        "--segment NAME",
        str,
        Text(
            "segment of the trajectory's file that carries the IMU; repeatable, or all: an IMU on "
            "each"
        ),
        _SIMULATION,
    ] = (),
    robust: Annotated[bool, "--robust", _SIMULATION] = False,
    rate: Annotated[float | None, "HZ", Text("sampling rate"), _SIMULATION] = None,
    duration: Annotated[
        float | str | None, "TIME", Text("length of the run (20s, 10min, 4h)"), _SIMULATION
    ] = None,
    seed: Annotated[int | None, "N", Text("seed of all random streams"), _SIMULATION] = None,
    cameras: Annotated[
        str | Path | Sequence[str | Path],
        "--camera NAME|FILE",
        str,
        Text(
            "camera: a preset (see --list-cameras) or a file; repeatable, named cam0, cam1, ... in "
            "order"
        ),
        _CAMERAS,
    ] = (),
    scene: Annotated[
        str | Path | None,
        "NAME|FILE",
        Text(
            "scene: a preset (see --list-scenes), a parameter file, points (CSV, PLY), or a mesh "
            "(GLB, glTF, OBJ, PLY, STL)"
        ),
        _CAMERAS,
    ] = None,
    jobs: Annotated[int | None, "N", _CAMERAS] = None,
    format: Annotated[Format, FORMATS] = None,
    storage: Storage = None,
    compression: Compression = None,
    split_duration: SplitDuration = 0.0,
    split_size: SplitSize = 0,
    topics: Annotated[str | Sequence[str], "NAME,...", _WRITTEN, OUTPUT] = (),
    imu_only: Annotated[bool, "--imu-only", OUTPUT] = False,
    rename: Rename = None,
    with_configs: Annotated[bool, "--with-configs", OUTPUT] = False,
    skip_bad_rows: SkipBadRows = False,
    force: Force = False,
    discard_partial: DiscardPartial = False,
    **parameters: Parameters,
) -> Generated:
    """Write a bag or a dataset of any duration, as the program ``generate`` does.

    :param output: ``NAME.bag`` is a ROS 1 bag, ``NAME.mcap`` one MCAP file, ``NAME.csv`` and
        ``NAME.tum`` are tables, anything else a rosbag2 folder. Parent folders are created.
    :param params_file: one or several ROS 2 parameter files; all other arguments go before them.
    :param segments: names of segments in the trajectory's file: a single one moves the body;
        several or ``all`` carry an IMU each, in a namespace of its own, as for :func:`simulate`.
    :param robust: repair recorded poses: drop outliers, close jumps, smooth arrival stamps
        (trajectory.robust)
    :param cameras: names in config/cameras or parameter files: cam0, cam1, ... in this order.
    :param scene: a name in config/scenes, a parameter file, or a file of points or a mesh.
    :param jobs: number of threads that render images (default: one per processor)
    :param format: a dataset in place of a bag: ``euroc``, ``csv``, ``tum``, ``tracks``, ...
    :param storage: ``mcap``, ``sqlite3`` or ``ros1``; ``compression``: ``none``, ``lz4``, ...
    :param split_duration: length of each file [s], and ``split_size``: its size [bytes]; 0: all.
    :param topics: by default the readings, ``ground_truth/odom`` and those of other sensors.
    :param imu_only: leave out the ground truth
    :param rename: new names for topics, ``{"imu/data_raw": "/imu0"}``.
    :param with_configs: write all parameters and a configuration file for each supported stack
        (kalibr, VINS, OpenVINS, ORB_SLAM3, Basalt, imu_utils, allan_variance_ros; with GNSS or
        wheels also robot_localization, FusionCore and MINS) to OUTPUT_configs
    :param skip_bad_rows: leave out poses of the trajectory's file that are not possible.
    :param force: replace what exists, but never a file that is read.
    :param discard_partial: keep nothing of an interrupted run.
    :param parameters: any other parameter, as for :func:`simulate`; a sensor of the body by a name
        in config, a file, several of them, or True: ``gnss="ublox_m8"``; files that it has next to
        the output: ``rinex=True``. What ``parameters`` itself has, a dictionary by ROS names, goes
        before all other arguments.

    The other arguments are those of :func:`simulate`.

    :returns: path of the output, and number of messages of each topic.
    :raises ConfigurationError: with a line for each problem with an argument or a parameter.
    :raises InputError: for a file that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> ims.generate(folder / "made.mcap", imu="mpu6000", duration=2, seed=1)
    <Generated made.mcap: 400 /imu/data_raw, 400 /ground_truth/odom>
    """
    bag = BagOptions(storage, compression, split_duration, split_size)
    path, form = form_of_output(FORMATS, output, format, bag, topics, rename)
    arguments.boolean("imu_only", imu_only)
    arguments.boolean("with_configs", with_configs)
    arguments.boolean("skip_bad_rows", skip_bad_rows)
    threads = core_count() if jobs is None else jobs
    arguments.integer("jobs", threads, f"from 1 to {_MAX_JOBS}", 1, _MAX_JOBS)
    journal, problems = Journal(), Problems()
    values, motion = run_parameters(
        journal,
        problems,
        params_file,
        parameters,
        imu=imu,
        trajectory=trajectory,
        duration=duration,
        rate=rate,
        seed=seed,
        segments=segments,
        robust=robust,
        cameras=cameras,
        scene=scene,
    )
    with collect_pose_problems(values, motion, _has_segments(segments)):
        simulation = load_simulator(values, problems=problems)

    sensors = mount_sensors(simulation)
    check_form(form.dataset, path, sensors)
    topic_names = topics_to_write(sensors, form.dataset, path, form.topics, form.renamed, imu_only)
    fastest_rate = max(sensor.environment.rate for sensor in sensors.values())
    check_split(form.bag.split_duration, 1.0 / fastest_rate, simulation.duration or 0.0)
    inputs = [*parameter_files(params_file), *_possible_inputs(flatten(simulation))]
    staging = outputs(force, discard_partial, inputs)
    started = time.perf_counter()
    output_files = _output_files(staging, path, form.dataset, simulation, sensors, with_configs)
    needed = _needed_sensors(sensors, topic_names, form.dataset) | output_files.companions.keys()

    # Images and scans are rendered in threads; other sensors need none.
    renders = any(sensor.sensor.apart for sensor in sensors.values())
    with staging.stage(), thread_pool(threads) if renders else nullcontext() as pool:
        for truth_file, text in output_files.truths.items():
            truth_file.write_text(text, encoding="utf-8")
        pose_reader = _pose_reader(motion, skip_bad_rows, journal)
        body = _body(simulation, pose_reader, motion, needed, pool)
        for line in body.warnings():
            journal.warn(line)
        for line in body.notes():
            journal.note(line)
        output_form = replace(form, renamed=topic_names)
        messages, samples = _write_samples(
            body, sensors, needed, output_files, output_form, threads, journal
        )
        if output_files.configs is not None:
            _write_configs(output_files.configs, path.name, body, topic_names, format, journal)
        size = _size(output_files.output.path)
    wall_s = time.perf_counter() - started
    return Generated(
        path, messages, samples, size, wall_s, tuple(journal.lines), tuple(journal.notes)
    )


@dataclass(frozen=True)
class _OutputFiles:
    """Files that a run writes, at the paths where they are staged."""

    output: Target
    """The bag or dataset."""
    configs: Path | None
    """Folder of the configurations of other stacks; None: they are not asked for."""
    truths: Mapping[Path, str]
    """Text of each file of realised parameters."""
    companions: Mapping[str, Sequence[Path]]
    """Files of a sensor's own programs, such as RINEX, by the name of the sensor."""


def _output_files(
    staging: Outputs,
    path: Path,
    dataset: str | None,
    simulation: SimulationParameters,
    sensors: Mapping[str, Mounted[MountedParameters]],
    with_configs: bool,
) -> _OutputFiles:
    """Add a bag or dataset, and the files next to it, to the staged outputs.

    :param path: final path of the bag or dataset.
    :param dataset: format of the dataset; None: a bag.
    :raises InputError: if another output of this name has another realised truth.
    """
    output = staging.add(path, keep_partial=True)
    configs = None
    if with_configs:
        configs = staging.add(truth_files.configs(path), companion_of=output).path
    truths: dict[Path, str] = {}
    companions: dict[str, list[Path]] = {}
    # An output in a place that is a file is refused with a single line.
    if dataset not in _WITHOUT_READINGS and not path.parent.is_file():
        for file, text in truth_files.new_truth_files(path, simulation).items():
            truths[staging.add(file, companion_of=output, keep_partial=True).path] = text
        for name, companion_files in truth_files.companion_files(path, sensors).items():
            companions[name] = [
                staging.add(file, companion_of=output).path for file in companion_files
            ]
    return _OutputFiles(output, configs, truths, companions)


def _possible_inputs(values: Mapping[str, object]) -> Iterator[object]:
    """Yield the values of parameters that may name files, those of ``NAME.file`` as paths."""
    yield from values.values()
    for name, value in values.items():
        if name.endswith(".file") and value:
            yield Path(str(value))


def _needed_sensors(
    sensors: Mapping[str, Mounted[MountedParameters]], names: Mapping[str, str], dataset: str | None
) -> set[str]:
    """Return the names of the sensors whose samples are written, and of the true pose.

    :param names: name in the output of each topic that is written.
    :param dataset: format of the dataset; None: a bag.
    """
    topics = sensor_topics(sensors)
    dataset_sensors = {name for name, mount in sensors.items() if dataset in mount.sensor.datasets}
    return {POSE, *(topics[name].name for name in names)} | dataset_sensors


def _pose_reader(motion: GivenMotion, skip_bad_rows: bool, journal: Journal) -> PoseReader:
    """Return the reader of the trajectory's file; the journal tells how many rows it skips."""

    def read(file: str | Path, topic: str | None = None) -> States:
        poses = motion.pose_reader(file, topic, skip_bad_rows)
        if poses.skipped:
            journal.remark(f"{file}: {poses.skipped} bad rows skipped")
        return poses

    return read


def _body(
    simulation: SimulationParameters,
    pose_reader: PoseReader,
    motion: GivenMotion,
    sensors: Collection[str],
    pool: Executor | None,
) -> Body:
    """Return the body of a run that has an end.

    :param sensors: names of the sensors that are read in addition to the IMUs.
    :param pool: threads that render images and scans; None: nothing is rendered.
    :raises ConfigurationError: for a run without an end, and for inconsistent parameters.
    """
    trajectory = None
    if not segments_of_imus(simulation):
        trajectory = build_trajectory(simulation.trajectory, pose_reader, motion.trajectory)
    body = Body(simulation, pose_reader, trajectory=trajectory, sensors=sensors, threads=pool)
    if body.total is None:
        raise ConfigurationError(
            f"{argument_prefix('duration', '0')}: this trajectory has no end; give a duration, for "
            "instance 20s"
        )
    return body


def _write_samples(
    body: Body,
    sensors: Mapping[str, Mounted[MountedParameters]],
    needed: Collection[str],
    output_files: _OutputFiles,
    form: Form,
    renderers: int,
    journal: Journal,
) -> tuple[dict[str, int], int]:
    """Write all samples of a body to the output and to the companion files.

    :param sensors: all sensors of the body; ``needed``: names of those that are read.
    :param form: form of the output; ``renamed`` has each topic that is written.
    :param renderers: number of threads that encode images.
    :returns: messages by topic, and the number of samples of all IMUs.
    """
    imu_names = imus_in(body.sensors)
    frame_counts = {name: 0 for name in sorted(needed) if sensors[name].sensor.sees}
    samples = 0
    with (
        open_output(
            form.dataset,
            output_files.output.path,
            form.renamed,
            sensors,
            body.world,
            renderers,
            journal.warn,
            form.bag,
        ) as target,
        ExitStack() as stack,
        progress(f"writing {output_files.output.final}", lambda: body.total or 0) as advance,
        closing(prefetch(body.windows(BLOCK_SIZE))) as windows,
    ):
        output_files.output.summary = target.summary
        companions: dict[str, Companion] = {}
        for name, paths in output_files.companions.items():
            mount = sensors[name]
            assert mount.sensor.companions is not None
            companion = mount.sensor.companions.open(
                mount.parameters, mount.environment, body.t0_ns, paths
            )
            companions[name] = stack.enter_context(closing(companion))
        for window in windows:
            target.write(window)
            for name, companion in companions.items():
                companion.write(window[name])
            for name in frame_counts:
                frame_counts[name] += len(window[name].t_ns)
            lengths = [len(window[name].t_ns) for name in imu_names]
            samples += sum(lengths)
            advance(max(lengths))
    for name, count in frame_counts.items():
        if not count:
            parameters = sensors[name].parameters
            assert isinstance(parameters, RatedParameters)
            journal.warn(f"{name}: not a single frame in the whole run, at {parameters.rate:g} Hz")
    return target.counts, samples


def run_parameters(
    journal: Journal,
    problems: Problems,
    params_file: object,
    parameters: Mapping[str, object],
    *,
    imu: object = None,
    trajectory: object = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    segments: object = (),
    robust: bool = False,
    cameras: object = (),
    scene: str | Path | None = None,
) -> tuple[dict[str, object], GivenMotion]:
    """Return all parameters of a run by dotted name, and its motion.

    Arguments override the values of files; cameras of arguments replace those of files.

    :param journal: receives notes about parameters and presets without effect.
    :param problems: receives a line for each argument or file that cannot be used.

    The other arguments are those of :func:`generate`.
    """
    file_values, scene_values = dict[str, object](), dict[str, object]()
    with problems.collect(hanging=""):
        file_values = load_all(parameter_files(params_file), "simulator")
    layers, overrides, motion = argument_layers(
        imu, trajectory, duration, rate, seed, parameters, problems
    )
    if arguments.boolean("robust", robust):
        layers["trajectory.robust"] = True
    switched_on = []
    for kind, switch in switches().items():
        if arguments.boolean(switch.name, layers.pop(switch.name, False)):
            layers[f"{kind}.{switch.parameter}"] = True
            switched_on.append(kind)
    if scene is not None:
        from imu_sim_ros.sensors.camera.rig_parameters import scene_layer  # most runs have none

        with problems.collect(hanging="scene."):
            file = arguments.path("scene", scene, "a name or the path of a file")
            scene_values = scene_layer(str(file))
    if _has_segments(segments):
        motion_file = layers.get("trajectory.file", file_values.get("trajectory.file"))
        with problems.collect():
            layers = _on_segments(segments, motion_file) | layers
    values = {**file_values, **scene_values, **layers}
    for kind in ("camera", *switchable_sensors()):
        option, sources = ("cameras", cameras) if kind == "camera" else (kind, values.pop(kind, ()))
        presets: list[object] = []
        with problems.collect(hanging="cam" if kind == "camera" else f"{kind}."):
            presets = _sensor_presets(option, sources)
        if kind in switched_on and not presets:
            presets = [True]
        if presets:
            values = join_layers(values, name_sensors(kind, presets))
    values |= overrides
    _note_values_without_effect(journal, values, file_values, imu)
    return values, motion


def _sensor_presets(option: str, sources: object) -> list[object]:
    """Return the preset or file of each sensor of a kind; True: the usual one.

    :param option: argument that lists the sensors.
    :param sources: its value: one entry, or several.
    :raises ConfigurationError: for an entry that is neither True nor a name or path.
    """
    entries = sources if isinstance(sources, list | tuple) else [sources]
    allowed = "a name, the path of a file, or several"
    return [entry is True or str(arguments.path(option, entry, allowed)) for entry in entries]


def _note_values_without_effect(
    journal: Journal,
    values: Mapping[str, object],
    file_values: Mapping[str, object],
    imu: object,
) -> None:
    """Note the parameters of a live node, and those by which a file overrides a preset.

    :param values: all parameters of the run by dotted name; ``file_values``: those of its files.
    :param imu: argument of the run; a name or path: the preset.
    """
    node_parameters = dict.fromkeys(
        name.partition("./")[0] for name in live_parameter_names(values)
    )
    if node_parameters:
        journal.note(f"no effect in a file: {', '.join(node_parameters)}")
    overridden = [name for name in file_values if name.startswith("imu.") and name != "imu.preset"]
    if isinstance(imu, str | Path) and overridden:
        further = f" and {len(overridden) - 3} more" if len(overridden) > 3 else ""
        journal.note(
            f"{argument_prefix('imu', str(imu))} is the base of the parameter file; "
            f"the values of the file take precedence: {', '.join(overridden[:3])}{further}"
        )


def _has_segments(segments: object) -> bool:
    """Return False for an empty list of segments, which stands for none."""
    return not isinstance(segments, tuple | list) or bool(segments)


def _on_segments(segments: object, file: object) -> dict[str, object]:
    """Return the parameters of segments: the motion of the body, or IMUs on several segments.

    :param segments: names of segments in the file of the trajectory.
    :param file: file of the trajectory.
    """
    layer, imu_names = segment_layer(segments, file)
    names = [*imu_names.values()]
    if len(names) > 1 or len(layer) > 2:  # an IMU with parameters of its own
        return layer
    return {"trajectory.topic": names[0]}


def _size(output: Path) -> int:
    """Return the bytes of an output: a folder, a file, or its parts NAME_0.EXT, NAME_1.EXT, ..."""
    files = [output]
    if output.is_dir():
        files = [*output.rglob("*")]
    elif not output.exists():
        files = [*output.parent.glob(f"{glob.escape(output.stem)}_*{glob.escape(output.suffix)}")]
    return sum(file.stat().st_size for file in files if file.is_file())


def _write_configs(
    folder: Path,
    output: str,
    body: Body,
    names: Mapping[str, str],
    format: str | None,
    journal: Journal,
) -> None:
    """Write the configuration of each supported stack, and a file of all parameters.

    :param output: name of the bag or dataset.
    :param names: name in the bag of each topic that is written.
    :param format: argument ``format`` of :func:`generate`.
    """
    from imu_sim_ros.datasets.configurations import bagcreater_topics, write_configs

    topics = bagcreater_topics(imus(body.parameters)) if format == "csv" else names
    for warning in write_configs(folder, body, topics):
        journal.warn(warning)
    note = body.note_of_scene()
    scene_line = f"\n{note}" if note else ""
    values = values_of(body.parameters)
    live_names = set(live_parameter_names(values))  # without effect on samples
    files.write(
        {name: value for name, value in values.items() if name not in live_names},
        folder / "simulation.yaml",
        comment=f"All parameters of {output}:\n"
        f"generate --params-file simulation.yaml generates the same samples.{scene_line}",
    )
