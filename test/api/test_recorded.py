# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded sensors as arrays, and evaluation of paths and of attitudes alone."""

import numpy as np
import pytest

import imu_sim_ros as ims

TOPICS = ("imu/data_raw", "ground_truth/odom", "imu/mag", "imu/data", "imu/pressure")


@pytest.fixture(scope="module")
def flight():
    sensors = ["magnetic_field", "pressure", "orientation"]
    return ims.simulate(imu="mti3", trajectory="figure_eight", duration=3, seed=2, sensors=sensors)


@pytest.fixture(scope="module")
def bag(flight, tmp_path_factory):
    return flight.save(tmp_path_factory.mktemp("bag") / "flight.mcap", topics=TOPICS)


def test_what_was_simulated_is_read_back(flight, bag):
    field, pressure = ims.read_magnetometer(bag), ims.read_pressure(bag)
    orientation = ims.read_orientation(bag, "imu/data")
    assert np.array_equal(field.values, flight.magnetic_field.field)
    assert np.array_equal(pressure.values, flight.pressure.pressure)
    assert np.array_equal(field.t_ns, flight.magnetic_field.t_ns)
    assert pressure.covariance.shape == (len(pressure),)
    # float64 there and back, signs of quaternions as written
    assert np.allclose(orientation.values, flight.orientation.q_wi, atol=1e-15)


def test_the_message_without_such_a_sensor_names_the_file(flight, tmp_path):
    path = flight.save(tmp_path / "plain.mcap")
    for read_function in (
        ims.read_magnetometer,
        ims.read_pressure,
        ims.read_orientation,
        ims.read_images,
    ):
        with pytest.raises(ims.InputError, match=r"plain\.mcap"):
            read_function(path)


def test_a_path_is_evaluated_like_what_it_holds(flight, bag, tmp_path):
    track = ims.dead_reckon(flight)
    track.save(tmp_path / "track.csv")
    of_objects = ims.evaluate(track, flight.truth)
    of_paths = ims.evaluate(tmp_path / "track.csv", str(bag))
    # The text has twelve digits.
    assert np.isclose(of_paths.rms_position, of_objects.rms_position, rtol=1e-6)
    assert np.isclose(of_paths.rms_attitude, of_objects.rms_attitude, rtol=1e-3)
    with pytest.raises(ims.ConfigurationError, match="estimate_topic"):
        ims.evaluate(track, flight.truth, estimate_topic="x")


def test_attitudes_alone_are_evaluated(flight, bag):
    simulated = ims.evaluate(flight.orientation, flight.truth)
    recorded = ims.evaluate(ims.read_orientation(bag), bag)
    assert np.isclose(simulated.rms_tilt, recorded.rms_tilt, rtol=1e-9)
    assert simulated.rms_attitude == pytest.approx(
        np.hypot(simulated.rms_tilt, simulated.rms_heading), rel=0.01
    )  # small angles about perpendicular axes
    assert 0.005 < simulated.rms_tilt < 0.05  # the preset states 1 degree RMS
    with pytest.raises(ims.ConfigurationError, match="align"):
        ims.evaluate(flight.orientation, flight.truth, align="yaw")
