# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""pyins' filter with fixes, velocities and odometry of a drive on the turning, curved Earth.

Its errors over their standard deviations are standard normal on each axis: the sum of squares over
n independent seeds is chi-square of n, in a band of 99.9 % for each of a few numbers.
"""

import numpy as np
import pytest
from scipy.stats import chi2

import imu_sim_ros as ims
from imu_sim_ros.core import rotation

pytest.importorskip("pyins")
ENU_FROM_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])
START = {"position": 0.5, "velocity": 0.1, "level": 0.05, "azimuth": 0.5}  # m, m/s, deg, deg
NOISE = {"gyroscope_noise_density": 2e-4, "accelerometer_noise_density": 2e-3}
FIX, SPEED, WHEEL = 0.5, 0.1, 0.2
ARM = [0.4, 0.0, 1.0]
SEEDS = 30
DRIVE = {
    "imu": {"preset": "perfect", **NOISE},
    "trajectory": {"type": "drive", "positions": [0, 0, 60, 0, 60, 40, 0, 40], "rest_before": 1.0},
    "rate": 50.0,
    "sensors": ["gnss", "wheels"],
    "latitude_deg": 48.0,
    "longitude_deg": 11.0,
    "gravity_model": "wgs84",
    "earth_rotation": True,
    "curved_earth": True,
}
GNSS = {
    "rate": 1.0,
    "white_share": 1.0,
    "horizontal_sigma": [FIX] * 4,
    "vertical_sigma": [FIX] * 4,
    "velocity_sigma": SPEED,
    "lever_arm": ARM,
    "sky": "constant",  # the same deviation on each axis, as the filter takes it
}


def filtered(seed, duration, outage=(), stated=1.0, wheels=True, folder=None, time_step=0.5):
    """Return the filter's times (n,), and position errors (n, 3) over their standard deviations.

    The noise of odometry is added here, as pyins takes it: white, on each axis. Wheels without slip
    and counts give means over 20 ms, which lag by 0.015 m/s at 1.5 m/s^2.

    :param duration: of the drive [s].
    :param outage: start and length of one [s].
    :param stated: variance of fixes and velocities that the filter is told, over the true one.
    :param folder: where a bag is written, of whose messages the velocities are.
    :param time_step: longest step of the filter's covariance [s].
    """
    from pandas import DataFrame, Index, Series
    from pyins import filters, inertial_sensor, strapdown, transform
    from pyins.util import LLA_COLS, RPH_COLS, VEL_COLS

    gnss = {**GNSS, "outages": list(outage)}
    encoders = {"rate": 50.0, "slip_noise": 0.0, "encoder_noise": 0.0, "ticks": 0}
    flight = ims.simulate(seed=seed, duration=duration, gnss=gnss, wheels=encoders, **DRIVE)
    truth = flight.truth
    t = (flight.t_ns - flight.t_ns[0]) * 1e-9
    draw = np.random.default_rng(seed)
    r_nb = ENU_FROM_NED.T @ rotation.to_matrix(truth.q_wb) @ FLU_FROM_FRD
    lla = truth_places(flight)
    sigmas = np.repeat([START["position"], START["velocity"]], 3)
    moved = sigmas * draw.standard_normal(6)
    turned = np.array([START["level"], START["level"], START["azimuth"]]) * draw.standard_normal(3)
    start = Series(
        [
            *transform.perturb_lla(lla[0], moved[:3]),
            *(ENU_FROM_NED.T @ truth.velocity[0] + moved[3:]),
            *(transform.mat_to_rph(r_nb[0]) + turned),
        ],
        index=LLA_COLS + VEL_COLS + RPH_COLS,
        name=0.0,
    )
    imu = DataFrame(
        np.column_stack([flight.gyro @ FLU_FROM_FRD, flight.accel @ FLU_FROM_FRD]),
        columns=strapdown.GYRO_COLS + strapdown.ACCEL_COLS,
        index=Index(t, name="time"),
    )
    velocity = (
        flight.gnss.velocity
        if folder is None
        else velocities_of_bag(flight, folder / f"{seed}.mcap")
    )
    aiding = aids(flight, velocity, draw, stated, wheels)
    result = filters.run_feedback_filter(
        start,
        *START.values(),
        strapdown.compute_increments_from_imu(imu, "rate"),
        inertial_sensor.EstimationModel(noise=NOISE["gyroscope_noise_density"]),
        inertial_sensor.EstimationModel(noise=NOISE["accelerometer_noise_density"]),
        aiding,
        time_step=time_step,
    )
    sd = result.trajectory_sd
    rows = np.round(sd.index.to_numpy() * DRIVE["rate"]).astype(int)
    coordinates = result.trajectory.loc[sd.index, LLA_COLS].to_numpy()
    error = transform.compute_lla_difference(coordinates, lla[rows])
    return sd.index.to_numpy(), error / sd[["north", "east", "down"]].to_numpy()


def velocities_of_bag(flight, path):
    """Return velocities (n, 3) in the world, turned by tf from the frames that messages name."""
    from rosbags.highlevel import AnyReader

    topics = ["gps/fix", "gps/velocity", "tf", "tf_static"]
    flight.save(path, topics=topics)
    parents, velocities = {"world": {}}, []
    with AnyReader([path]) as reader:
        for connection, _, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            for transform in getattr(message, "transforms", ()):
                q, stamp = transform.transform.rotation, transform.header.stamp
                children = parents.setdefault(transform.child_frame_id, {})
                turn = rotation.to_matrix(np.array([q.w, q.x, q.y, q.z]))
                children[stamp.sec, stamp.nanosec] = transform.header.frame_id, turn
            if connection.topic == "/gps/velocity":
                velocities.append((message.header, message.twist.twist.linear))
    messages = []
    for header, v in velocities:
        vector, frame = np.array([v.x, v.y, v.z]), header.frame_id
        while parents[frame]:
            steps = parents[frame]
            time = (header.stamp.sec, header.stamp.nanosec)
            frame, turn = steps[time] if time in steps else next(iter(steps.values()))
            vector = turn @ vector
        messages.append(vector)
    return np.array(messages)


def aids(flight, velocity, draw, stated, wheels):
    """Return pyins' measurements; arguments as for :func:`filtered`."""
    from pandas import DataFrame, Index
    from pyins import measurements
    from pyins.util import LLA_COLS, VEL_COLS

    fixes = flight.gnss
    when = Index((fixes.t_ns - flight.t_ns[0]) * 1e-9, name="time")
    arm = FLU_FROM_FRD @ ARM
    root = np.sqrt(stated)
    aiding = [
        measurements.Position(
            DataFrame(fixes.geodetic, columns=LLA_COLS, index=when), root * FIX, arm
        ),
        measurements.NedVelocity(
            DataFrame(velocity @ ENU_FROM_NED, columns=VEL_COLS, index=when),
            root * SPEED,
            arm,
        ),
    ]
    if wheels:
        odometry = flight.wheels
        speed = WHEEL * draw.standard_normal((len(odometry.twist[::50]), 3))
        speed[:, 0] += odometry.twist[::50, 0]
        times = (odometry.t_ns[::50] - flight.t_ns[0]) * 1e-9
        aiding.append(
            measurements.BodyVelocity(
                DataFrame(speed, columns=["VX", "VY", "VZ"], index=Index(times, name="time")), WHEEL
            )
        )
    return aiding


def truth_places(flight):
    """Return latitude, longitude [deg] and height [m] of the body."""
    from imu_sim_ros.sensors.gravity import geodetic

    return np.column_stack(geodetic(flight.parameters, flight.truth.position))


def mean_squares(seeds, seconds, **options):
    """Return the mean squares (k, 3) of normalised errors at some times, over the seeds."""
    squares = []
    for seed in range(seeds):
        t, normalised = filtered(seed, max(seconds) + 2.0, **options)
        squares.append(normalised[np.searchsorted(t, np.asarray(seconds) - 1e-6)] ** 2)
    return np.mean(squares, axis=0)


def band(seeds):
    return chi2.ppf([0.0005, 0.9995], seeds) / seeds


def test_few_drives_are_consistent_over_all_axes(tmp_path):
    """Six seeds and three axes are 18 numbers at each time; velocities are those of a bag.

    Steps of 1 s, between fixes, instead of 0.5 s change the mean squares by 0.1 %.
    """
    squares = mean_squares(6, [7.0, 14.0], folder=tmp_path, time_step=1.0).mean(axis=1)
    low, high = band(18)
    assert (squares > low).all()
    assert (squares < high).all()


@pytest.mark.slow
def test_pyins_is_consistent_with_fixes_velocities_and_odometry():
    low, high = band(SEEDS)
    squares = mean_squares(SEEDS, [15.0, 30.0])
    assert (squares > low).all()
    assert (squares < high).all()


@pytest.mark.slow
def test_without_fixes_errors_grow_as_pyins_says():
    """Fifteen seconds without any aiding; over the seeds in the band at their end."""
    seeds = 15
    low, high = band(seeds)
    squares = mean_squares(seeds, [24.0], outage=[10.0, 15.0], wheels=False)
    assert (squares > low).all()
    assert (squares < high).all()


@pytest.mark.slow
def test_a_covariance_four_times_too_small_shows():
    """All three axes of ten seeds together: 30 numbers, whose mean square is up to 4."""
    seeds = 10
    squares = mean_squares(seeds, [30.0], stated=0.25, wheels=False)
    assert squares.mean() > chi2.ppf(0.9995, 3 * seeds) / (3 * seeds)
