# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live readings in other units, of one of two frames, and without a triad."""

import numpy as np
import pytest

from imu_sim_ros.bags.messages.encode import ImuEncoder
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.nodes.messages import ReadingDecoder, imu_reading
from imu_sim_ros.sensors.parameters import LiveReadingParameters
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters, load_error_model

GYRO, ACCEL = (0.1, -20.0, 3.0), (0.01, 0.02, 1.0)


def payload(frame="imu_link", gyro_covariance=0.0, accel_covariance=0.0):
    encoder = ImuEncoder(frame, "cdr", gyro_covariance, accel_covariance)
    (message,) = encoder.encode(np.array([10**9]), np.array([GYRO]), np.array([ACCEL]))
    return message.tobytes()


@pytest.mark.parametrize(
    ("unit", "factor"), [("m/s^2", 1.0), ("g", STANDARD_GRAVITY), ("mg", 1e-3 * STANDARD_GRAVITY)]
)
def test_units_of_messages_are_converted_and_said(unit, factor):
    decoder = ReadingDecoder(LiveReadingParameters(gyro_unit="deg/s", accel_unit=unit))
    reading = decoder.reading(payload())
    np.testing.assert_allclose(reading.gyro, np.radians(GYRO), rtol=1e-15)
    np.testing.assert_allclose(reading.accel, factor * np.array(ACCEL), rtol=1e-15)
    triads = ["gyroscope", "accelerometer"][: 1 + (unit != "m/s^2")]
    assert [line.split(" is read in ")[0] for line in decoder.notes()] == [
        f"the {triad}" for triad in triads
    ]


@pytest.mark.parametrize(
    ("covariances", "triads"),
    [
        ((-1.0, 0.0), "of the gyroscope \\(covariance -1\\)"),
        ((0.0, -1.0), "of the accelerometer \\(covariance -1\\)"),
        ((-1.0, -1.0), "of the gyroscope and the accelerometer"),
    ],
)
def test_a_triad_with_a_covariance_of_minus_one_is_absent(covariances, triads):
    """Zeros beside a covariance of -1 are not readings (sensor_msgs/Imu)."""
    for decode in (imu_reading, ReadingDecoder(LiveReadingParameters()).reading):
        with pytest.raises(InputError, match=f"contains no readings {triads}"):
            decode(payload("imu_link", *covariances))
    assert imu_reading(payload()).accel == ACCEL


def test_of_two_frames_one_is_chosen_or_the_second_is_refused():
    port, starboard = payload("left_imu"), payload("right_imu")
    chosen = ReadingDecoder(LiveReadingParameters(frame="right_imu"))
    assert chosen.reading(port) is None
    assert chosen.reading(starboard).accel == ACCEL
    assert chosen.notes() == ("readings of the frame right_imu only",)
    decoder = ReadingDecoder(LiveReadingParameters())
    for _ in range(200):
        assert decoder.reading(port) is not None
        with pytest.raises(InputError, match="two frames, 'left_imu' and 'right_imu': frame"):
            decoder.reading(starboard)


def test_a_publisher_that_starts_again_with_another_frame_is_followed():
    decoder = ReadingDecoder(LiveReadingParameters())
    decoder.reading(payload("before"))
    refused = 0
    for _ in range(150):
        try:
            decoder.reading(payload("after"))
        except InputError:
            refused += 1
    assert refused == 100


def test_nodes_take_frame_and_units():
    values = {"frame": "left_imu", "gyro_unit": "deg/s", "accel_unit": "mg"}
    assert load_integrator(values).accel_unit == "mg"
    assert load_error_model(values, ErrorNodeParameters).gyro_unit == "deg/s"
    with pytest.raises(ConfigurationError, match="accel_unit = 'gee': must be one of"):
        load_integrator({"accel_unit": "gee"})
    with pytest.raises(ConfigurationError, match="frame: has no effect on odometry"):
        load_error_model({"odometry": True, "frame": "left_imu"}, ErrorNodeParameters)
