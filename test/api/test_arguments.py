# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Error messages of the Python interface about invalid arguments."""

import dataclasses
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import imu_sim_ros as ims

NAN = float("nan")


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(imu="perfect", trajectory="circle", duration=4, rate=100)


@pytest.mark.parametrize("size", [0, -1, 1.5, "8", None, 10**18])
def test_a_block_size_that_is_none_is_refused_before_the_first_block(size):
    with pytest.raises(ims.ConfigurationError, match="block_size = ") as raised:
        ims.blocks(duration=1, block_size=size)
    assert isinstance(raised.value, ValueError)


@pytest.mark.parametrize("duration", [1e12, 3e9, NAN, -1.0, [1], {}])
def test_a_duration_without_measure_is_refused(duration):
    with pytest.raises(ims.ConfigurationError, match="duration"):
        ims.simulate(trajectory="static", duration=duration)


def test_a_flight_that_memory_cannot_hold_is_refused_with_what_can():
    with pytest.raises(ims.ConfigurationError, match=r"do not fit into memory.*blocks\(\)"):
        ims.simulate(trajectory="static", rate=20000, duration=1e9)


def test_the_memory_of_the_other_sensors_counts(monkeypatch):
    settings = {"imu": {"magnetometer_rate": 1000.0, "barometer_rate": 1000.0}}
    settings.update(trajectory="static", rate=100, duration=100)
    # 10,000 samples of 384 B; 100,000 of 104 B and 100,000 of 56 B are 20 MB more.
    small = {"SC_PAGE_SIZE": 4000, "SC_PHYS_PAGES": 2500}
    monkeypatch.setattr("os.sysconf", small.__getitem__)
    assert len(ims.simulate(**settings)) == 10_000
    with pytest.raises(ims.ConfigurationError, match=r"10000 samples, with those of all sensors"):
        ims.simulate(**settings, sensors=["magnetic_field", "pressure"])


@pytest.mark.parametrize("size", [0, -1, 1.5, "8", None, 2**24 + 1])
def test_every_stream_of_blocks_checks_their_size_before_the_first(flight, size):
    streams = [
        lambda n: ims.blocks(duration=1, block_size=n),
        lambda n: ims.camera.tracks(flight, block=n),
    ]
    for stream in streams:
        with pytest.raises(ims.ConfigurationError, match=r"block(_size)? = .*an integer from 1 to"):
            stream(size)


def test_readings_without_truth_are_levelled_only_on_request(flight):
    with pytest.raises(ims.InputError, match="no truth to start from .*initial='level'"):
        ims.dead_reckon(flight.readings)
    assert len(ims.dead_reckon(flight.readings, initial="parameters")) == len(flight)


@pytest.mark.parametrize("initial", [0, {}, [1, 2], np.zeros(3)])
def test_an_initial_state_of_another_type_is_a_type_error(flight, initial):
    with pytest.raises(
        TypeError, match="initial = .*must be one of parameters, truth, level"
    ) as raised:
        ims.dead_reckon(flight, initial=initial)
    assert isinstance(raised.value, ims.ConfigurationError)


@pytest.mark.parametrize(
    ("position", "velocity", "q_wb"),
    [
        ([NAN, 0, 0], [0, 0, 0], [1, 0, 0, 0]),
        ([0, 0], [0, 0, 0], [1, 0, 0, 0]),
        ([0, 0, 0], None, [1, 0, 0, 0]),
        ([0, 0, 0], [0, 0, 0], [0, 0, 0, 0]),
        ([0, 0, 0], [0, 0, 0], "w"),
    ],
)
def test_a_navigation_state_that_is_none_is_refused_when_it_is_made(position, velocity, q_wb):
    with pytest.raises(ims.ConfigurationError, match=r"^(position|velocity|q_wb) = "):
        ims.NavigationState(position, velocity, q_wb)


@pytest.mark.parametrize("bias", [None, "x", [1.0, 2.0], NAN, {}])
def test_a_bias_that_is_none_is_refused(flight, bias):
    with pytest.raises(ims.ConfigurationError, match="gyro_bias = "):
        ims.preintegrate(flight, every=0.5, gyro_bias=bias)


@pytest.mark.parametrize("gap", [NAN, -1, None, "1"])
def test_a_gap_that_is_none_is_refused(flight, gap):
    with pytest.raises(ims.ConfigurationError, match="max_gap = "):
        ims.evaluate(flight.truth, flight.truth, max_gap=gap)


def poses(n=50):
    t = np.arange(n) * 0.1
    position = np.column_stack([np.sin(t), np.cos(t), 0.1 * t])
    return t, position, np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))


@pytest.mark.parametrize(
    "change",
    [
        lambda t, p, q: (t, p, q),  # seconds as floats
        lambda t, p, q: ((t * 1e9).astype(int), p[:-1], q),
        lambda t, p, q: ((t * 1e9).astype(int), p, 2 * q),
        lambda t, p, q: ((t * 1e9).astype(int), p * NAN, q),
        lambda t, p, q: (None, p, q),
    ],
)
def test_poses_that_are_none_are_refused_when_they_are_made_and_from_any_object(flight, change):
    pose_arrays = change(*poses())
    refused = (ims.ConfigurationError, ims.InputError)
    with pytest.raises(refused, match="^(t_ns|position|q_wb|states)"):
        ims.States(*pose_arrays)
    with pytest.raises(refused, match="^truth"):
        ims.evaluate(
            ims.dead_reckon(flight),
            SimpleNamespace(t_ns=pose_arrays[0], position=pose_arrays[1], q_wb=pose_arrays[2]),
        )


@pytest.mark.parametrize(
    "change",
    [
        lambda poses: {"t_ns": poses.t_ns * 1e-9},
        lambda poses: {"position": poses.position * NAN},
        lambda poses: {"q_wb": 2.0 * poses.q_wb},
        lambda poses: {"covariance": np.full((len(poses.t_ns), 6, 6), NAN)},
        lambda poses: {"covariance": np.zeros((2, 6, 6))},
    ],
)
def test_changed_poses_are_checked_as_new_ones_are(change):
    t, position, q_wb = poses()
    states = ims.States((t * 1e9).astype(int), position, q_wb)
    with pytest.raises((ims.ConfigurationError, ims.InputError)):
        dataclasses.replace(states, **change(states))


def test_poses_out_of_order_are_refused_in_every_door_by_its_name(flight):
    t, position, q_wb = poses()
    t_ns = (t * 1e9).astype(int)[::-1]
    back = SimpleNamespace(t_ns=t_ns, position=position, q_wb=q_wb)
    message_pattern = (
        r".*\) on: the clock went back by 0\.1 s; cut the recording there.*\[clock_reset\]$"
    )
    rows = np.column_stack([t[::-1], position, q_wb])
    for name, call in (
        ("trajectory", lambda: ims.simulate(trajectory=rows)),
        ("truth", lambda: ims.evaluate(ims.dead_reckon(flight), back)),
        ("estimate", lambda: ims.evaluate(back, flight.truth)),
    ):
        with pytest.raises(ims.InputError, match=f"^{name}, from{message_pattern}"):
            call()


@pytest.mark.parametrize("field", ["position", "q_wb", "velocity", "angular_velocity"])
def test_odometry_that_is_none_is_refused_when_it_is_made(flight, field):
    truth = flight.truth
    odometry = {n: getattr(truth, n) for n in ("t_ns", "position", "q_wb", "velocity")}
    odometry["angular_velocity"] = truth.angular_velocity
    for factor in (NAN, 1e30):
        with pytest.raises(ims.InputError, match="^states: number 0: stamp .*: a|^states: n"):
            ims.States(**{**odometry, field: factor * (odometry[field] + 1.0)})


def test_a_trajectory_as_an_array_is_the_same_as_poses():
    t, position, q_wb = poses()
    as_poses = ims.States(np.round(t * 1e9).astype(np.int64), position, q_wb)
    of_poses = ims.simulate(imu="perfect", trajectory=as_poses)
    for rows in (
        np.column_stack([t, position, q_wb]),
        np.column_stack([t, position, 0 * position]),
    ):
        of_rows = ims.simulate(imu="perfect", trajectory=rows)
        assert np.array_equal(of_rows.accel, of_poses.accel)
        assert np.array_equal(of_rows.gyro, of_poses.gyro)


@pytest.mark.parametrize(
    "not_a_trajectory", [[1, 2], object(), 3.0, int, np.zeros((4, 3)), np.zeros(8)]
)
def test_any_other_trajectory_is_answered_with_what_to_give(not_a_trajectory):
    with pytest.raises(ims.ConfigurationError, match=r"trajectory = .*\(n, 8\)"):
        ims.simulate(trajectory=not_a_trajectory)


def test_a_parameter_of_a_named_motion_is_above_its_file():
    """The parameter overrides the file, as ``--set`` does, unless another motion is named."""
    square_parameters = {"trajectory.speed_limit": 0.3}
    flight = ims.simulate(trajectory="square", duration=1.0, **square_parameters)
    assert flight.parameters.trajectory.speed_limit == 0.3
    drive_parameters = {"trajectory.type": "drive", "trajectory.speed_limit": 0.3}
    flight = ims.simulate(trajectory="square", duration=1.0, **drive_parameters)
    assert flight.parameters.trajectory.speed_limit == 1.5


EMPTY = ims.States(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4)))


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (lambda flight: ims.evaluate(EMPTY, flight.truth), "estimate"),
        (lambda flight: ims.evaluate(ims.dead_reckon(flight), EMPTY), "truth"),
        (lambda flight: ims.evaluate(EMPTY, EMPTY), "estimate: contains no poses\ntruth"),
        (lambda _: ims.twin(ims.simulate(trajectory="lecture", duration=2), EMPTY), "truth"),
        (lambda flight: ims.simulate(trajectory=EMPTY), "trajectory"),
    ],
)
def test_poses_without_a_pose_are_refused(flight, function, name):
    with pytest.raises(ims.InputError, match=rf"^(\+ )?{name}: contains no poses$"):
        function(flight)


def masked(values, row):
    masked_values = np.ma.masked_array(values, mask=False)
    masked_values[row] = np.ma.masked
    return masked_values


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (lambda f: ims.Readings(f.t_ns, masked(f.gyro, 5), f.accel), "gyro: 3 of 1200"),
        (lambda f: ims.Readings(masked(f.t_ns, 5), f.gyro, f.accel), "t_ns: 1 of 400"),
        (lambda f: ims.add_errors(f.t_ns, f.gyro, masked(f.accel, 0), imu="bmi088"), "accel: 3 of"),
        (lambda f: ims.simulate(trajectory=masked(np.zeros((9, 7)), 3)), "trajectory: 7 of 63"),
        (lambda f: ims.preintegrate(f, every=1, gyro_bias=masked(np.zeros(3), 1)), "gyro_bias: 1"),
    ],
)
def test_masked_values_are_missing_ones(flight, function, name):
    with pytest.raises(ims.ConfigurationError, match=f"^{name}.* values are masked: leave these"):
        function(flight)


def test_a_masked_array_of_which_nothing_is_masked_is_an_array(flight):
    masked_triads = [np.ma.masked_array(triad, mask=False) for triad in (flight.gyro, flight.accel)]
    readings = ims.Readings(flight.t_ns, *masked_triads)
    assert type(readings.gyro) is np.ndarray


def test_a_function_s_masked_poses_are_missing():
    def poses(t):
        return masked(np.zeros((len(t), 3)), 0), np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))

    with pytest.raises(ims.ConfigurationError, match="a value that is not finite: position"):
        ims.simulate(trajectory=poses, duration=1)


def test_a_noise_of_a_model_that_no_sensor_has_is_refused(tmp_path):
    noise = "<noise type='gaussian'><stddev>1e20</stddev></noise>"
    imu = f"<imu><angular_velocity><x>{noise}</x></angular_velocity></imu>"
    sensor = f"<sensor name='imu' type='imu'><update_rate>100</update_rate>{imu}</sensor>"
    file = tmp_path / "model.sdf"
    file.write_text(f"<sdf><model name='m'><link name='l'>{sensor}</link></model></sdf>")
    line = r"imu: imu.gyroscope_noise_density = .*: must be 0 or of a size from 1e-30 to 100000"
    with pytest.raises(ims.InputError, match=line):
        ims.from_sdf(file)
    with pytest.raises(ims.ImuSimError, match=line):
        ims.simulate(imu=file, duration=1)


def test_warnings_name_the_line_of_the_caller(tmp_path):
    """Warnings of ims.add_errors used to name the package's own file on Python 3.11."""
    t_ns = np.arange(500) * 5_000_000
    still, heavy = np.zeros((500, 3)), np.tile([0.0, 0.0, 1.0], (500, 1))
    rows = tmp_path / "path.txt"
    rows.write_text("0 0 0 0 0 0 0 1\nx\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    model = tmp_path / "model.sdf"
    model.write_text("<sdf><plugin name='p' filename='libgazebo_ros_imu.so'/></sdf>")
    causes = [
        lambda: ims.simulate(imu={"accelerometer_range": 5.0}, duration=1),
        lambda: ims.add_errors(t_ns, still, heavy, imu="lecture"),
        lambda: ims.ErrorModel(imu="lecture", rate=200).read(t_ns, still, heavy),
        lambda: ims.from_sdf(model),
        lambda: ims.evaluate(rows, rows, skip_bad_rows=True),
    ]
    for cause in causes:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            cause()
        assert {warning.filename for warning in caught} == {__file__}
