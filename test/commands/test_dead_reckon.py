# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command on bags, with exact readings so that every number is known."""

import json

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.commands.dead_reckon import main
from imu_sim_ros.commands.generate import main as generate
from imu_sim_ros.core import rotation
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

KEYS = {
    "method",
    "attitude_update",
    "samples",
    "duration_s",
    "distance_m",
    "final_position_error_m",
    "rms_position_error_m",
    "final_attitude_error_rad",
}


def block_of(trajectory="lecture", duration=5.005, **parameters):
    values = {"imu.preset": "perfect", "trajectory.type": trajectory, "duration": duration}
    values |= {name.replace("__", "."): value for name, value in parameters.items()}
    simulation = Body(load_simulation(values))
    return simulation.next(simulation.total)["imu"]


def write(path, block, truth=slice(None), imu=slice(None), topics=("ground_truth/odom",)):
    """Write readings and truth, each perhaps in part."""
    motion = block.motion
    with open_writer(path) as writer:
        encoder = ImuEncoder("base_link", writer.encoding)
        handle = writer.add_topic("/imu/data_raw", IMU)
        payloads = encoder.encode(block.t_ns[imu], block.gyro[imu], block.accel[imu])
        # As recorded: in the order of arrival, whatever the stamps say.
        writer.write(handle, block.t_ns[: len(payloads)], payloads)
        for topic in topics:
            odometry = OdometryEncoder("world", "base_link", writer.encoding)
            handle = writer.add_topic(f"/{topic}", ODOMETRY)
            velocity_b = rotation.rotate_inverse(motion.q_wb, motion.velocity)
            payloads = odometry.encode(
                block.t_ns[truth],
                motion.position[truth],
                motion.q_wb[truth],
                velocity_b[truth],
                motion.angular_velocity[truth],
            )
            writer.write(handle, block.t_ns[truth], payloads)
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write(tmp_path_factory.mktemp("bag") / "lecture", block_of())


def run(capsys, *arguments):
    """Return exit status, standard output and the lines of standard error."""
    status = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err.splitlines()


def result(capsys, *arguments):
    status, out, errors = run(capsys, *arguments, "--json")
    assert (status, errors) == (0, [])
    return json.loads(out)


def test_json_of_one_method(bag, capsys):
    track = result(capsys, bag)
    assert set(track) >= KEYS
    assert (track["method"], track["attitude_update"]) == ("midpoint", "so3")
    assert track["samples"] == 1001
    assert track["duration_s"] == pytest.approx(5.0)
    # The ellipse of the lecture, a quarter of it in 5 s, with its waves of 1 m.
    assert 25.0 < track["distance_m"] < 35.0
    assert track["final_position_error_m"] < 1e-3
    assert track["final_position_error_percent"] == pytest.approx(
        100.0 * track["final_position_error_m"] / track["distance_m"]
    )


@pytest.mark.parametrize(
    ("truth", "compared", "until"),
    [
        (slice(0, 401), 2.0, 2.0),  # the truth ends
        (np.r_[0:201, 601:1001], 1.0 + 1.995, 5.0),  # and has a gap of 2 s
    ],
)
def test_a_truth_of_a_part_of_the_readings_is_told(tmp_path, capsys, truth, compared, until):
    """Errors used to be those of the part, under the duration of the whole."""
    bag = write(tmp_path / "part", block_of(), truth)
    track = result(capsys, bag)
    share = compared / 5.0
    assert track["truth_coverage"] == pytest.approx(share)
    assert (track["compared_s"], track["truth_until_s"]) == pytest.approx((compared, until))
    for arguments in ((), ("--all",)):
        _, out, _ = run(capsys, bag, *arguments)
        coverage_text = (
            f"the truth covers {100 * share:.4g} % of the readings' time, {compared:g} of 5 s"
        )
        assert f"{coverage_text}, and ends after {until:g} s" in out


def test_odometry_that_passes_for_the_truth_is_named(tmp_path, capsys):
    """Readings with wheel/odom alone have no truth."""
    bag = write(tmp_path / "robot", block_of(), topics=("wheel/odom",))
    status, out, errors = run(capsys, bag)
    assert (status, len(errors)) == (0, 1)
    assert "taken as the truth: /wheel/odom, the only topic of nav_msgs/msg/Odometry" in errors[0]
    assert run(capsys, bag, "--truth-topic", "wheel/odom")[1:] == (out, [])


def test_a_whole_truth_needs_no_words(bag, capsys):
    track = result(capsys, bag)
    assert (track["truth_coverage"], track["compared_s"]) == pytest.approx((1.0, 5.0))
    assert "the truth covers" not in run(capsys, bag)[1]


def test_all_is_a_list_of_every_way(bag, capsys):
    tracks = result(capsys, bag, "--all")
    assert len(tracks) == 9
    assert all(set(entry) >= KEYS for entry in tracks)
    errors = {(e["method"], e["attitude_update"]): e["final_position_error_m"] for e in tracks}
    assert errors["euler", "so3"] > 100.0 * errors["midpoint", "so3"]


def test_table_names_units_and_methods(bag, capsys):
    _, out, _ = run(capsys, bag, "--all")
    assert "Final errors against the truth" in out
    assert "pos. [m]" in out
    assert out.count("midpoint") == 3
    assert run(capsys, bag, "--quiet")[1] == ""


def test_method_by_argument_and_by_parameter_file(bag, capsys, tmp_path):
    path = tmp_path / "integrator.yaml"
    path.write_text("integrator:\n  ros__parameters:\n    method: euler\n    max_gap: 1.0\n")
    assert result(capsys, bag, "--params-file", path)["method"] == "euler"
    assert result(capsys, bag, "--params-file", path, "--method", "rk4")["method"] == "rk4"
    assert result(capsys, bag, "--set", "attitude_update=quaternion")["attitude_update"] == (
        "quaternion"
    )


def test_known_biases_are_corrected(tmp_path, capsys):
    bias = {"imu__gyroscope_bias": [0.01, -0.02, 0.03], "imu__accelerometer_bias": 0.1}
    bag = write(tmp_path / "biased", block_of(**bias))
    calibration = tmp_path / "calibration.yaml"
    calibration.write_text(
        "/**:\n  ros__parameters:\n    imu:\n      gyroscope_bias: [0.01, -0.02, 0.03]\n"
        "      accelerometer_bias: 0.1\n      gyroscope_noise_density: 0.01\n"
    )
    assert result(capsys, bag)["final_position_error_m"] > 1.0
    assert result(capsys, bag, "--correction", calibration)["final_position_error_m"] < 1e-3


def test_levelling_from_rest(tmp_path, capsys):
    """A turned body at rest: roll, pitch and the gyroscope's bias are estimated, the body stays."""
    block = block_of("static", 10.0, imu__gyroscope_bias=[0.01, -0.02, 0.03])
    bag = write(tmp_path / "rest", block, topics=())
    track = result(capsys, bag, "--initial-state", "level", "-o", tmp_path / "level.txt")
    assert track["final_position_error_m"] is None
    poses = read_poses(tmp_path / "level.txt")
    assert np.abs(poses.position).max() < 1e-9


def test_the_earths_rate_can_be_corrected_for(tmp_path, capsys):
    block = block_of(duration=20.0, earth_rotation=True, latitude_deg=50.0)
    bag = write(tmp_path / "earth", block)
    latitude = np.radians(50.0)
    rate = 7.292115e-5 * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    without = result(capsys, bag)["final_position_error_m"]
    error_m = result(capsys, bag, "--set", f"earth_rate={rate.tolist()}")["final_position_error_m"]
    assert error_m < 2e-3
    assert without > 100 * error_m


def test_trajectory_files_and_picture(bag, capsys, tmp_path):
    for name in ("track.txt", "track.csv", "picture.png"):
        option = "--plot" if name.endswith("png") else "-o"
        assert run(capsys, bag, option, tmp_path / name, "--quiet") == (0, "", [])
    tum, csv = (read_poses(tmp_path / name) for name in ("track.txt", "track.csv"))
    assert len(tum.t_ns) == 1001
    np.testing.assert_array_equal(tum.t_ns, csv.t_ns)
    np.testing.assert_allclose(tum.position, csv.position)
    assert (tmp_path / "picture.png").stat().st_size > 20_000


def test_truth_among_other_odometry(tmp_path, capsys):
    bag = write(tmp_path / "two", block_of(), topics=("dead_reckoned/odom", "ground_truth/odom"))
    assert result(capsys, bag)["final_position_error_m"] < 1e-3
    chosen = result(capsys, bag, "--truth-topic", "dead_reckoned/odom")
    assert chosen["final_position_error_m"] < 1e-3


def test_a_truth_a_little_late_starts_the_integration(tmp_path, capsys):
    bag = write(tmp_path / "late", block_of(), truth=slice(10, None))
    assert result(capsys, bag)["samples"] == 991


def test_skip_begins_that_much_later(tmp_path, capsys):
    bag = write(tmp_path / "late", block_of(), truth=slice(400, None))
    assert result(capsys, bag, "--skip", "2s")["samples"] == 601


def complain(capsys, *arguments):
    """Return the lines of a run that fails as bad input does."""
    status, out, errors = run(capsys, *arguments)
    assert (status, out) == (2, "")
    return errors


def test_without_truth_an_initial_state_is_needed_and_no_error_is_stated(tmp_path, capsys):
    bag = write(tmp_path / "bare", block_of(), topics=())
    (line,) = complain(capsys, bag)
    assert "no truth to start from" in line
    assert "--initial-state level" in line
    track = result(capsys, bag, "--initial-state", "parameters")
    assert track["final_position_error_m"] is None
    assert track["distance_m"] > 0.0


def write_imu_csv(path, block):
    table = np.column_stack([block.gyro, block.accel]).tolist()
    stamps = block.t_ns.tolist()
    rows = [f"{t},{','.join(map(repr, row))}" for t, row in zip(stamps, table, strict=True)]
    header = "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z"
    path.write_text("\n".join([header, *rows]) + "\n")


def test_readings_of_a_folder_without_truth(tmp_path, capsys):
    """The form of kalibr_bagcreater: a folder with imu0.csv."""
    write_imu_csv(tmp_path / "imu0.csv", block_of())
    (line,) = complain(capsys, tmp_path)
    assert "no truth to start from" in line
    track = result(capsys, tmp_path, "--initial-state", "parameters")
    assert track["samples"] == 1001


def test_truth_that_starts_much_later(tmp_path, capsys):
    bag = write(tmp_path / "late", block_of(), truth=slice(400, None))
    (line,) = complain(capsys, bag)
    assert "the truth starts 2 s after the readings" in line
    assert "--skip 2s" in line


def test_readings_and_truth_of_different_times_are_refused(tmp_path, capsys):
    bag = write(tmp_path / "apart", block_of(), truth=slice(0, 300), imu=slice(400, None))
    (line,) = complain(capsys, bag)
    assert "readings and truth do not overlap in time" in line


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ([0], "1 reading: integration needs at least two"),
        ([*range(20, 40), *range(20)], "from row 20 (-0.100 s) on: the clock went back by 0.195 s"),
        (
            [0, 1, 2, 60],
            "longer than max_gap = 0.1 s, the first is 0.29 s after number 2",
        ),
    ],
)
def test_bad_stamps_are_refused_with_a_line(tmp_path, capsys, order, message):
    bag = write(tmp_path / "bad", block_of(), imu=order)
    (line,) = complain(capsys, bag)
    assert message in line


@pytest.mark.parametrize(
    ("order", "remark"),
    [
        ([0, 2, 1, *range(3, 40)], "1 samples came after later ones"),
        ([*range(20), *range(19, 40)], "1 samples came twice"),
    ],
)
def test_late_and_repeated_readings_change_nothing(tmp_path, capsys, order, remark):
    whole = write(tmp_path / "whole", block_of(), imu=list(range(40)))
    disordered = write(tmp_path / "disordered", block_of(), imu=order)
    status, out, (line,) = run(capsys, disordered, "--json")
    assert (status, json.loads(out)) == (0, result(capsys, whole))
    assert line.startswith("dead_reckon: warning: ")
    assert remark in line


def test_a_reading_that_is_not_finite_is_refused_with_its_stamp(tmp_path, capsys):
    block = block_of()
    block.gyro[7] = np.nan
    (line,) = complain(capsys, write(tmp_path / "nan", block))
    assert "message 7: stamp 1.035000000 s: a value that is not finite: angular velocity" in line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "method=heun"], "method = 'heun': must be one of euler, midpoint, rk4"),
        (["--set", "mehtod=euler"], "mehtod: unknown parameter; did you mean method?"),
        (["--correction", "missing.yaml"], "missing.yaml: No such file or directory"),
        (["--imu-topic", "/imu"], "has no topic /imu of sensor_msgs/msg/Imu"),
        (["-o", "/dev/null/track.txt"], "/dev/null/track.txt: /dev/null is not a folder"),
        (["--plot", "/dev/null"], "/dev/null: must end in .png or .svg or .pdf"),
    ],
)
def test_a_bad_argument_is_one_line(bag, capsys, arguments, message):
    errors = complain(capsys, bag, *arguments, "--quiet")
    assert len(errors) == 1
    assert message in errors[0]


def test_a_missing_bag_is_one_line(tmp_path, capsys):
    assert len(complain(capsys, tmp_path / "none")) == 1


@pytest.mark.parametrize("curved", [False, True])
def test_a_rotating_earth_is_integrated_as_the_realised_truth_tells(tmp_path, capsys, curved):
    """Without the Earth's rate, 7.3e-5 rad/s, 20 s end decimetres off; a curved Earth is said."""
    path = tmp_path / "turning.mcap"
    world = {"earth_rotation": "true", "latitude_deg": "48.0", "gravity_model": "wgs84"}
    if curved:
        world["curved_earth"] = "true"
    values = [word for name, value in world.items() for word in ("--set", f"{name}={value}")]
    assert generate(["--imu", "perfect", "--trajectory", "figure_eight", "--duration", "20s",
                          "--quiet", "-o", str(path), *values]) == 0  # fmt: skip

    def error() -> tuple[float, str]:
        assert main([str(path), "--json"]) == 0
        out = capsys.readouterr()
        return json.loads(out.out)["final_position_error_m"], out.err

    error_m, lines = error()
    assert ("curved Earth" in lines) == curved
    (tmp_path / "turning_truth.yaml").unlink()
    blind, lines = error()
    assert "curved Earth" not in lines
    assert error_m < 0.1 * blind
