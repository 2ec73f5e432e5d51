"""Blocks of samples as messages: which topic takes which rows, and when each message is due."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.encode import (
    CLOCK,
    IMU,
    ODOMETRY,
    TEMPERATURE,
    VECTOR3_STAMPED,
    ClockEncoder,
    ImuEncoder,
    OdometryEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.config.simulation import SimulationParameters
from imu_sim_ros.config.simulator import PublishParameters
from imu_sim_ros.rotation import rotate_inverse
from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.variance import accel_variance_discrete, gyro_variance_discrete

Times = NDArray[np.int64]
Bytes = NDArray[np.uint8]

__all__ = ["CLOCK", "Output", "clock_messages", "imu_outputs", "truth_output"]

Encode = Callable[[ImuBlock, SimulationParameters], tuple[Times, Bytes]]


class Output(NamedTuple):
    """One topic of one simulated IMU."""

    topic: str
    """Relative to the node's namespace."""
    type_name: str
    encode: Encode
    """Returns when each message of a block is due (m,) [ns], and the messages (m, size)."""


def imu_outputs(
    parameters: SimulationParameters, publish: PublishParameters, prefix: str = ""
) -> Iterator[Output]:
    """Yield the topics of an IMU.

    :param prefix: empty, or the IMU's own namespace and a slash.
    """
    readings = ImuEncoder(parameters.imu_frame)
    yield Output(f"{prefix}imu/data_raw", IMU, _Readings(readings))
    if publish.ground_truth_imu:
        yield Output(
            f"{prefix}ground_truth/imu",
            IMU,
            lambda block, _: (
                block.true_t_ns,
                readings.encode(block.true_t_ns, block.ideal_gyro, block.ideal_accel),
            ),
        )
    if publish.biases:
        vectors = Vector3StampedEncoder(parameters.imu_frame)
        yield Output(
            f"{prefix}ground_truth/gyroscope_bias",
            VECTOR3_STAMPED,
            lambda block, _: (
                block.true_t_ns,
                vectors.encode(block.true_t_ns, block.gyro_bias),
            ),
        )
        yield Output(
            f"{prefix}ground_truth/accelerometer_bias",
            VECTOR3_STAMPED,
            lambda block, _: (
                block.true_t_ns,
                vectors.encode(block.true_t_ns, block.accel_bias),
            ),
        )
    if publish.temperature:
        temperatures = TemperatureEncoder(parameters.imu_frame)
        yield Output(
            f"{prefix}imu/temperature",
            TEMPERATURE,
            lambda block, _: (
                block.true_t_ns,
                temperatures.encode(block.true_t_ns, block.temperature),
            ),
        )


class _Readings:
    """The readings, with the variances of their white noise; they leave when the driver says."""

    def __init__(self, encoder: ImuEncoder) -> None:
        self._encoder = encoder

    def __call__(self, block: ImuBlock, parameters: SimulationParameters) -> tuple[Times, Bytes]:
        rows = block.delivered
        messages = self._encoder.encode(
            block.t_ns[rows],
            block.gyro[rows],
            block.accel[rows],
            gyro_variance_discrete(parameters.imu, parameters.rate),
            accel_variance_discrete(parameters.imu, parameters.rate),
        )
        return block.release_t_ns[rows], messages


def truth_output(parameters: SimulationParameters) -> Output:
    """Return the topic of the body's true motion."""
    encoder = OdometryEncoder(parameters.world_frame, parameters.body_frame)

    def encode(block: ImuBlock, _: SimulationParameters) -> tuple[Times, Bytes]:
        motion = block.motion
        velocity_b = rotate_inverse(motion.q_wb, motion.velocity)
        t_ns = block.true_t_ns
        return t_ns, encoder.encode(
            t_ns, motion.position, motion.q_wb, velocity_b, motion.angular_velocity
        )

    return Output("ground_truth/odom", ODOMETRY, encode)


def clock_messages(t_ns: Times) -> Bytes:
    """Return messages of ``/clock``."""
    return ClockEncoder().encode(t_ns)
