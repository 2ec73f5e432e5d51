# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every job refuses, corrects or tells the findings of a recording as it declares."""

import warnings

import numpy as np
import pytest
from faults import FAULTS, STAMPS

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.commands import convert_bag as convert_command
from imu_sim_ros.commands import dead_reckon as dead_reckon_command
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, InputWarning
from imu_sim_ros.core.records import LiveReading, replace_fields
from imu_sim_ros.recordings.findings.catalogue import KINDS, reading_findings, unit_findings
from imu_sim_ros.recordings.findings.live import UnitWatch
from imu_sim_ros.recordings.findings.policy import JOBS, ROLES
from imu_sim_ros.recordings.findings.survey import ReadingSurvey
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import load_error_model

ALL = {**FAULTS, **STAMPS}
START_NS = 1_050_000_000_000_000_000
"""Start of a recording in 2003: files take its stamps also 32 years earlier and later."""


@pytest.fixture(scope="module")
def flights():
    rate, seed = 400.1, 3
    return {
        # Half of it, up to a reset of the clock, is the shortest record that allan takes.
        "rest": ims.simulate(imu="bmi088", trajectory="static", rate=rate, duration=125, seed=seed),
        "faces": ims.simulate(imu="bmi088", trajectory="six_position", rate=100, seed=seed),
        "motion": ims.simulate(
            imu="bmi088", trajectory="figure_eight", rate=rate, duration=12, seed=seed
        ),
    }


def with_constant_axes(readings):
    """Return readings of which rates about z and forces along y alone have noise.

    An analysis leaves constant axes out, and takes a third of the time.
    """
    gyro, accel = readings.gyro.copy(), readings.accel.copy()
    gyro[:, :2], accel[:, ::2] = gyro[0, :2], accel[0, ::2]
    return replace_fields(readings, gyro=gyro, accel=accel)


def told_by(call):
    """Return the lines that a job tells, with those of its result."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call()
    return [str(entry.message) for entry in caught] + list(getattr(result, "warnings", ()))


def allan(readings, flight, folder):
    return told_by(lambda: ims.allan(readings, force=True))


def dead_reckon(readings, flight, folder):
    truth = flight.truth
    initial = ims.NavigationState(truth.position[0], truth.velocity[0], truth.q_wb[0])
    return told_by(lambda: ims.dead_reckon(readings, initial=initial))


def add_errors(readings, flight, folder):
    lines = []
    model = GivenImu(load_error_model({"imu.preset": "perfect", "rate": 400.1}), (), lines.append)
    model.read(readings)
    model.finish()
    return lines


def integrator(readings, flight, folder):
    watch, lines = UnitWatch("imu"), []
    columns = (readings.t_ns.tolist(), readings.gyro.tolist(), readings.accel.tolist())
    for t_ns, gyro, accel in zip(*columns, strict=True):
        findings = watch.add(LiveReading(t_ns, tuple(gyro), tuple(accel)))
        JOBS["integrator"].judge(findings, lines.append)
        if watch.done:
            break
    return lines


def convert_bag(readings, flight, folder):
    rows = np.column_stack([readings.gyro, readings.accel])
    path = folder / "given.csv"
    with path.open("w") as file:
        for t_ns, row in zip(readings.t_ns.tolist(), rows.tolist(), strict=True):
            file.write(f"{t_ns + START_NS}," + ",".join(map(repr, row)) + "\n")
    return told_by(lambda: ims.convert(path, folder / "out.mcap", force=True))


def calibrate(readings, flight, folder):
    return told_by(lambda: ims.calibrate_six_position(readings))


PROGRAMS = {
    # On six faces no axis is upwards throughout.
    "calibrate": (calibrate, "faces", [kind for kind in FAULTS if not kind.startswith("axes")]),
    # The analysis itself tells what it corrects; it refuses the others before it begins.
    "allan": (allan, "rest", [k for k in ALL if JOBS["allan"].action(k) == "corrects"]),
    "dead_reckon": (dead_reckon, "motion", ALL),
    "add_errors, error_model": (add_errors, "motion", FAULTS),
    "integrator": (integrator, "motion", FAULTS),
}


@pytest.mark.parametrize("job", PROGRAMS)
def test_each_job_does_as_it_declares(flights, tmp_path, job):
    run, name, kinds = PROGRAMS[job]
    flight, policy, wrong = flights[name], JOBS[job], []
    for kind in kinds:
        clean = flight.readings
        if job == "allan" and kind != "axis_stuck":  # which other axes that are not stuck tell
            clean = with_constant_axes(clean)
        readings = ALL[kind](clean)
        absent = readings.gyro is None or readings.accel is None
        if absent and job in ("integrator", "add_errors, error_model"):
            continue  # their readings have both
        assert kind in {finding.kind for finding in reading_findings(readings)}, kind
        action = policy.action(kind)
        tag = f"[{kind}]"
        try:
            lines = run(readings, flight, tmp_path)
        except InputError as error:
            lines = error.problems
            # Without a level axis there is no calibration; the finding says why.
            says_why = job == "calibrate" and action == "tells" and tag in lines[0]
            if action != "refuses" and not says_why:
                wrong.append((kind, action, "refused", lines))
                continue
        if any(tag in line for line in lines) != bool(action):
            wrong.append((kind, action, lines))
    assert not wrong, wrong


def test_units_that_later_motion_shows_are_judged_the_same_by_all(tmp_path):
    """A gyroscope without noise in deg/s, at rest for 80 s, that is 8,000 readings."""
    still, moving = (
        ims.simulate(imu="perfect", trajectory=name, rate=100, duration=duration)
        for name, duration in (("static", 80), ("tumble", 20))
    )
    t_ns = np.concatenate([still.readings.t_ns, moving.readings.t_ns + 80 * 10**9])
    gyro = np.degrees(np.concatenate([still.readings.gyro, moving.readings.gyro]))
    accel = np.concatenate([still.readings.accel, moving.readings.accel])
    readings = ims.Readings(t_ns, gyro, accel)
    kind = "gyroscope_degrees"
    assert [finding.kind for finding in ims.inspect(readings).findings] == [kind]
    runs = [convert_bag(readings, still, tmp_path), dead_reckon(readings, still, tmp_path)]
    with pytest.raises(InputError, match=rf"\[{kind}\]"):
        ims.twin(readings, moving.truth)
    for lines in runs:
        assert sum(f"[{kind}]" in line for line in lines) == 1, lines
    survey = ReadingSurvey(unit_findings)  # that of allan, which reads block by block
    blocks = [readings.rows(slice(begin, begin + 777)) for begin in range(0, len(t_ns), 777)]
    assert [finding.kind for block in blocks for finding in survey.add(block)] == [kind]
    converted = ims.Readings(t_ns, np.radians(gyro), accel)
    assert ims.inspect(converted).findings == ()


def rounded(values, form):
    return np.vectorize(lambda value: float(format(value, form)))(values)


COPIES = {
    "bits": lambda truth: (truth.position, truth.q_wb),
    "millimetres": lambda truth: (truth.position.round(3), truth.q_wb.round(3)),
    "digits": lambda truth: (rounded(truth.position, ".6g"), rounded(truth.q_wb, ".6g")),
    "32 bits": lambda truth: (
        truth.position.astype(np.float32).astype(float),
        truth.q_wb.astype(np.float32).astype(float),
    ),
}


@pytest.mark.parametrize("name", COPIES)
def test_an_estimate_that_is_its_truth_is_told(flights, name):
    """Also at a tenth of the rate, with stamps of whole milliseconds, and aligned."""
    truth = flights["motion"].truth
    position, q_wb = COPIES[name](truth)
    plain = ims.States(truth.t_ns, truth.position, truth.q_wb)
    for rows, late_ns, align in ((1, 0, "none"), (10, 400_000, "se3")):
        copy = ims.States(truth.t_ns[::rows] + late_ns, position[::rows], q_wb[::rows])
        with pytest.warns(InputWarning, match=r"\[estimate_equals_truth\]"):
            ims.evaluate(copy, plain, align=align)


@pytest.mark.parametrize("decimals", [3, 12])
def test_a_good_estimate_is_not_taken_for_its_truth(flights, decimals):
    """A tenth of a millimetre of noise, in rounded numbers or not; and a body at rest."""
    truth = flights["motion"].truth
    noise = 1e-4 * np.random.default_rng(1).normal(size=(len(truth), 3))
    estimate = ims.States(truth.t_ns, (truth.position + noise).round(decimals), truth.q_wb)
    still = ims.States(
        truth.t_ns, np.zeros((len(truth), 3)), np.tile(truth.q_wb[0], (len(truth), 1))
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ims.evaluate(estimate, ims.States(truth.t_ns, truth.position, truth.q_wb))
        ims.evaluate(still, still)


def test_trajectories_in_the_wrong_place_are_refused(flights):
    flight = flights["motion"]
    track = ims.dead_reckon(flight)
    with pytest.raises(InputError, match=r"\[truth_as_estimate\]"):
        ims.evaluate(flight.truth, track)
    with pytest.raises(InputError, match=r"\[estimate_as_truth\]"):
        ims.evaluate(track, track)
    assert all(JOBS["evaluate"].action(kind) == "refuses" for kind in ROLES)


def test_declarations_name_kinds_that_exist_once():
    for name, policy in JOBS.items():
        kinds = [*policy.refuses, *policy.corrects, *policy.tells]
        assert set(kinds) <= set(KINDS), name
        assert len(set(kinds)) == len(kinds), name


@pytest.mark.parametrize("name", ["two.bag", "two.mcap"])
def test_inspect_tells_of_two_frames_on_a_topic_and_judges_each(flights, tmp_path, name):
    readings = flights["motion"].readings.rows(slice(3000))
    with open_writer(tmp_path / name, BagOptions()) as writer:
        topic = writer.add_topic("/imu/data_raw", IMU)
        blocks = [
            Block(topic, readings.t_ns, encoder.pattern(readings.t_ns, readings.gyro, accel))
            for encoder, accel in (
                (ImuEncoder("left", writer.encoding), readings.accel),
                (ImuEncoder("right", writer.encoding), readings.accel / 9.80665),
            )
        ]
        writer.write_blocks(blocks)
    inspection = ims.inspect(tmp_path / name)
    assert [finding.kind for finding in inspection.findings] == ["frames_mixed", "accelerometer_g"]
    assert "left (3,000), right (3,000)" in inspection.findings[0].evidence
    assert inspection.findings[1].source.endswith(", right")
    with pytest.raises(InputError, match=r"frame=\.\.\. chooses one \[frames_mixed\]"):
        ims.dead_reckon(tmp_path / name)

    with pytest.raises(InputError, match=r"frame=\.\.\. chooses one \[frames_mixed\]"):
        ims.add_errors_to_file(tmp_path / name, tmp_path / "noisy.mcap", imu="perfect")
    added = ims.add_errors_to_file(
        tmp_path / name, tmp_path / "l.mcap", imu="perfect", frame="left"
    )
    assert added.messages["/imu/data_raw"] == 3000


@pytest.mark.parametrize(("name", "rows"), [("stray.csv", [0]), ("stray.mcap", [0, 500])])
def test_add_errors_leaves_out_stray_stamps_and_names_them(flights, tmp_path, name, rows):
    """A first stamp of 0 is no pause of 53 years, and one in the middle no other clock."""
    readings = flights["motion"].readings.rows(slice(1000))
    t_ns = readings.t_ns + 1_700_000_000_000_000_000
    t_ns[rows] = 5_000_000_000 * np.arange(len(rows))
    path = tmp_path / name
    if name.endswith(".csv"):
        columns = zip(
            t_ns.tolist(), *readings.gyro.T.tolist(), *readings.accel.T.tolist(), strict=True
        )
        path.write_text("\n".join(",".join(map(str, row)) for row in columns), encoding="utf-8")
    else:
        with open_writer(path) as writer:
            topic = writer.add_topic("/imu", IMU)
            encoder = ImuEncoder("imu_link", writer.encoding)
            messages = encoder.pattern(t_ns, readings.gyro, readings.accel)
            writer.write_blocks([Block(topic, readings.t_ns, messages)])
    added = ims.add_errors_to_file(path, tmp_path / "noisy.mcap", imu="perfect")
    assert added.messages["/imu/data_raw"] == 1000 - len(rows)
    (line,) = added.warnings
    assert f"{len(rows)} stamps are far from their neighbours, the first is 0 ns" in line


def test_add_errors_refuses_a_topic_of_one_triad(flights, tmp_path):
    """Zeros that a covariance of -1 marks as absent were taken as accelerations."""
    readings = flights["motion"].readings.rows(slice(100))
    with open_writer(tmp_path / "gyro.mcap") as writer:
        topic = writer.add_topic("/camera/gyro/sample", IMU)
        absent = np.diag([-1.0, 0.0, 0.0])
        encoder = ImuEncoder("gyro", writer.encoding, accel_covariance=absent)
        rows = encoder.pattern(readings.t_ns, readings.gyro, 0.0 * readings.accel)
        writer.write_blocks([Block(topic, readings.t_ns, rows)])
    with pytest.raises(InputError, match=r"merge two topics \[accelerometer_absent\]"):
        ims.add_errors_to_file(tmp_path / "gyro.mcap", tmp_path / "noisy.mcap", imu="perfect")
    ims.report(tmp_path / "gyro.mcap", tmp_path / "page.html")  # which tells all findings
    assert "accelerometer_absent" in (tmp_path / "page.html").read_text()


@pytest.fixture(scope="module")
def circle():
    return ims.simulate(imu="bmi088", trajectory="circle", rate=100, duration=30, seed=3)


def changed_poses(truth, kind):
    """Return poses with a fault of a kind."""
    if kind == "poses_held":
        rows = np.arange(len(truth)) // 4 * 4
        position, q_wb = truth.position[rows], truth.q_wb[rows]
    else:
        turn = {"z_down": [0.0, 1.0, 0.0, 0.0], "axes_camera": [0.5, -0.5, 0.5, -0.5]}[kind]
        position, q_wb = truth.position, rotation.multiply(truth.q_wb, np.array(turn))
    return replace_fields(truth, position=position, q_wb=q_wb, velocity=None, angular_velocity=None)


def test_dead_reckoning_tells_the_axes_of_its_truth_on_the_command_line(circle, tmp_path, capsys):
    poses, readings = changed_poses(circle.truth, "axes_camera"), circle.readings
    with open_writer(tmp_path / "camera.mcap", BagOptions()) as writer:
        topics = writer.add_topic("/imu/data_raw", IMU), writer.add_topic("/odom", ODOMETRY)
        truth = OdometryEncoder("odom", "base_link", writer.encoding).encode(
            poses.t_ns, poses.position, poses.q_wb, 0.0 * poses.position, 0.0 * poses.position
        )
        encoder = ImuEncoder("imu_link", writer.encoding)
        rows = encoder.pattern(readings.t_ns, readings.gyro, readings.accel)
        blocks = [Block(topics[0], readings.t_ns, rows), Block(topics[1], poses.t_ns, truth)]
        writer.write_blocks(blocks)
    assert dead_reckon_command.main([str(tmp_path / "camera.mcap"), "--json"]) == 0
    lines = capsys.readouterr().err.splitlines()
    warned = [line for line in lines if line.startswith("dead_reckon: warning: ")]
    kinds = {line.rpartition(" [")[2] for line in warned}
    assert kinds == {"twist_unfilled]", "axes_camera]"}
    with pytest.warns(InputWarning, match="axes_camera"):
        ims.dead_reckon(tmp_path / "camera.mcap")


@pytest.mark.parametrize("kind", ["stamps_shared", "stamps_bunched", "messages_repeated"])
def test_an_error_model_tells_stamps_reading_by_reading_as_those_of_a_file(flights, kind):
    """A message that came twice is no batch, also across two calls."""
    readings = STAMPS[kind](flights["motion"].readings.rows(slice(2000)))
    parameters = load_error_model({"imu.preset": "perfect", "rate": 400.1})
    live, file = list[str](), list[str]()
    model = GivenImu(parameters, (), live.append)
    columns = (readings.t_ns.tolist(), readings.gyro.tolist(), readings.accel.tolist())
    for row, (t_ns, gyro, accel) in enumerate(zip(*columns, strict=True)):
        if model.read_few([LiveReading(t_ns, tuple(gyro), tuple(accel))]) is None:
            model.read(readings.rows(slice(row, row + 1)))
    model.finish()
    model = GivenImu(parameters, (), file.append)
    model.read(readings)
    kinds = [] if kind == "messages_repeated" else [kind]
    for lines in (live, file):
        tags = [line.rpartition(" [")[2].rstrip("]") for line in lines if "[stamps_" in line]
        assert tags == kinds, lines


def test_a_copy_tells_what_each_topic_lacks(flights, tmp_path, capsys):
    """Two topics of one triad each, as cameras with an IMU have them, stay as they are."""
    readings, path = flights["motion"].readings.rows(slice(500)), tmp_path / "apart.mcap"
    absent, zeros = np.diag([-1.0, 0.0, 0.0]), np.zeros((len(readings), 3))
    with open_writer(path) as writer:
        for triad, lacking in (("gyro", "accel"), ("accel", "gyro")):
            topic = writer.add_topic(f"/{triad}/sample", IMU)
            encoder = ImuEncoder(triad, writer.encoding, **{f"{lacking}_covariance": absent})
            values = {"gyro": readings.gyro, "accel": readings.accel, lacking: zeros}
            rows = encoder.pattern(readings.t_ns, values["gyro"], values["accel"])
            writer.write_blocks([Block(topic, readings.t_ns, rows)])
    assert convert_command.main([str(path), "-o", str(tmp_path / "copy.mcap")]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "_absent]" in line]
    assert len(lines) == 2
    assert "/gyro/sample: contains no readings of the accelerometer" in lines[0]
    assert "/accel/sample: contains no readings of the gyroscope" in lines[1]
    for name in ("gyro", "accel"):
        copy, source = (
            ims.read_readings(tmp_path / file, topic=f"/{name}/sample")
            for file in ("copy.mcap", "apart.mcap")
        )
        assert (copy.gyro is None, copy.accel is None) == (name == "accel", name == "gyro")
        np.testing.assert_array_equal(getattr(copy, name), getattr(source, name))
    chosen = ims.convert(path, tmp_path / "one.mcap", topics="/gyro/sample")
    assert [line for line in chosen.warnings if "gyroscope" in line] == []
    with pytest.raises(InputError, match="accelerometer_absent"):
        ims.convert(path, tmp_path / "one.csv", topics="/gyro/sample")
