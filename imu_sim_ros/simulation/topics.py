# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation: a block of samples as the messages of each of them.

One home for what the simulator node publishes and the command ``generate`` writes, so that both are
the same bytes.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import RowTemplate, as_row_template
from imu_sim_ros.bags.messages.encode import (
    IMU,
    NAV_SAT_FIX,
    ODOMETRY,
    POSE_STAMPED,
    TEMPERATURE,
    VECTOR3_STAMPED,
    ImuEncoder,
    NavSatFixEncoder,
    OdometryEncoder,
    PoseStampedEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE, TransformsEncoder
from imu_sim_ros.conventions import (
    DELTA_ANGLE_TOPIC,
    DELTA_VELOCITY_TOPIC,
    ERROR_TOPICS,
    ERRORS,
    IDEAL_DELTA_ANGLE_TOPIC,
    IDEAL_DELTA_VELOCITY_TOPIC,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TEMPERATURE_TOPIC,
    TF_STATIC_TOPIC,
    TF_TOPIC,
    TRUTH_FIX_TOPIC,
    TRUTH_POSE_TOPIC,
    TRUTH_TOPIC,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.rotation import from_matrix, rotate_inverse
from imu_sim_ros.sensors import auxiliary_sensors
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.declaration import Sensor, Topic
from imu_sim_ros.sensors.errors.noise import (
    accel_variance_discrete,
    gyro_variance_discrete,
)
from imu_sim_ros.sensors.gravity import geodetic
from imu_sim_ros.sensors.imu.model import ImuSample
from imu_sim_ros.sensors.orientation.declaration import TOPIC as ORIENTATION_TOPIC
from imu_sim_ros.sensors.registry import find_sensor
from imu_sim_ros.simulation.parameters import SampledParameters, carried, carried_frames
from imu_sim_ros.types import Array, Times

OF_THE_ERROR_MODEL: Final = (
    *(IMU_TOPIC, ORIENTATION_TOPIC, TEMPERATURE_TOPIC, IDEAL_IMU_TOPIC),
    *ERROR_TOPICS,
)
"""Topics that an error model has for the readings of somebody else."""
OF_THE_BODY: Final = (TRUTH_TOPIC, TRUTH_FIX_TOPIC)
"""Topics that several IMUs on one body have in common."""
TRANSFORMS, MOUNTINGS = TF_TOPIC.strip("/"), TF_STATIC_TOPIC.strip("/")


class Messages(NamedTuple):
    """The m messages of one topic in a block."""

    t_ns: Times
    """(m,) stamps; a bag takes them as record times."""
    due_t_ns: Times
    """(m,) when the driver would release them [ns]."""
    payloads: RowTemplate
    """The messages."""


class TextMessages(NamedTuple):
    """The m messages of a serial line in a block."""

    due_t_ns: Times
    """(m,) when the driver would release them [ns]."""
    payloads: list[bytes]


Encode = Callable[[ImuBlock, SampledParameters], Messages]
"""Turns a block into messages; the parameters are those valid for the block."""
EncodeOne = Callable[[ImuSample, SampledParameters], bytes]
"""Turns a sample into a message."""


def types(carried: Iterable[str] = ()) -> dict[str, str]:
    """Return the types of all topics by name.

    :param carried: names of sensors of the body.
    """
    own = {topic.name: topic.type for name in carried for topic in topics_of(name)}
    return TYPES | OF_A_BAG | own


def topics_of(sensor: str) -> tuple[Topic, ...]:
    """Return the topics of a sensor of the body."""
    return find_sensor(sensor).topics


def encoder(topic: str, parameters: SampledParameters, encoding: str = "cdr") -> Encode:
    """Return the encoder of a topic's messages.

    Readings have the stamps of the sensor's clock, and only delivered ones become messages;
    everything else has the true times.

    :param topic: one of :func:`types` of the sensors of the body in the parameters.
    :param encoding: ``cdr`` or ``ros1``.
    :raises ConfigurationError: for increments of a sensor whose readings are not means.
    """
    own = _LIVE.get(topic) or _BAG.get(topic)
    if own is not None:
        return own.make(parameters, encoding)
    sensor, of_body = next(
        (find_sensor(name), one)
        for name in carried(parameters)
        for one in topics_of(name)
        if one.name == topic
    )
    return _of_a_sensor(sensor, of_body, parameters, encoding)


def is_published(topic: str, publish: Any) -> bool:
    """Return whether a node publishes a topic, one of :data:`TYPES`.

    :param publish: the section ``publish``.
    """
    return all(getattr(publish, flag) for flag in _LIVE[topic].flags)


def encoder_of_one(topic: str, parameters: SampledParameters) -> EncodeOne:
    """Return the encoder of single messages of an IMU's topic, the same bytes as of a block.

    :param topic: readings, ideal readings, true errors or temperature.
    """
    frame = parameters.imu_frame
    if topic == IMU_TOPIC:
        readings = _with_variances(parameters, "cdr")
        return lambda s, now: readings(now).one(s.t_ns, s.gyro, s.accel)
    if topic == IDEAL_IMU_TOPIC:
        ideal = ImuEncoder(frame)
        return lambda s, _: ideal.one(s.true_t_ns, s.ideal_gyro, s.ideal_accel)
    if topic == TEMPERATURE_TOPIC:
        thermometer = TemperatureEncoder(frame)
        return lambda s, _: thermometer.one(s.true_t_ns, (s.temperature,))
    vectors = Vector3StampedEncoder(frame)
    if topic not in ERROR_TOPICS:
        raise ConfigurationError(f"topic {topic}: has no single messages")
    triad, _, error = ERROR_TOPICS[topic].partition("_")
    begin = 3 * ERRORS.index(error)
    own = slice(begin, begin + 3)
    if triad == "gyro":
        return lambda s, _: vectors.one(s.true_t_ns, s.of_gyro[own])
    return lambda s, _: vectors.one(s.true_t_ns, s.of_accel[own])


def sensors_of(topics: Iterable[str], carried: Iterable[str] = ()) -> frozenset[str]:
    """Return what has to be measured in addition to the IMU for topics, keys of :func:`types`.

    :param carried: names of sensors of the body.
    """
    wanted = set(topics)
    return frozenset(
        sensor.quantity
        for sensor in (*auxiliary_sensors(), *map(find_sensor, carried))
        if any(topic.name in wanted for topic in sensor.topics)
    )


def delivered(block: ImuBlock) -> tuple[Times, Array, Array]:
    """Return stamps, angular rates and specific forces of the readings that are delivered."""
    rows = block.delivered
    if _is_all(block):
        return block.t_ns, block.gyro, block.accel
    return block.t_ns[rows], block.gyro[rows], block.accel[rows]


def _is_all(block: ImuBlock) -> bool:
    rows, count = block.delivered, len(block.t_ns)
    return len(rows) == count and (count == 1 or bool(np.array_equal(rows, np.arange(count))))


def _variances(parameters: SampledParameters) -> tuple[Vector, Vector]:
    """Return the variances of one sample of gyroscope and accelerometer."""
    imu, rate = parameters.imu, parameters.rate
    return gyro_variance_discrete(imu, rate), accel_variance_discrete(imu, rate)


def _with_variances(
    parameters: SampledParameters, encoding: str
) -> Callable[[SampledParameters], ImuEncoder]:
    """Return a function that gives the encoder with the variances of parameters."""
    known: SampledParameters | None = None
    readings: ImuEncoder

    def at(now: SampledParameters) -> ImuEncoder:
        nonlocal known, readings
        if now is not known:
            known, readings = now, ImuEncoder(parameters.imu_frame, encoding, *_variances(now))
        return readings

    return at


def _readings(parameters: SampledParameters, encoding: str) -> Encode:
    readings = _with_variances(parameters, encoding)

    def encode(block: ImuBlock, now: SampledParameters) -> Messages:
        t_ns, gyro, accel = delivered(block)
        payloads = readings(now).pattern(t_ns, gyro, accel)
        return Messages(t_ns, block.release_t_ns[block.delivered], payloads)

    return encode


def _truth(parameters: SampledParameters, encoding: str) -> Encode:
    odometry = OdometryEncoder(parameters.world_frame, parameters.body_frame, encoding)

    def messages(block: ImuBlock) -> RowTemplate:
        motion = block.motion
        velocity_b = rotate_inverse(motion.q_wb, motion.velocity)
        return odometry.pattern(
            block.true_t_ns, motion.position, motion.q_wb, velocity_b, motion.angular_velocity
        )

    return _at_true_times(messages)


def _fix(parameters: SampledParameters, encoding: str) -> Encode:
    fixes = NavSatFixEncoder(parameters.body_frame, encoding)

    def messages(block: ImuBlock) -> RowTemplate:
        return fixes.pattern(block.true_t_ns, *geodetic(parameters, block.motion.position))

    return _at_true_times(messages)


def _pose(parameters: SampledParameters, encoding: str) -> Encode:
    poses = PoseStampedEncoder(parameters.world_frame, encoding)

    def messages(block: ImuBlock) -> RowTemplate:
        motion = block.motion
        return poses.pattern(block.true_t_ns, motion.position, motion.q_wb)

    return _at_true_times(messages)


def _transforms(parameters: SampledParameters, encoding: str) -> Encode:
    frames = TransformsEncoder([(parameters.world_frame, parameters.body_frame)], encoding)

    def messages(block: ImuBlock) -> RowTemplate:
        position, q_wb = block.motion.position[:, None], block.motion.q_wb[:, None]
        return as_row_template(frames.encode(block.true_t_ns, position, q_wb))

    return _at_true_times(messages)


def mountings(
    imus: Iterable[SampledParameters], body: SampledParameters, encoding: str = "cdr"
) -> Encode:
    """Return the encoder of the transforms from the body to its IMUs, and to what it carries.

    They are one message, with the first sample's time.

    :param imus: the parameters of each; at least one.
    :param body: the parameters of the simulation that has the sensors of the body.
    """
    placed = list(imus)
    others = {f: arm for f, arm in carried_frames(body).items() if f != body.body_frame}
    named = [(one.body_frame, one.imu_frame) for one in placed]
    frames = TransformsEncoder([*named, *((body.body_frame, f) for f in others)], encoding)
    turns = [np.reshape(one.imu.mounting, (3, 3)) for one in placed] + [np.eye(3)] * len(others)
    given = [*(one.imu.lever_arm for one in placed), *others.values()]
    arms = np.array(given, dtype=np.float64)
    rotations, written = from_matrix(np.stack(turns)), False

    def encode(block: ImuBlock, _: SampledParameters) -> Messages:
        nonlocal written
        t_ns = block.true_t_ns[: 0 if written else 1]
        written = written or len(t_ns) > 0
        count = len(t_ns)
        shape = (count, *arms.shape), (count, *rotations.shape)
        rows = frames.encode(
            t_ns, np.broadcast_to(arms, shape[0]), np.broadcast_to(rotations, shape[1])
        )
        return Messages(t_ns, t_ns, as_row_template(rows))

    return encode


def _of_a_sensor(
    sensor: Sensor, topic: Topic, parameters: SampledParameters, encoding: str
) -> Encode:
    """Return the source of a topic of an auxiliary sensor."""
    of_body = carried(parameters).get(sensor.name)
    frame = parameters.imu_frame if of_body is None else of_body.frame or parameters.body_frame
    frame = parameters.world_frame if topic.in_world else frame
    payloads = topic.payloads(frame, encoding)

    def encode(block: ImuBlock, valid: SampledParameters) -> Messages:
        now = valid if of_body is None else getattr(valid, sensor.name)
        read = block.auxiliary.get(sensor.quantity)
        if read is None:
            what = sensor.quantity.replace("_", " ")
            raise ConfigurationError(f"topic {topic.name}: no {what} was simulated")
        if topic.truth:
            times = read.true_t_ns
            return Messages(times, times, payloads(read, slice(None), block, now))
        rows = read.delivered
        if topic.sent is not None:
            rows = rows[topic.sent(read)[rows]]
        return Messages(read.t_ns[rows], read.release_t_ns[rows], payloads(read, rows, block, now))

    return encode


def _increments(
    topic: str, means: str, truth: bool, parameters: SampledParameters, encoding: str
) -> Encode:
    """Return the source of increments: mean readings times the nominal interval."""
    if parameters.imu.sampling != "averaged":
        raise ConfigurationError(
            f"topic {topic}: needs imu.sampling averaged; it is {parameters.imu.sampling}"
        )
    vectors = Vector3StampedEncoder(parameters.imu_frame, encoding)
    interval = 1.0 / parameters.rate
    if truth:
        return _at_true_times(lambda b: vectors.pattern(b.true_t_ns, getattr(b, means) * interval))

    def encode(block: ImuBlock, _: SampledParameters) -> Messages:
        rows = block.delivered
        t_ns = block.t_ns[rows]
        payloads = vectors.pattern(t_ns, getattr(block, means)[rows] * interval)
        return Messages(t_ns, block.release_t_ns[rows], payloads)

    return encode


def _at_true_times(payloads: Callable[[ImuBlock], RowTemplate]) -> Encode:
    return lambda block, _: Messages(block.true_t_ns, block.true_t_ns, payloads(block))


def _true(encoder: Any, *columns: str) -> "Make":
    """Return what makes the encoder of columns of a block."""

    def make(parameters: SampledParameters, encoding: str) -> Encode:
        messages = encoder(parameters.imu_frame, encoding)
        return _at_true_times(
            lambda b: messages.pattern(b.true_t_ns, *(getattr(b, name) for name in columns))
        )

    return make


Make = Callable[[SampledParameters, str], Encode]


class _Topic(NamedTuple):
    type: str
    make: Make
    """Makes the encoder, for parameters and an encoding."""
    flags: tuple[str, ...] = ()
    """The parameters ``publish.*`` that must all be true for a node to publish it."""


_BAG: Final = {
    TRANSFORMS: _Topic(TF_MESSAGE, _transforms),
    MOUNTINGS: _Topic(TF_MESSAGE, lambda given, encoding: mountings([given], given, encoding)),
    TRUTH_POSE_TOPIC: _Topic(POSE_STAMPED, _pose),
}
_ANGLE: Final = functools.partial(_increments, DELTA_ANGLE_TOPIC, "gyro", False)
_VELOCITY: Final = functools.partial(_increments, DELTA_VELOCITY_TOPIC, "accel", False)
_IDEAL_ANGLE: Final = functools.partial(_increments, IDEAL_DELTA_ANGLE_TOPIC, "ideal_gyro", True)
_IDEAL_VELOCITY: Final = functools.partial(
    _increments, IDEAL_DELTA_VELOCITY_TOPIC, "ideal_accel", True
)
_LIVE: Final = {
    IMU_TOPIC: _Topic(IMU, _readings),
    TRUTH_TOPIC: _Topic(ODOMETRY, _truth, ("ground_truth",)),
    TRUTH_FIX_TOPIC: _Topic(NAV_SAT_FIX, _fix, ("ground_truth_fix",)),
    IDEAL_IMU_TOPIC: _Topic(
        IMU, _true(ImuEncoder, "ideal_gyro", "ideal_accel"), ("ground_truth_imu",)
    ),
    **{
        topic: _Topic(
            VECTOR3_STAMPED,
            _true(Vector3StampedEncoder, column),
            ("biases" if column.endswith("_bias") else "errors",),
        )
        for topic, column in ERROR_TOPICS.items()
    },
    TEMPERATURE_TOPIC: _Topic(
        TEMPERATURE, _true(TemperatureEncoder, "temperature"), ("temperature",)
    ),
    DELTA_ANGLE_TOPIC: _Topic(VECTOR3_STAMPED, _ANGLE, ("increments",)),
    DELTA_VELOCITY_TOPIC: _Topic(VECTOR3_STAMPED, _VELOCITY, ("increments",)),
    IDEAL_DELTA_ANGLE_TOPIC: _Topic(VECTOR3_STAMPED, _IDEAL_ANGLE, ("ground_truth_increments",)),
    IDEAL_DELTA_VELOCITY_TOPIC: _Topic(
        VECTOR3_STAMPED, _IDEAL_VELOCITY, ("ground_truth_increments",)
    ),
    **{
        topic.name: _Topic(topic.type, functools.partial(_of_a_sensor, sensor, topic), topic.flags)
        for sensor in auxiliary_sensors()
        for topic in sensor.topics
    },
}
TYPES: Final = {name: topic.type for name, topic in _LIVE.items()}
OF_A_BAG: Final = {name: topic.type for name, topic in _BAG.items()}
"""Topics of the body that a bag holds on request; the node has its own publishers of transforms."""
