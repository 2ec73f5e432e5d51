# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters in, a flight or a stream of blocks out."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias, overload

import numpy as np

from imu_sim_ros.core import arguments, timebase
from imu_sim_ros.core.arguments import number, refuse
from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems, warn
from imu_sim_ros.core.names import nearest
from imu_sim_ros.core.records import States
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.core.types import AnyArray, Array
from imu_sim_ros.formats.poses import poses_of_any_file
from imu_sim_ros.jobs.flight import Flight, Source
from imu_sim_ros.jobs.readings import check_poses, check_sensors, poses_of_rows
from imu_sim_ros.jobs.segments import Segments, segment_layer
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import EMPTY_LIST
from imu_sim_ros.parameters.sections import OF_EVERY_NODE, bad_value_lines
from imu_sim_ros.parameters.sections import parameters as described
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.imu import presets
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.engine import BLOCK_SIZE, Body
from imu_sim_ros.simulation.parameters import imus, load_simulation
from imu_sim_ros.simulation.playback import SimulatorParameters, live_parameter_names
from imu_sim_ros.simulation.sensors import imus_in
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.given import user_trajectory
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import GIVEN, PoseReader, trajectory_layer

Poses: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""A function that returns positions (n, 3) [m] and attitudes q_wb (n, 4) at times (n,) [s]."""
Moving: TypeAlias = (
    str | Path | Mapping[str, object] | States | AnyArray | Trajectory | Poses | None
)
"""Types that are accepted as a trajectory."""


@overload
def simulate(
    *,
    segments: None = None,
    imu: str | Path | Mapping[str, object] | None = None,
    trajectory: Moving = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    sensors: Collection[str] | None = None,
    **parameters: object,
) -> Flight: ...


@overload
def simulate(
    *,
    segments: Segments,
    imu: str | Path | Mapping[str, object] | None = None,
    trajectory: Moving = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    sensors: Collection[str] | None = None,
    **parameters: object,
) -> dict[str, Flight]: ...


def simulate(
    *,
    segments: Segments | None = None,
    imu: str | Path | Mapping[str, object] | None = None,
    trajectory: Moving = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    sensors: Collection[str] | None = None,
    **parameters: object,
) -> Flight | dict[str, Flight]:
    """Simulate an IMU on a moving body, with the same samples as ``generate`` and the node.

    :param imu: a name in config/imus, a parameter file or kalibr's imu.yaml, or parameters by name,
        with ``preset`` for the file that they modify.
    :param trajectory: a name in config/trajectories, a file of recorded poses, or parameters by
        name, with ``type`` for the kind or the file that they modify. Or poses, which keep their
        stamps: a :class:`States`, or an array (n, 8) of time [s], x, y, z [m], quaternion w,
        x, y, z, or (n, 7) with roll, pitch, yaw [rad]. Or a motion of your own: an object whose
        ``sample(t)`` returns a :class:`Motion`, or a function of times t (n,) [s] from the start
        that returns positions (n, 3) [m] and attitudes q_wb (n, 4); with a ``duration`` [s] if it
        ends.
    :param duration: length [s], or a text such as ``"2h"``; by default the trajectory's length.
    :param rate: samples per second [Hz].
    :param seed: seed of all random streams.
    :param params_file: a ROS 2 parameter file below all other arguments.
    :param sensors: sensors in addition to the IMU: ``magnetic_field``, ``orientation``,
        ``pressure``, or the name of a sensor of the body; by default those that the parameter file
        publishes (``publish.magnetic_field``, ...) or names.
    :param segments: names of segments in the trajectory's file, such as those of a moving person,
        or ``all``: each carries an IMU of its own, with a seed of its own. By name, the parameters
        of each IMU: ``{"LeftForeArm": {"lever_arm": [0, 0, -0.2]}}``.
    :param parameters: any other parameter by its ROS name; sections are mappings:
        ``gravity=[0, 0, -9.8]``.
    :returns: a :class:`Flight`: readings, their truth and the parameters. With ``segments`` one for
        each segment, by name. What may be unintended, such as a motion beyond the sensor's range,
        causes the same warnings as in ``generate``.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be read.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="adis16448", trajectory="figure_eight", duration=60, seed=1)
    >>> flight
    <Flight adis16448 on figure_eight: 12000 at 200 Hz, 59.995 s, seed 1>
    >>> flight.gyro.shape, flight.truth.position.shape
    ((12000, 3), (12000, 3))
    >>> warm = ims.simulate(
    ...     imu={"preset": "mpu6000", "gyroscope_bias": [0.01, 0, 0]},
    ...     trajectory={"type": "circle", "x": {"amplitude": [3.0]}, "y": {"amplitude": [3.0]}},
    ...     temperature={"value": 40.0},
    ...     duration=10,
    ... )
    >>> warm.truth.position[0].round(3)
    array([3., 0., 0.])
    """
    body, imu_names = _body(
        imu, trajectory, duration, rate, seed, params_file, sensors, segments, parameters
    )
    windows = body.windows()
    first_block = next(windows)
    samples = body.total or 0
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = memory * len(first_block[imus_in(body.sensors)[0]].t_ns) // _bytes(first_block)
    if samples > limit:
        raise ConfigurationError(
            f"{argument_prefix('duration')}: its {samples} samples, with those of all sensors, do "
            f"not fit into memory, which has room for {limit}; blocks() yields them piece by piece"
        )
    motion = body.parameters.trajectory.type
    if isinstance(trajectory, Mapping):
        motion = str(trajectory.get("type", motion))
    elif isinstance(trajectory, str | Path):
        motion = Path(trajectory).stem
    blocks = [first_block, *windows]
    if segments is None:
        name = f"{sensor_name(imu, body.parameters.imu.preset)} on {motion}"
        return Flight(body, blocks, name)
    return {
        segment: _flight_of(body, imu_name, blocks, f"{segment} of {motion}")
        for imu_name, segment in imu_names.items()
    }


def _flight_of(
    body: Body, imu_name: str, blocks: Sequence[Mapping[str, Samples]], motion: str
) -> Flight:
    """Return the flight of one IMU of several.

    :param blocks: samples of all sensors of the body by name, block by block.
    """
    space = f"{imu_name}/"
    parameters = imus(body.parameters)[imu_name]
    samples = [
        {name.removeprefix(space): block[name] for name in block if name.startswith(space)}
        for block in blocks
    ]
    source = Source(parameters, body.segments[imu_name], body.t0_ns)
    return Flight(source, samples, f"{Path(parameters.imu.preset).stem} on {motion}")


def blocks(
    *,
    imu: str | Path | Mapping[str, object] | None = None,
    trajectory: Moving = None,
    duration: float | str | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    sensors: Collection[str] | None = None,
    block_size: int = BLOCK_SIZE,
    **parameters: object,
) -> Iterator[Samples]:
    """Yield the samples of a simulation in blocks, in memory that does not grow with the duration.

    :param block_size: samples in a block; the samples do not depend on it.

    The other arguments and the errors are those of :func:`simulate`.
    :returns: an iterator over blocks of samples with their truth.

    >>> import imu_sim_ros as ims
    >>> [len(block.t_ns) for block in ims.blocks(duration="1min", rate=200, block_size=5000)]
    [5000, 5000, 2000]
    """
    body, _ = _body(imu, trajectory, duration, rate, seed, params_file, sensors, None, parameters)
    size = arguments.block_size("block_size", block_size)
    return (_block(samples) for samples in body.windows(size))


def _block(samples_by_sensor: dict[str, Samples]) -> Samples:
    """Return the samples of the IMU, with those of the other sensors."""
    block = samples_by_sensor.pop(IMU)
    return block._replace(values={**block.values, "sensors": samples_by_sensor})


def _bytes(block: object) -> int:
    """Return the size of a block's arrays, those of the other sensors' blocks within it too."""
    if isinstance(block, Mapping):
        block = tuple(block.values())
    if isinstance(block, tuple):
        return sum(map(_bytes, block))
    if not isinstance(block, np.ndarray) or 0 in block.strides:
        return 0  # a number, or one for all samples: an error that is not there
    return block.nbytes


def _body(
    imu: object,
    trajectory: object,
    duration: float | str | None,
    rate: float | None,
    seed: int | None,
    params_file: str | Path | None,
    sensors: Collection[str] | None,
    segments: object,
    parameters: Mapping[str, object],
) -> tuple[Body, dict[str, str]]:
    """Return the body of the arguments of :func:`simulate`, and its segments by IMU.

    What is allowed but may be unintended causes warnings.
    """
    file_values: dict[str, object] = {}
    sensor_names = frozenset[str]()
    problems = Problems()
    if params_file is not None:
        with problems.collect(hanging=""):
            file_values, sensor_names = _parameters_of_file(
                arguments.path("params_file", params_file)
            )
    values, overrides, motion = argument_layers(
        imu, trajectory, duration, rate, seed, parameters, problems
    )
    values |= overrides
    if sensors is not None:
        sensor_names = check_sensors(sensors, {**file_values, **values})
        quantities = [sensor.quantity for sensor in sensors_of_imus()]
        values["sensors"] = sorted(name for name in sensor_names if name not in quantities)
    segment_values, imu_names = dict[str, object](), dict[str, str]()
    if segments is not None:
        file = values.get("trajectory.file", file_values.get("trajectory.file"))
        with problems.collect():
            segment_values, imu_names = segment_layer(segments, file)
    layers = {**file_values, **segment_values, **values}
    with collect_pose_problems(layers, motion, segments is not None):
        settings = load_simulation(layers, problems=problems)
    for listing, names, supported in (
        ("imus", () if imu_names else settings.imus, "one IMU"),
        ("cameras", settings.cameras, "no cameras: see camera.images"),
    ):
        if names:
            raise ConfigurationError(
                f"{listing} = {list(names)}: simulate() and blocks() have {supported}"
            )
    body_trajectory = None
    if not imu_names:
        body_trajectory = build_trajectory(
            settings.trajectory, motion.pose_reader, motion.trajectory
        )
    segment_sensors = {f"{name}/{sensor}" for name in imu_names for sensor in (*sensor_names, POSE)}
    body_sensors = {*settings.each_sensor, POSE} | (segment_sensors or sensor_names)
    body = Body(settings, motion.pose_reader, trajectory=body_trajectory, sensors=body_sensors)
    if body.total is None:
        raise ConfigurationError(
            f"{argument_prefix('duration')}: this trajectory has no end; give one, "
            f"{argument('duration', 60, 's')}"
        )
    for line in body.warnings():
        warn(line)
    return body, imu_names


@contextmanager
def collect_pose_problems(
    layers: Mapping[str, object], motion: GivenMotion, has_segments: bool
) -> Iterator[None]:
    """Add the problems of reading poses to those of the parameters.

    Otherwise they are read later, when a trajectory is made of them.

    :param layers: parameters by dotted name.
    :param has_segments: True if segments of the file are the topics of its poses.
    """
    try:
        yield
    except ConfigurationError as error:
        file, topic = layers.get("trajectory.file"), layers.get("trajectory.topic")
        poses = Problems()
        if isinstance(file, str) and file and not has_segments:
            with poses.collect(), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                motion.pose_reader(file, *((str(topic),) if topic else ()))
        if not poses:
            raise
        raise ConfigurationError([*error.problems, *poses]) from None


def argument_layers(
    imu: object,
    trajectory: object,
    duration: float | str | None,
    rate: float | None,
    seed: int | None,
    parameters: Mapping[str, object],
    problems: Problems,
) -> tuple[dict[str, object], dict[str, object], GivenMotion]:
    """Return the parameters that the arguments of :func:`simulate` give, by dotted name.

    :param problems: receives a line for each argument that cannot be used.
    :returns: those of arguments; those in ``parameters={...}``, which win; the motion.
    """
    flat, overrides = keyword_parameters(parameters)
    values, motion = dict[str, object](), GivenMotion({})
    with problems.collect():
        values |= imu_parameters(imu)
    with problems.collect(hanging="trajectory."):
        motion = _motion(trajectory)
    values |= {**flat, **motion.parameters}
    if "trajectory.type" not in flat:  # else they describe another motion
        values.update({n: value for n, value in flat.items() if n.startswith("trajectory.")})
    scalars = {"rate": rate, "seed": seed}
    with problems.collect():
        scalars["duration"] = _seconds(duration)
    values.update({name: value for name, value in scalars.items() if value is not None})
    problems += [
        f"{argument_prefix(name, f'{scalars[name]:g}')} and parameter {name} = {overrides[name]}: "
        "two values; give one of them"
        for name in scalars
        if name in overrides
        and isinstance(scalars[name], int | float)
        and isinstance(overrides[name], int | float)
        and overrides[name] != scalars[name]
    ]
    return values, overrides, motion


def _seconds(duration: float | str | None) -> float | None:
    """Return a duration in seconds; texts have a unit: 10min."""
    if isinstance(duration, str):
        try:
            return timebase.parse_duration(duration)
        except ValueError as error:
            raise ConfigurationError(f"{argument_prefix('duration')}: {error}") from None
    if duration is None:
        return None
    return number("duration", duration, "seconds, or words such as '2h'", 0.0)


def _parameters_of_file(path: Path) -> tuple[dict[str, object], frozenset[str]]:
    """Return the simulation's parameters of a file, and the sensors that it publishes.

    A parameter file of the node simulator is accepted, too.
    """
    values = presets.load(path)
    node_parameters = live_parameter_names(values)
    declared = {**OF_EVERY_NODE, **described(SimulatorParameters)}
    problems = bad_value_lines(declared, {name: values[name] for name in node_parameters}).values()
    if problems:
        raise ConfigurationError([f"{path}: {line}" for line in problems])
    unset = [name for name in ("imus", "cameras") if values.get(name) in ((), [], EMPTY_LIST)]
    simulation_values = {
        n: value for n, value in values.items() if n not in (*node_parameters, *unset)
    }
    published = (sensor.quantity for sensor in sensors_of_imus())
    return simulation_values, frozenset(
        name for name in published if values.get(f"publish.{name}") is True
    )


class GivenMotion(NamedTuple):
    """Motion that an argument ``trajectory`` describes: parameters, poses or an object."""

    parameters: Mapping[str, object]
    """Parameters of the trajectory by dotted name."""
    pose_reader: PoseReader = poses_of_any_file
    """Function that returns the recorded poses of ``trajectory.file``."""
    trajectory: Trajectory | None = None
    """Trajectory of the user; None: the parameters describe it."""


def _motion(trajectory: object) -> GivenMotion:
    """Return the motion that an argument ``trajectory`` of any of its types describes.

    :raises ConfigurationError: for anything else.
    """
    if trajectory is None:
        return GivenMotion({})
    if isinstance(trajectory, np.ndarray):
        trajectory = poses_of_rows(trajectory)
    if isinstance(trajectory, States):
        parameters = {"trajectory.type": "poses", "trajectory.file": "poses given as arrays"}
        poses = check_poses("trajectory", trajectory)

        def given_poses(_: object, topic: str | None = None, *__: object) -> States:
            if topic is not None:
                raise InputError(f"trajectory: poses given as arrays have no segment {topic}")
            return poses

        return GivenMotion(parameters, given_poses)
    if isinstance(trajectory, Mapping):
        flat = files.dotted_values(trajectory, "trajectory")
        return GivenMotion({f"trajectory.{name}": value for name, value in flat.items()})
    if isinstance(trajectory, str | PathLike):
        path = arguments.path("trajectory", trajectory, "a name or the path of a file")
        return GivenMotion(trajectory_layer(str(path)))
    own_trajectory = user_trajectory(trajectory)
    if own_trajectory is None:
        refuse(
            "trajectory",
            trajectory,
            "a name, a file, parameters by name, a States, an array (n, 8): time [s], "
            "x, y, z [m], quaternion w, x, y, z; an object with sample(t), or a function of time "
            "that returns positions (n, 3) and attitudes (n, 4)",
            wrong_type=True,
        )
    return GivenMotion({"trajectory.type": GIVEN}, trajectory=own_trajectory)


def sensor_name(imu: object, preset: str) -> str:
    """Return the name of the simulated IMU in summaries: its preset, or a modified one."""
    changed = isinstance(imu, Mapping) and set(imu) - {"preset"}
    return f"{'modified ' if changed else ''}{Path(preset).stem}"


def imu_parameters(imu: object) -> dict[str, object]:
    """Return the parameters of a given IMU, by dotted name."""
    if imu is None:
        return {}
    if isinstance(imu, Mapping):
        parameters = files.dotted_values(imu, "imu")
        # A model of Gazebo states these with its sensor (from_sdf).
        run_parameters: dict[str, object] = {
            name: parameters.pop(name) for name in ("rate", "imu_frame") if name in parameters
        }
        return {**run_parameters, **{f"imu.{name}": value for name, value in parameters.items()}}
    allowed = "a name, the path of a file, or parameters by name"
    return {"imu.preset": str(arguments.path("imu", imu, allowed))}


def keyword_parameters(
    parameters: Mapping[str, object],
) -> tuple[dict[str, object], dict[str, object]]:
    """Return keyword arguments by dotted name, and those in ``parameters={...}``, which win."""
    overrides = parameters.get("parameters", {})
    if not isinstance(overrides, Mapping):
        refuse("parameters", overrides, "parameters by name", wrong_type=True)
    keywords = {name: value for name, value in parameters.items() if name != "parameters"}
    for name in keywords:
        argument = nearest(name, _ARGUMENTS, 0.8)
        if argument is not None and not _is_parameter(name):
            raise ConfigurationError(f"{name}: unknown argument; did you mean {argument}?")
    return files.dotted_values(keywords, "parameters"), files.dotted_values(overrides, "parameters")


_ARGUMENTS: Final = (
    *("imu", "trajectory", "segments", "duration", "rate", "seed", "params_file", "sensors"),
)
"""Arguments that are no parameters by the same name, or are offered first."""


def _is_parameter(name: str) -> bool:
    """Return True for a parameter, and for a section or another name that a section begins."""
    parameters = described(SimulatorParameters)
    return name in parameters or any(
        key.startswith(f"{name.partition('.')[0]}.") for key in parameters
    )
