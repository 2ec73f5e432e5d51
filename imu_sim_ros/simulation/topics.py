# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation: a block of samples as the messages of each of them.

One home for what the simulator node publishes and the command ``generate`` writes, so that both are
the same bytes.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    ACCELEROMETER_BIAS_TOPIC,
    DELTA_ANGLE_TOPIC,
    DELTA_VELOCITY_TOPIC,
    GYROSCOPE_BIAS_TOPIC,
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
from imu_sim_ros.sensors.registry import find_sensor
from imu_sim_ros.simulation.parameters import SampledParameters, carried, carried_frames
from imu_sim_ros.types import Times

TYPES: Final[dict[str, str]] = {
    IMU_TOPIC: IMU,
    TRUTH_TOPIC: ODOMETRY,
    TRUTH_FIX_TOPIC: NAV_SAT_FIX,
    IDEAL_IMU_TOPIC: IMU,
    GYROSCOPE_BIAS_TOPIC: VECTOR3_STAMPED,
    ACCELEROMETER_BIAS_TOPIC: VECTOR3_STAMPED,
    TEMPERATURE_TOPIC: TEMPERATURE,
    DELTA_ANGLE_TOPIC: VECTOR3_STAMPED,
    DELTA_VELOCITY_TOPIC: VECTOR3_STAMPED,
    IDEAL_DELTA_ANGLE_TOPIC: VECTOR3_STAMPED,
    IDEAL_DELTA_VELOCITY_TOPIC: VECTOR3_STAMPED,
    **{topic.name: topic.type for sensor in auxiliary_sensors() for topic in sensor.topics},
}
OF_THE_BODY: Final = (TRUTH_TOPIC, TRUTH_FIX_TOPIC)
"""Topics that several IMUs on one body have in common."""


TRANSFORMS, MOUNTINGS = TF_TOPIC.strip("/"), TF_STATIC_TOPIC.strip("/")
OF_A_BAG: Final = {
    TRANSFORMS: TF_MESSAGE,
    MOUNTINGS: TF_MESSAGE,
    TRUTH_POSE_TOPIC: POSE_STAMPED,
}
"""Topics of the body that a bag holds on request; the node has its own publishers of transforms."""


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
    if topic in _MAKERS:
        return _MAKERS[topic](parameters, encoding)
    sensor, own = next(
        (find_sensor(name), one)
        for name in carried(parameters)
        for one in topics_of(name)
        if one.name == topic
    )
    return _of_a_sensor(sensor, own, parameters, encoding)


def encoder_of_one(topic: str, parameters: SampledParameters) -> EncodeOne:
    """Return the encoder of single messages of an IMU's topic, the same bytes as of a block.

    :param topic: readings, ideal readings, biases or temperature.
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
    if topic == GYROSCOPE_BIAS_TOPIC:
        return lambda s, _: vectors.one(s.true_t_ns, s.of_gyro[:3])
    if topic == ACCELEROMETER_BIAS_TOPIC:
        return lambda s, _: vectors.one(s.true_t_ns, s.of_accel[:3])
    raise ConfigurationError(f"topic {topic}: has no single messages")


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


def delivered(block: ImuBlock) -> tuple[Times, NDArray[np.float64], NDArray[np.float64]]:
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
        return as_row_template(poses.encode(block.true_t_ns, motion.position, motion.q_wb))

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


def _ideal(parameters: SampledParameters, encoding: str) -> Encode:
    readings = ImuEncoder(parameters.imu_frame, encoding)
    return _at_true_times(lambda b: readings.pattern(b.true_t_ns, b.ideal_gyro, b.ideal_accel))


def _gyroscope_bias(parameters: SampledParameters, encoding: str) -> Encode:
    vectors = Vector3StampedEncoder(parameters.imu_frame, encoding)
    return _at_true_times(lambda b: vectors.pattern(b.true_t_ns, b.gyro_bias))


def _accelerometer_bias(parameters: SampledParameters, encoding: str) -> Encode:
    vectors = Vector3StampedEncoder(parameters.imu_frame, encoding)
    return _at_true_times(lambda b: vectors.pattern(b.true_t_ns, b.accel_bias))


def _temperature(parameters: SampledParameters, encoding: str) -> Encode:
    thermometer = TemperatureEncoder(parameters.imu_frame, encoding)
    return _at_true_times(lambda b: thermometer.pattern(b.true_t_ns, b.temperature))


def _of_a_sensor(
    sensor: Sensor, topic: Topic, parameters: SampledParameters, encoding: str
) -> Encode:
    """Return the source of a topic of an auxiliary sensor."""
    of_body = carried(parameters).get(sensor.name)
    frame = parameters.imu_frame if of_body is None else of_body.frame or parameters.body_frame
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
        return Messages(read.t_ns[rows], read.release_t_ns[rows], payloads(read, rows, block, now))

    return encode


def _delta_angle(parameters: SampledParameters, encoding: str) -> Encode:
    return _increments(DELTA_ANGLE_TOPIC, lambda b: b.gyro, parameters, encoding)


def _delta_velocity(parameters: SampledParameters, encoding: str) -> Encode:
    return _increments(DELTA_VELOCITY_TOPIC, lambda b: b.accel, parameters, encoding)


def _ideal_delta_angle(parameters: SampledParameters, encoding: str) -> Encode:
    return _increments(IDEAL_DELTA_ANGLE_TOPIC, lambda b: b.ideal_gyro, parameters, encoding)


def _ideal_delta_velocity(parameters: SampledParameters, encoding: str) -> Encode:
    return _increments(IDEAL_DELTA_VELOCITY_TOPIC, lambda b: b.ideal_accel, parameters, encoding)


def _increments(
    topic: str,
    means: Callable[[ImuBlock], NDArray[np.float64]],
    parameters: SampledParameters,
    encoding: str,
) -> Encode:
    """Return the source of increments: mean readings times the nominal interval."""
    if parameters.imu.sampling != "averaged":
        raise ConfigurationError(
            f"topic {topic}: needs imu.sampling averaged; it is {parameters.imu.sampling}"
        )
    vectors = Vector3StampedEncoder(parameters.imu_frame, encoding)
    interval = 1.0 / parameters.rate
    if topic in (IDEAL_DELTA_ANGLE_TOPIC, IDEAL_DELTA_VELOCITY_TOPIC):
        return _at_true_times(lambda b: vectors.pattern(b.true_t_ns, means(b) * interval))

    def encode(block: ImuBlock, _: SampledParameters) -> Messages:
        rows = block.delivered
        t_ns = block.t_ns[rows]
        payloads = vectors.pattern(t_ns, means(block)[rows] * interval)
        return Messages(t_ns, block.release_t_ns[rows], payloads)

    return encode


def _at_true_times(payloads: Callable[[ImuBlock], RowTemplate]) -> Encode:
    return lambda block, _: Messages(block.true_t_ns, block.true_t_ns, payloads(block))


_MAKERS: Final[dict[str, Callable[[SampledParameters, str], Encode]]] = {
    IMU_TOPIC: _readings,
    TRUTH_TOPIC: _truth,
    TRUTH_FIX_TOPIC: _fix,
    TRUTH_POSE_TOPIC: _pose,
    TRANSFORMS: _transforms,
    MOUNTINGS: lambda parameters, encoding: mountings([parameters], parameters, encoding),
    IDEAL_IMU_TOPIC: _ideal,
    GYROSCOPE_BIAS_TOPIC: _gyroscope_bias,
    ACCELEROMETER_BIAS_TOPIC: _accelerometer_bias,
    TEMPERATURE_TOPIC: _temperature,
    DELTA_ANGLE_TOPIC: _delta_angle,
    DELTA_VELOCITY_TOPIC: _delta_velocity,
    IDEAL_DELTA_ANGLE_TOPIC: _ideal_delta_angle,
    IDEAL_DELTA_VELOCITY_TOPIC: _ideal_delta_velocity,
    **{
        topic.name: functools.partial(_of_a_sensor, sensor, topic)
        for sensor in auxiliary_sensors()
        for topic in sensor.topics
    },
}
