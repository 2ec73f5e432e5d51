# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about readings and poses: each fault is found, and nothing in clean recordings."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from faults import FAULTS, saturated

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ODOMETRY, OdometryEncoder
from imu_sim_ros.bags.writer import Block
from imu_sim_ros.commands import inspect
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState, States, replace_fields
from imu_sim_ros.recordings.findings.catalogue import (
    KINDS,
    reading_findings,
    stamp_findings,
    state_findings,
)
from imu_sim_ros.recordings.findings.live import StampWatch, TwistWatch, UnitWatch
from imu_sim_ros.recordings.live_clock import LiveClock
from imu_sim_ros.recordings.repair import repair_poses

ROOT = Path(__file__).parents[2]
IMUS = sorted(path.stem for path in (ROOT / "config" / "imus").glob("*.yaml"))
# A free fall reads like an accelerometer without gravity, for as long as it lasts.
TRAJECTORIES = sorted(
    {path.stem for path in (ROOT / "config" / "trajectories").glob("*.yaml")} - {"free_fall"}
)


def kinds(readings):
    return [finding.kind for finding in reading_findings(readings)]


@pytest.fixture(scope="module")
def recordings():
    """Return readings at rest and in motion, of sensors of two grades."""
    return [
        ims.simulate(imu=imu, trajectory=trajectory, duration=20, rate=200, seed=3).readings
        for imu in ("bmi088", "mpu6000")
        for trajectory in ("static", "figure_eight", "town")
    ]


@pytest.mark.parametrize("kind", FAULTS)
def test_each_fault_is_found_at_rest_and_in_motion_and_nothing_else(recordings, kind):
    for readings in recordings:
        assert kinds(readings) == []
        assert kinds(FAULTS[kind](readings)) == [kind], readings


def test_both_triads_may_be_in_other_units(recordings):
    for readings in recordings:
        both = FAULTS["accelerometer_g"](FAULTS["gyroscope_degrees"](readings))
        assert kinds(both) == ["accelerometer_g", "gyroscope_degrees"]


def test_gravity_of_the_wrong_sign_reads_as_axes_down(recordings):
    for readings in recordings:
        assert kinds(replace_fields(readings, accel=-readings.accel)) == ["axes_down"]


def test_acceleration_without_gravity_is_found_at_rest_and_in_motion():
    for trajectory in ("static", "figure_eight", "circle"):
        flight = ims.simulate(
            imu="bmi088", trajectory=trajectory, duration=20, rate=200, gravity=1e-9, seed=2
        )
        assert kinds(flight.readings) == ["gravity_absent"], trajectory


def test_gravity_of_another_size_at_rest_is_found():
    moon = ims.simulate(imu="bmi088", trajectory="static", duration=5, gravity=6.5, seed=2)
    assert kinds(moon.readings) == ["gravity_size"]
    with pytest.warns(UserWarning, match=r"6\.\d+ m/s\^2 instead of 9.81; .*\[gravity_size\]"):
        ims.dead_reckon(moon.readings, initial="parameters")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ims.dead_reckon(moon.readings, initial="parameters", gravity=6.5)


def test_a_scale_of_gravity_is_told_from_a_bias_by_several_attitudes():
    """5 % in the scale is more than any sensor has, the same share as a bias is usual."""
    imu = {"preset": "mpu6000", "accelerometer_bias": [0.8, 0.0, 0.0]}
    positions = {"type": "six_position", "dwell": 5.0}
    flight = ims.simulate(imu=imu, trajectory=positions, rate=25, seed=2)
    assert kinds(flight.readings) == []
    for scale in (0.93, 1.07):
        (finding,) = reading_findings(replace_fields(flight.readings, accel=scale * flight.accel))
        assert finding.kind == "gravity_size"
        assert "in all attitudes" in finding.evidence


def test_the_specific_force_at_rest_is_stated():
    flight = ims.simulate(imu="perfect", trajectory="static", duration=3, gravity=9.3)
    inspection = ims.inspect(flight.readings)
    assert inspection.sensors[0].rest_force == pytest.approx(9.3)
    assert any("9.3" in line for line in map(str, inspection.lines()))


def test_a_saturated_axis_is_found(recordings):
    assert kinds(saturated(recordings[1])) == ["axis_saturated"]


def test_steps_larger_than_the_noise_are_found(recordings):
    coarse = recordings[0].accel.copy()
    mean = coarse[:, 0].mean()
    coarse[:, 0] = np.where(coarse[:, 0] > mean, mean + 0.5, mean - 0.5)
    assert kinds(replace_fields(recordings[0], accel=coarse)) == ["steps_coarse"]


def test_traits_of_the_clock_are_findings_with_their_row(recordings):
    readings = recordings[1]
    late = readings.t_ns + np.where(np.arange(len(readings)) > 2000, 50_000_000, 0)
    (finding,) = reading_findings(replace_fields(readings, t_ns=late))
    assert (finding.kind, finding.row, finding.number) == ("samples_lost", 2001, 10)
    assert finding.t == pytest.approx(10.055)
    paused = readings.t_ns + np.where(np.arange(len(readings)) > 2000, 3_600_000_000_000, 0)
    assert kinds(replace_fields(readings, t_ns=paused)) == ["clock_pause"]
    shared = readings.t_ns[np.arange(len(readings)) // 8 * 8]
    assert kinds(replace_fields(readings, t_ns=shared)) == ["stamps_shared"]
    back = readings.t_ns - np.where(np.arange(len(readings)) > 2000, 9_000_000_000, 0)
    assert kinds(replace_fields(readings, t_ns=back)) == ["clock_reset"]


def clean(imu, trajectory, rate, duration, folder, forms=("mcap", "euroc")):
    """Return the findings of a recording, from a bag, from tables, and live."""
    flight = ims.simulate(imu=imu, trajectory=trajectory, rate=rate, duration=duration, seed=4)
    paths = {"mcap": folder / "clean.mcap", "euroc": folder / "clean"}
    for form in forms:
        flight.save(paths[form], format=form if form == "euroc" else None, force=True)
    findings = [*ims.inspect([paths[form] for form in forms]).findings, *live_findings(flight)]
    return [(imu, trajectory, rate, f.source, f.kind, f.evidence) for f in findings]


def live_findings(flight):
    """Return the findings of the nodes: units, the twist, and the recorder's clock."""
    readings, truth = flight.readings, flight.truth
    units, twist = UnitWatch("imu"), TwistWatch("odom", "body")
    stamps, clock = StampWatch(), LiveClock()
    findings = []
    columns = (readings.t_ns.tolist(), readings.gyro.tolist(), readings.accel.tolist())
    for t_ns, gyro, accel in zip(*columns, strict=True):
        stamps.add(t_ns)
        if not units.done:
            findings += units.add(LiveReading(t_ns, tuple(gyro), tuple(accel)))
    velocity = rotation.rotate_inverse(truth.q_wb, truth.velocity)
    columns = (truth.t_ns, truth.position, truth.q_wb, velocity, truth.angular_velocity)
    states = [
        LiveState(t_ns, tuple(p), tuple(q), tuple(v), tuple(w))
        for t_ns, p, q, v, w in zip(*(column.tolist() for column in columns), strict=True)
    ]
    findings += twist.add(states)
    clock.add(readings.t_ns)
    clock.finish()
    return [*findings, *stamp_findings(clock.clock, "recorder")]


def length(trajectory):
    return 2.4 if trajectory == "waypoints" else 12.0


def test_clean_recordings_have_no_finding(tmp_path):
    """Every preset and every trajectory once, in another combination for each."""
    pairs = [(imu, TRAJECTORIES[k % len(TRAJECTORIES)]) for k, imu in enumerate(IMUS)]
    pairs += [("perfect", trajectory) for trajectory in TRAJECTORIES]
    for k, (imu, trajectory) in enumerate(pairs):
        form = ("mcap", "euroc")[k % 2]
        assert clean(imu, trajectory, 100.0, length(trajectory), tmp_path, [form]) == []


@pytest.mark.slow
@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_every_preset_on_every_trajectory_has_no_finding(trajectory, rate, tmp_path):
    for imu in IMUS:
        assert clean(imu, trajectory, rate, length(trajectory), tmp_path) == []


@pytest.mark.parametrize("name", ["flight.mcap", "flight.bag", "flight", "flight.csv"])
def test_files_have_the_findings_of_their_readings(tmp_path, capsys, name):
    flight = ims.simulate(imu="bmi088", trajectory="figure_eight", duration=12, rate=100, seed=1)
    path = tmp_path / name
    flight.save(path, format="euroc" if name == "flight" else None)
    assert inspect.main([str(path), "--json", "--fail-on", "note"]) == 0
    contents = json.loads(capsys.readouterr().out)
    assert contents["findings"] == []
    assert contents["sensors"][0]["rate_hz"] == pytest.approx(100.0)
    assert "bmi088" in contents["sensors"][0]["nearest_presets"]


def test_a_program_can_fail_on_kinds(tmp_path, capsys):
    readings = ims.simulate(imu="bmi088", trajectory="static", duration=12, rate=100).readings
    rows = np.column_stack([readings.gyro, readings.accel / STANDARD_GRAVITY])
    path = tmp_path / "g.csv"
    with path.open("w") as file:
        for t_ns, row in zip(readings.t_ns.tolist(), rows.tolist(), strict=True):
            file.write(f"{t_ns}," + ",".join(map(repr, row)) + "\n")
    assert inspect.main([str(path)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("error: g.csv: at rest the accelerometer reads")
    assert max(map(len, printed.splitlines())) <= 80
    assert inspect.main([str(path), "--fail-on", "gyroscope_degrees,samples_lost"]) == 0
    for kind in ("error", "warning", "accelerometer_g"):
        assert inspect.main([str(path), "--fail-on", kind]) == 3
    capsys.readouterr()
    assert inspect.main([str(path), "--fail-on", "accelerometer_G"]) == 2
    assert "did you mean accelerometer_g?" in capsys.readouterr().err
    page = tmp_path / "page.html"
    assert inspect.main([str(path), "-o", str(page), "--quiet"]) == 0
    assert "accelerometer_g" in page.read_text()
    assert "accelerometer_g" in ims.report(path, page, force=True).output.read_text()


def test_every_kind_is_in_the_manual():
    page = (ROOT / "docs" / "reference" / "findings.md").read_text(encoding="utf-8")
    for kind, check in KINDS.items():
        assert f"| `{kind}` | {check.severity} | {check.meaning} |" in page


def moving(trajectory, duration=20.0):
    truth = ims.simulate(imu="perfect", trajectory=trajectory, duration=duration, rate=100).truth
    return ims.States(
        truth.t_ns, truth.position, truth.q_wb, truth.velocity, truth.angular_velocity
    )


def pose_kinds(states):
    return [finding.kind for finding in state_findings(states)]


@pytest.fixture(scope="module")
def poses():
    """Return the states of a vehicle on a circle, with all directions of travel."""
    return moving("circle")


def test_poses_of_every_trajectory_have_no_finding():
    for trajectory in (*TRAJECTORIES, "free_fall"):
        assert pose_kinds(moving(trajectory, length(trajectory))) == [], trajectory


def test_held_poses_are_found_with_the_true_rate(poses):
    rows = np.arange(len(poses)) // 4 * 4
    steps = replace_fields(
        poses, position=poses.position[rows], q_wb=poses.q_wb[rows], velocity=None
    )
    (finding,) = state_findings(steps)
    assert finding.kind == "poses_held"
    assert "25 Hz, not 100" in finding.evidence


@pytest.mark.parametrize("order", [[1, 2, 3, 0], [3, 0, 1, 2]])
def test_quaternions_in_another_order_are_found(poses, order):
    permuted = replace_fields(poses, q_wb=poses.q_wb[:, order], velocity=None)
    assert pose_kinds(permuted) == ["quaternion_order"]


def test_a_twist_that_contradicts_the_poses_is_found(poses):
    # The reader turns the twist by the attitude: one in the world's axes is turned once too often.
    world = replace_fields(poses, velocity=rotation.rotate(poses.q_wb, poses.velocity))
    assert pose_kinds(world) == ["twist_world"]
    unfilled = replace_fields(poses, velocity=0.0 * poses.velocity)
    assert pose_kinds(unfilled) == ["twist_unfilled"]


def test_sparse_disordered_and_turned_poses_are_found(poses):
    assert pose_kinds(replace_fields(poses.rows(slice(None, None, 60)), velocity=None)) == [
        "poses_sparse"
    ]
    swapped = np.arange(len(poses))
    swapped[[500, 501]] = [501, 500]
    assert pose_kinds(poses.rows(swapped)) == ["stamps_late"]
    half_turn = rotation.multiply(poses.q_wb, np.array([0.0, 1.0, 0.0, 0.0]))
    poses = replace_fields(poses, angular_velocity=None)
    assert pose_kinds(replace_fields(poses, q_wb=half_turn)) == ["z_down"]
    camera = rotation.multiply(poses.q_wb, np.array([0.5, -0.5, 0.5, -0.5]))
    assert pose_kinds(replace_fields(poses, q_wb=camera)) == ["axes_camera"]
    hovering = replace_fields(poses, q_wb=camera, position=0.01 * poses.position, velocity=None)
    assert pose_kinds(hovering) == ["axes_camera"]
    few = replace_fields(poses.rows(slice(None, None, 200)), velocity=None)
    assert len(few) < 20
    assert pose_kinds(few) == ["poses_sparse"]


def test_smooth_poses_are_mended_nowhere_however_far_and_fast():
    """``--robust`` leaves every trajectory as it is, shifted to UTM and scaled."""
    for trajectory in (*TRAJECTORIES, "free_fall"):
        states = moving(trajectory, length(trajectory))
        for shift in (0.0, 300.0, 5e6):
            for scale in (0.01, 1.0, 100.0):
                position = states.position * scale + np.array([shift, -shift, 0.1 * shift])
                result = repair_poses(replace_fields(states, position=position))
                assert not result.disturbances, (trajectory, shift, scale)
                assert len(result.poses.position) == len(states)


def test_poses_that_are_held_at_late_stamps_are_one_finding(poses):
    """A physics of 50 Hz, logged at 200 Hz with a phase that drifts: no jumps, no outliers."""
    rows = (np.arange(len(poses)) * 0.25 * 1.003).astype(int).clip(max=len(poses) // 4 - 1) * 4
    steps = replace_fields(
        poses, position=poses.position[rows], q_wb=poses.q_wb[rows], velocity=None
    )
    assert pose_kinds(steps) == ["poses_held"]
    jumped = steps.position + np.where(np.arange(len(steps)) > 1000, 1.0, 0.0)[:, None]
    assert pose_kinds(replace_fields(steps, position=jumped)) == ["poses_held", "poses_jump"]


def test_steps_that_the_noise_crosses_are_no_finding():
    """Steps of three deviations of the noise, of which an axis may show two values by chance."""
    readings = ims.simulate(imu="icm42688p", trajectory="circle", rate=100, duration=12, seed=5)
    assert len(np.unique(readings.readings.gyro[:, 0])) == 2
    assert kinds(readings.readings) == []


def test_the_noise_floor_is_that_of_the_sensor():
    """The lower quartile of 60 windows of 200 readings deviates by 1.4 % of itself, three axes."""
    flight = ims.simulate(imu="lecture", trajectory="static", duration=60, rate=200, seed=1)
    (sensor,) = ims.inspect(flight.readings).sensors
    assert np.mean(sensor.gyroscope_noise_density) == pytest.approx(0.015, rel=0.03)
    assert np.mean(sensor.accelerometer_noise_density) == pytest.approx(0.019, rel=0.03)


def test_held_poses_are_mended_to_one_of_each(poses):
    rows = np.arange(len(poses)) // 4 * 4
    result = repair_poses(
        replace_fields(poses, position=poses.position[rows], q_wb=poses.q_wb[rows])
    )
    assert len(result.disturbances.repeated) == len(poses) * 3 // 4
    np.testing.assert_array_equal(result.poses.position, poses.position[::4])
    np.testing.assert_array_equal(result.t, poses.t[::4])
    assert not len(result.disturbances.single)


@pytest.mark.parametrize(
    ("log", "physics", "digits", "stamp_ns"),
    [
        *((200, 50, 9, 1), (1000, 30, 9, 1), (120, 100, 9, 1), (200, 50, 4, 1)),
        *((240, 60, 9, 10**6), (170, 110, 9, 10**6), (640, 500, 9, 1)),
    ],
)
def test_poses_held_at_any_rates_are_mended_to_even_times(log, physics, digits, stamp_ns):
    """A pose stands in the log from the first step after it on; rounding makes it a step late."""
    seconds = np.arange(0.0, 20.0, 1.0 / log)
    # As C++ programs do it: rounding makes half of the poses a step of the log late.
    physics_s = seconds // (1.0 / physics) * (1.0 / physics)
    position = np.stack(
        [2.0 * np.sin(0.5 * physics_s), 1.5 * np.sin(0.8 * physics_s), 0.1 * physics_s], 1
    )
    yaw = 0.9 * np.sin(0.6 * physics_s)
    q_wb = rotation.from_euler(np.stack([0.0 * yaw, 0.0 * yaw, yaw], 1))
    rounded = rotation.normalise(np.round(q_wb, digits))
    t_ns = np.round(seconds * 1e9).astype(np.int64) // stamp_ns * stamp_ns
    result = repair_poses(States(t_ns, np.round(position, digits), rounded))
    assert not len(result.disturbances.single)
    assert not result.disturbances.jumps
    steps = np.diff(result.t)
    assert abs(len(steps) / np.ptp(result.t) / physics - 1.0) < 1e-3
    # Scatter of 0.02 intervals is not looked at; a pose that is a step late would be 0.25.
    assert np.ptp(steps) < 0.04 / physics


def test_add_errors_tells_of_a_twist_in_the_worlds_axes(tmp_path, poses):
    def write(name, linear, rates):
        path = tmp_path / name
        fields = (poses.t_ns, poses.position, poses.q_wb, linear, rates)
        with open_writer(path) as writer:
            topic = writer.add_topic("/odom", ODOMETRY)
            rows = OdometryEncoder("odom", "base_link", writer.encoding).encode(*fields)
            writer.write_blocks([Block(topic, poses.t_ns, rows)])
        return path

    def add(path, **options):
        out = tmp_path / f"{path.stem}_{len(options)}.mcap"
        added = ims.add_errors_to_file(path, out, imu="perfect", input_topic="/odom", **options)
        return ims.read_imu(out, "imu/data_raw"), added.warnings

    q_wb, rates = poses.q_wb, poses.body_rates()
    body, silence = add(write("body.mcap", rotation.rotate_inverse(q_wb, poses.velocity), rates))
    assert silence == ()
    world = write("world.mcap", poses.velocity, rotation.rotate(q_wb, rates))
    wrong, (line,) = add(world)
    assert "twist_frame='world'" in line
    converted, silence = add(world, twist_frame="world")
    assert silence == ()
    assert np.abs(wrong.accel - body.accel).max() > 0.1
    np.testing.assert_allclose(converted.accel, body.accel, atol=1e-9)
    np.testing.assert_allclose(converted.gyro, body.gyro, atol=1e-12)
    _, (line,) = add(write("unfilled.mcap", 0.0 * poses.velocity, rates))
    assert "all velocities are 0" in line


def test_angular_rates_that_states_lack_are_absent_in_their_bag(tmp_path, poses):
    folder, path = tmp_path / "mav0", tmp_path / "states.mcap"
    ims.generate(folder, format="euroc", trajectory="lecture", duration=2, imu="perfect")
    ims.convert(folder, path)
    states = ims.read_states(path)
    assert states.velocity is not None
    assert states.angular_velocity is None
    assert not [f for f in ims.inspect(path).findings if f.kind.startswith("twist")]
    with pytest.raises(InputError, match="/ground_truth/odom: contains no angular rates"):
        ims.add_errors_to_file(
            path, tmp_path / "noisy.mcap", imu="perfect", input_topic="ground_truth/odom"
        )


def test_dead_reckoning_warns_of_units_and_says_what_converts_them(recordings):
    readings = recordings[1]
    start = ims.NavigationState(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    with pytest.warns(UserWarning, match="accel_unit='g'"):
        ims.dead_reckon(FAULTS["accelerometer_g"](readings), initial=start)
