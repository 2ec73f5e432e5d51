# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The front door gives what the rooms behind it give, bit for bit, under names by triad."""

import gc

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import imu_sim_ros as ims
from imu_sim_ros.commands.generate import main as generate
from imu_sim_ros.core.conventions import ERROR_TOPICS, ERRORS
from imu_sim_ros.terminal.text_tables import html_of

IMU = {"preset": "mpu6000", "dropout_probability": 0.02, "duplicate_probability": 0.02}


def flight(imu=IMU, **arguments):
    return ims.simulate(imu=imu, trajectory="figure_eight", duration=20, rate=200, **arguments)


def assert_same_readings(expected, actual):
    for name in ("t_ns", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(expected, name), getattr(actual, name))


@pytest.mark.parametrize("name", ["flight.bag", "flight.mcap", "flight"])
def test_what_is_saved_is_what_is_read_and_what_generate_writes(name, tmp_path, capsys):
    simulated = flight(seed=3)
    saved = simulated.save(tmp_path / name)
    other_file = tmp_path / f"other_{name}"
    settings = [f"--set=imu.{key}={value}" for key, value in IMU.items() if key != "preset"]
    arguments = ["--imu=mpu6000", "--trajectory=figure_eight", "--duration=20s", "--rate=200"]
    assert generate([*arguments, "--seed=3", "-o", str(other_file), *settings, "--quiet"]) == 0
    assert_same_readings(ims.read_imu(saved), simulated)
    assert_same_readings(ims.read_imu(other_file), simulated)
    assert len(simulated) != len(simulated.truth) == 4000
    truth, odometry = simulated.truth, ims.read_odometry(saved, "ground_truth/odom")
    np.testing.assert_array_equal(odometry.position, truth.position)
    # The twist of a message is in the body: turned there and back.
    np.testing.assert_allclose(odometry.velocity, truth.velocity, rtol=0, atol=1e-13)


def test_datasets_are_written_and_read(tmp_path):
    simulated = flight()
    assert_same_readings(ims.read_imu(simulated.save(tmp_path / "table.csv")), simulated)
    assert_same_readings(ims.read_imu(simulated.save(tmp_path / "mav0", format="euroc")), simulated)
    with pytest.raises(ims.InputError, match="imu/temperature: does not exist in csv"):
        simulated.save(tmp_path / "b.csv", topics=["imu/data_raw", "imu/temperature"])
    with pytest.raises(ims.InputError, match=r"flight\.bag"):
        simulated.save(simulated.save(tmp_path / "flight.bag"))


def test_blocks_are_the_same_samples_in_any_size():
    whole = ims.simulate(imu="mpu6000", trajectory="circle", duration=5, seed=2)
    for size in (1, 333, 100_000):
        parts = ims.blocks(imu="mpu6000", trajectory="circle", duration=5, seed=2, block_size=size)
        np.testing.assert_array_equal(np.concatenate([b.gyro for b in parts]), whole.gyro)


def test_the_truths_explain_the_readings_in_python_and_in_a_bag(tmp_path):
    """Temperature, ageing and noise are on. S is the identity: the scale multiplies the ideal."""
    imu = {"preset": "perfect", "gyroscope_bias": [0.1, -0.2, 0.3], "accelerometer_rate_ramp": 1e-3}
    imu |= {"age_days": 9.0, "gyroscope_noise_density": 1e-3, "accelerometer_ageing_scale": 0.01}
    imu |= {"gyroscope_temperature_scale": [1e-3, 2e-3, 3e-3], "accelerometer_bandwidth": 20.0}
    imu |= {"gyroscope_turn_on_scale_sigma": 0.01, "accelerometer_noise_density": 1e-3}
    warm = {"profile": [0.0, 25.0, 10.0, 45.0]}
    simulated = ims.simulate(imu=imu, trajectory="lecture", duration=10, temperature=warm)
    truth = simulated.truth
    topics = [f"ground_truth/{t}_{e}" for t in ("gyroscope", "accelerometer") for e in ERRORS]
    simulated.save(tmp_path / "all.mcap", topics=["imu/data_raw", "ground_truth/imu", *topics])
    triads_by_topic = {topic: ([], []) for topic in ("imu/data_raw", "ground_truth/imu", *topics)}
    with AnyReader([tmp_path / "all.mcap"]) as reader:
        for connection, _, raw in reader.messages():
            message, name = reader.deserialize(raw, connection.msgtype), connection.topic[1:]
            vectors = (
                (message.vector,)
                if name in topics
                else (message.angular_velocity, message.linear_acceleration)
            )
            for rows, vector in zip(triads_by_topic[name], vectors, strict=False):
                rows.append((vector.x, vector.y, vector.z))
    for k, (name, triad) in enumerate((("gyro", "gyroscope"), ("accel", "accelerometer"))):
        bagged = {
            error: np.array(triads_by_topic[f"ground_truth/{triad}_{error}"][0]) for error in ERRORS
        }
        for error, values in bagged.items():
            np.testing.assert_array_equal(values, getattr(truth, f"{name}_{error}"), error)
        reading, ideal = (
            np.array(triads_by_topic[t][k]) for t in ("imu/data_raw", "ground_truth/imu")
        )
        np.testing.assert_array_equal(ideal, getattr(truth, name))
        scale = bagged.pop("scale")
        assert np.abs(scale - 1.0).max() > 1e-3
        np.testing.assert_allclose(reading, ideal + sum(bagged.values()), rtol=0, atol=1e-14)
        bagged["response_error"] = (scale - 1.0) * ideal
        np.testing.assert_allclose(reading, ideal + sum(bagged.values()), rtol=0, atol=1e-14)
    np.testing.assert_allclose(truth.gyro_bias[-1], [0.1, -0.2, 0.3], rtol=1e-15)
    assert not truth.gyro_low_pass.any()


def test_parameters_are_keyword_arguments_with_their_ros_names(tmp_path):
    file = tmp_path / "base.yaml"
    file.write_text("/**:\n  ros__parameters:\n    rate: 50.0\n    seed: 9\n")
    simulated = ims.simulate(
        trajectory={"type": "polar", "height": 2.0},
        duration="1min",
        gravity=np.array([0.0, 0.0, -9.8]),
        temperature={"value": 20.0},
        params_file=file,
        rate=100,
    )
    assert simulated.parameters.rate == 100.0
    assert simulated.parameters.seed == 9
    assert simulated.temperature[0] == 20.0
    assert simulated.parameters.gravity == (0.0, 0.0, -9.8)


def test_a_kalibr_file_is_a_sensor(tmp_path):
    file = tmp_path / "imu.yaml"
    file.write_text("accelerometer_noise_density: 0.02\ngyroscope_noise_density: 0.01\n")
    simulated = ims.simulate(imu=file, trajectory="static", duration=1)
    assert simulated.parameters.imu.accelerometer.noise_density == (0.02,) * 3


def test_poses_are_a_trajectory():
    source = ims.simulate(imu="perfect", trajectory="circle", duration=10, rate=50).truth
    poses = ims.PoseSequence(source.t_ns, source.position, source.q_wb)
    simulated = ims.simulate(imu="perfect", trajectory=poses, rate=200)
    assert ims.evaluate(simulated.truth, source).rms_position < 1e-4


@pytest.mark.parametrize(
    ("arguments", "message_pattern"),
    [
        ({"imu": "mpu600"}, "unknown IMU 'mpu600'; did you mean mpu6000?"),
        ({"rate": -1}, "rate = -1"),
        ({"duration": "10 parsecs"}, "not a duration"),
        ({"trajectory": "static"}, "no end"),
        ({"imu": {"gyroscope_bais": 1.0}}, "did you mean imu.gyroscope_bias"),
    ],
)
def test_bad_arguments_say_what_is_wrong(arguments, message_pattern):
    with pytest.raises(ims.ConfigurationError, match=message_pattern):
        ims.simulate(**arguments)


def test_frames_have_a_column_for_each_axis():
    pytest.importorskip("pandas")
    simulated = flight("mpu6000")
    frame = simulated.to_frame()
    columns = [f"{triad}_{axis}" for triad in ("gyro", "accel") for axis in "xyz"]
    assert list(frame.columns) == columns
    np.testing.assert_array_equal(frame["accel_y"].to_numpy(), simulated.accel[:, 1])
    np.testing.assert_array_equal(frame.index.to_numpy(), simulated.t_ns)
    assert "q_w" in ims.dead_reckon(simulated).to_frame().columns


def test_the_frame_of_a_truth_has_every_true_error():
    pytest.importorskip("pandas")
    truth = flight("mpu6000").truth
    frame = truth.to_frame()
    for name in ("acceleration", "gyro", *ERROR_TOPICS.values()):
        columns = frame[[f"{name}_{axis}" for axis in "xyz"]].to_numpy()
        np.testing.assert_array_equal(columns, getattr(truth, name))
    assert "q_w" in frame.columns


def test_times_are_seconds_from_the_start():
    simulated = flight("mpu6000")
    evaluation = ims.evaluate(ims.dead_reckon(simulated), simulated.truth)
    for record in (simulated, simulated.readings, simulated.truth, evaluation):
        np.testing.assert_allclose(record.t, (record.t_ns - record.t_ns[0]) * 1e-9)


def test_presets_are_listed_with_what_they_are():
    assert ims.simulate(imu=sorted(ims.presets())[0], duration=0.1)
    assert "figure_eight" in ims.presets("trajectory")
    assert all(ims.presets(kind) for kind in ("camera", "scene", "gnss", "wheels", "lidar"))
    with pytest.raises(ims.ConfigurationError, match="did you mean camera"):
        ims.presets("cameras")


def test_results_are_shown_as_html_in_notebooks():
    """Text of the results is escaped: the name of a file may be anything."""
    simulated = ims.simulate(imu="adis16448", trajectory="static", duration="2min")
    shown = {
        "adis16448 on static": simulated,
        "ATE position": ims.evaluate(ims.dead_reckon(simulated), simulated.truth),
        "Gyroscope": ims.allan(simulated),
        "200": ims.inspect(simulated),
    }
    for text, result in shown.items():
        html = result._repr_html_()
        assert html.count("<table>") == html.count("</table>") > 0
        assert text in html
    assert html_of(["<b>"]) == "<div>&lt;b&gt;</div>"


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("align", lambda simulated: ims.evaluate(simulated, simulated.truth, algin="yaw")),
        ("model", lambda simulated: ims.allan(simulated, modell="gauss_markov")),
        ("trajectory", lambda simulated: ims.simulate(trajektory="circle")),
        ("method", lambda simulated: ims.dead_reckon(simulated, metod="rk4")),
        ("topic", lambda simulated: ims.read_readings("flight.mcap", topics="/imu")),
    ],
)
def test_an_unknown_keyword_gets_the_nearest_name(name, call):
    with pytest.raises(ims.ConfigurationError, match=f"did you mean {name}\\?"):
        call(flight("mpu6000"))


def test_a_flight_is_called_by_the_names_that_were_typed():
    simulated = ims.simulate(imu={"preset": "bmi088"}, trajectory={"type": "circle"}, duration=0.1)
    assert simulated.name == "bmi088 on circle"


def test_short_words_say_what_is_inside():
    simulated = flight("mpu6000", seed=7)
    assert repr(simulated).startswith("<Flight mpu6000 on figure_eight: ")
    assert "seed 7" in repr(simulated)
    assert repr(ims.dead_reckon(simulated)).startswith("<Track midpoint, so3: ")


def test_pictures_are_figures(tmp_path):
    simulated = flight("mpu6000")
    track = ims.dead_reckon(simulated)
    still = ims.simulate(imu="adis16448", trajectory="static", duration="2min")
    for figure in (
        simulated.plot(),
        track.plot(),
        ims.evaluate(track, simulated.truth).plot(),
        ims.allan(still).plot(),
    ):
        figure.savefig(tmp_path / "picture.png")
        assert (tmp_path / "picture.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x", "x.csv", "new/parents/x.mcap"])
def test_saving_overwrites_nothing_unless_forced(tmp_path, name):
    first_flight, second_flight = flight(seed=1), flight(seed=2)
    path = first_flight.save(tmp_path / name)
    with pytest.raises(ims.InputError, match="already exists"):
        second_flight.save(path)
    assert_same_readings(ims.read_imu(path), first_flight)
    assert_same_readings(ims.read_imu(second_flight.save(path, force=True)), second_flight)
    assert sorted(entry.name for entry in path.parent.iterdir()) == [path.name]


def test_saving_never_writes_over_the_trajectory_s_file(tmp_path):
    poses = tmp_path / "poses.tum"
    poses.write_text("".join(f"{k / 10} {k / 10} 0 0 0 0 0 1\n" for k in range(50)))
    simulated = ims.simulate(trajectory=poses, duration=1)
    bytes_before = poses.read_bytes()
    with pytest.raises(ims.InputError, match="is the input"):
        simulated.save(poses, format="csv", force=True)
    assert poses.read_bytes() == bytes_before


def test_a_failed_save_leaves_what_was_there(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("mine")
    with pytest.raises(ims.InputError, match="does not exist in csv"):
        flight().save(path, topics=["imu/data_raw", "imu/temperature"], force=True)
    assert path.read_text() == "mine"
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.csv"]


def test_given_poses_keep_their_stamps():
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=5, rate=100)
    truth = flight.truth
    late = truth.t_ns + 1_403_636_579_000_000_000
    poses = ims.PoseSequence(late, truth.position, truth.q_wb)
    again = ims.simulate(imu="perfect", trajectory=poses, rate=100)
    assert again.t_ns[0] == late[0]
    shifted_flight = ims.simulate(imu="perfect", trajectory=poses, rate=100, start_time=7.0)
    assert shifted_flight.t_ns[0] == 7 * 10**9


def test_dead_reckoning_of_a_flight_takes_its_world():
    world = {"earth_rotation": True, "latitude_deg": 48.0, "gravity": [0.0, 0.0, -9.7]}
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=20, rate=200, **world)
    track = ims.dead_reckon(flight)
    assert ims.evaluate(track, flight.truth).final_position < 0.05


def _simulate():
    ims.dead_reckon(ims.simulate(imu="mpu6000", duration=1.0, seed=1))


def _read_one_by_one():
    model = ims.ErrorModel(imu="mpu6000", rate=200.0)
    for k in (0, 1, 2, 1, 3):
        model.read(k * 5_000_000, np.zeros(3), np.array([0.0, 0.0, 9.81]))


def _add_errors():
    t_ns = np.arange(50) * 5_000_000
    ims.add_errors(t_ns, np.zeros((50, 3)), np.tile([0.0, 0.0, 9.81], (50, 1)), imu="bmi088")


@pytest.mark.parametrize("run", [_simulate, _read_one_by_one, _add_errors])
def test_memory_of_simulated_readings_is_free_without_the_garbage_collector(run):
    """A cycle of references would keep the samples of each run until the collector finds it."""
    run()
    gc.collect()
    gc.disable()
    try:
        run()
        unreachable_count = gc.collect()
    finally:
        gc.enable()
    assert unreachable_count == 0
