# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ODOMETRY, OdometryEncoder
from imu_sim_ros.commands import generate
from imu_sim_ros.commands.evaluate import main
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import Remark
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import read_poses, write_tum

SECOND = 1_000_000_000
START = 1_500_000_000 * SECOND


def track(n=401, offset=0):
    t = np.arange(n) * 0.05
    position = np.stack([5 * np.cos(0.3 * t), 4 * np.sin(0.3 * t), np.sin(t)], axis=1)
    q_wb = rotation.from_euler(np.stack([0.1 * np.sin(t), 0.1 * np.cos(t), 0.3 * t], axis=1))
    return States(START + offset + np.arange(n) * SECOND // 20, position, q_wb)


@pytest.fixture
def truth(tmp_path):
    write_tum(tmp_path / "truth.txt", track())
    return tmp_path / "truth.txt"


def run(capsys, *arguments):
    status = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err.splitlines()


def result(capsys, *arguments):
    status, out, errors = run(capsys, *arguments, "--json")
    assert (status, errors) == (0, [])
    return json.loads(out)


def result_of_truth(capsys, *arguments):
    """Return the results of poses of the truth given as the estimate, which the program tells."""
    status, out, errors = run(capsys, *arguments, "--json")
    assert status == 0
    assert ["estimate_equals_truth" in line for line in errors] == [True]
    return json.loads(out)


def shifted(poses):
    """Return an estimate that is 1 cm beside the truth."""
    return replace(poses, position=poses.position + np.array([0.01, 0.0, 0.0]))


def saved(tmp_path, poses, name="estimate.txt"):
    write_tum(tmp_path / name, poses)
    return tmp_path / name


def test_a_constant_shift_is_the_ate_and_every_alignment_removes_it(tmp_path, truth, capsys):
    poses = track()
    estimate = saved(tmp_path, replace(poses, position=poses.position + np.array([3.0, 0.0, 4.0])))
    evaluation = result(capsys, estimate, truth)
    assert evaluation["ate_m"]["rmse"] == pytest.approx(5.0)
    assert evaluation["final_position_error_m"] == pytest.approx(5.0)
    assert evaluation["final_drift_percent"] == pytest.approx(500.0 / evaluation["distance_m"])
    assert evaluation["attitude_error_rad"]["max"] < 1e-9
    assert [entry["unit"] for entry in evaluation["rpe"]] == ["s"] + ["m"] * 5
    assert max(entry["translation_m"]["max"] for entry in evaluation["rpe"]) < 1e-9
    assert evaluation["nees"] is None
    assert evaluation["no_nees"].startswith("the estimate has no covariance")
    for kind in ("yaw", "se3", "sim3"):
        aligned = result(capsys, estimate, truth, "--align", kind)
        assert aligned["ate_m"]["max"] < 1e-9
        assert aligned["alignment"]["translation_m"] == pytest.approx([-3.0, 0.0, -4.0])


def test_other_stamps_are_interpolated(tmp_path, truth, capsys):
    """Estimates half way between the poses of the truth; one more on either side has no truth."""
    poses = track(403, -SECOND // 20 - SECOND // 40)
    t = (poses.t_ns - START) * 1e-9
    position = np.stack([5 * np.cos(0.3 * t), 4 * np.sin(0.3 * t), np.sin(t)], axis=1)
    evaluation = result(capsys, saved(tmp_path, replace(poses, position=position)), truth)
    assert evaluation["poses"] == 400
    assert evaluation["poses_without_truth"] == 3
    # A chord of 50 ms lies a h^2 / 8 off the arc, with at most 1.1 m/s^2.
    assert evaluation["ate_m"]["max"] < 1.1 * 0.05**2 / 8


def test_what_is_not_estimated_is_told(tmp_path, truth, capsys):
    """The first 1.95 s of 20 s; then two poses, which an alignment brings to the truth."""
    poses = shifted(track())
    start = saved(tmp_path, poses.rows(slice(None, 40)))
    evaluation = result(capsys, start, truth)
    assert evaluation["coverage"] == pytest.approx(1.95 / 20.0)
    assert (evaluation["estimated_s"], evaluation["truth_s"]) == pytest.approx((1.95, 20.0))
    assert evaluation["time_to_failure_s"] == pytest.approx(1.95)
    assert evaluation["initialisation_s"] == 0.0
    line = (
        "coverage: 9.75 %, 1.95 of 20 s of the truth; begins after 0 s and breaks off after "
        "1.95 s: the errors below say nothing about the rest"
    )
    assert line in run(capsys, start, truth)[1].splitlines()
    ends = saved(tmp_path, poses.rows(np.array([0, 400])))
    assert result(capsys, ends, truth, "--align", "yaw")["ate_m"]["rmse"] < 1e-9
    assert "coverage: 0 %, 0 of 20 s" in run(capsys, ends, truth)[1]
    # One pose a second has no gaps, unless there must be more; the default suits the rate.
    slow = saved(tmp_path, poses.rows(slice(None, None, 20)))
    assert result(capsys, slow, truth)["coverage"] == 1.0
    assert result(capsys, slow, truth, "--max-gap", "0.5s")["coverage"] == 0.0
    late = saved(tmp_path, poses.rows(slice(60, None)))
    assert (
        "coverage: 100 %, 17 of 20 s of the truth, 3 s allowed for the start\n"
        in (run(capsys, late, truth)[1])
    )


def test_rpe_over_what_is_asked_for(tmp_path, truth, capsys):
    poses = track()
    t = (poses.t_ns - START) * 1e-9
    drifting = replace(poses, position=poses.position + 0.1 * t[:, None] * [0.0, 0.0, 1.0])
    evaluation = result(capsys, saved(tmp_path, drifting), truth, "--rpe", "2s", "--rpe", "5frames")
    seconds, frames = evaluation["rpe"]
    assert seconds["translation_m"]["rmse"] == pytest.approx(0.2)
    assert frames["translation_m"]["rmse"] == pytest.approx(0.025)
    assert (seconds["pairs"], frames["pairs"]) == (361, 396)


def test_table_picture_and_output(tmp_path, truth, capsys):
    poses = track()
    moved = saved(tmp_path, replace(poses, position=poses.position + np.array([1.0, 0.0, 0.0])))
    aligned, picture = tmp_path / "aligned.txt", tmp_path / "picture.png"
    status, out, _ = run(capsys, moved, truth, "--align", "se3", "-o", aligned, "--plot", picture)
    assert status == 0
    assert "ATE position [m]" in out
    assert "alignment: se3" in out
    np.testing.assert_allclose(read_poses(aligned).position, poses.position, atol=1e-9)
    assert picture.stat().st_size > 20_000
    assert run(capsys, moved, truth, "--quiet")[1] == ""


def write_bag(path, poses, velocity_b=None, covariances=(None, None)):
    """Write poses in the order in which they stand, as a recorder does."""
    with open_writer(path) as writer:
        encoder = OdometryEncoder("world", "base_link", writer.encoding)
        handle = writer.add_topic("/dead_reckoned/odom", ODOMETRY)
        zero = np.zeros((len(poses.t_ns), 3))
        velocity_b = zero if velocity_b is None else velocity_b
        payloads = encoder.encode(
            poses.t_ns, poses.position, poses.q_wb, velocity_b, zero, *covariances
        )
        writer.write(handle, np.sort(poses.t_ns), payloads)
    return path


def test_a_topic_is_not_compared_with_itself(tmp_path, capsys):
    """A bag without a truth gave errors of 0, and a NEES of 0."""
    bag = write_bag(tmp_path / "run", track())
    argv = (bag, bag, "--estimate-topic", "dead_reckoned/odom")
    for arguments in (argv[:2], argv, (*argv, "--truth-topic", "/dead_reckoned/odom")):
        status, out, errors = run(capsys, *arguments)
        assert (status, out, len(errors)) == (2, "", 1)
        assert "estimate and truth are both /dead_reckoned/odom" in errors[0]


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_nees_of_a_bag_with_covariances(tmp_path, capsys, factor):
    """Independent errors of known size: the mean over 400 poses is 3, or 3/4 at twice the sigma."""
    rng = np.random.default_rng(12)
    poses = track()
    n = len(poses.t_ns)
    sigma = np.array([0.1, 0.2, 0.3, 0.01, 0.02, 0.03])
    errors = sigma * rng.normal(size=(n, 6))
    estimate = States(
        poses.t_ns,
        poses.position - errors[:, :3],
        rotation.multiply(rotation.exp(-errors[:, 3:]), poses.q_wb),
    )
    matrices = np.tile(np.diag(np.square(factor * sigma)), (n, 1, 1))
    matrices[0] = 0.0
    twist = np.tile(np.diag(np.square(factor * sigma)), (n, 1, 1))
    velocity_b = sigma[:3] * rng.normal(size=(n, 3))
    bag = write_bag(tmp_path / "estimate", estimate, velocity_b, (matrices, twist))
    truth = write_bag(tmp_path / "truth", poses)
    nees = result(capsys, bag, truth)["nees"]
    assert nees["poses"] == n - 1
    # The variance of a NEES of 3 degrees of freedom is 6: 4 sigma of the mean of 400.
    for name in ("position", "attitude", "velocity"):
        expected = 3.0 / factor**2
        assert nees[name]["mean"] == pytest.approx(expected, abs=4 * np.sqrt(6 / 400) / factor**2)
    aligned = result(capsys, bag, truth, "--align", "se3")
    assert aligned["nees"] is None
    assert aligned["no_nees"].startswith("alignment se3 removes a part")
    assert "NEES, 3 expected" in run(capsys, bag, truth)[1]


SIGMA_POSITION, SIGMA_ROTATION = 0.005, 0.002
LATE = 0.05


def motion(t):
    """Return positions and attitudes at any times [s], those of :func:`track`."""
    position = np.stack([5 * np.cos(0.3 * t), 4 * np.sin(0.3 * t), np.sin(t)], axis=1)
    return position, rotation.from_euler(
        np.stack([0.1 * np.sin(t), 0.1 * np.cos(t), 0.3 * t], axis=1)
    )


def late_estimate():
    """Return noisy poses between those of the truth, whose stamps are 50 ms late."""
    rng = np.random.default_rng(5)
    t = 0.013 + np.arange(399) * 0.05
    position, q_wb = motion(t)
    position = position + SIGMA_POSITION * rng.normal(size=position.shape)
    q_wb = rotation.multiply(q_wb, rotation.exp(SIGMA_ROTATION * rng.normal(size=(len(t), 3))))
    return t, States(START + np.round((t + LATE) * 1e9).astype(np.int64), position, q_wb)


def sigma_of_offset(t, interval=0.5):
    """Return what relative poses over 0.5 s can tell of an offset at best, as standard deviation.

    The information is the sum of squared derivatives of the relative motion over their variance;
    both ends of a pair are noisy (2 sigma^2), and a pose is the end of two pairs (2 again).
    """
    step = 1e-4
    t = t[(t > 1.0) & (t < 18.5)]
    changes = []
    for shift in (-step, step):
        p, q = motion(t + shift)
        p_end, q_end = motion(t + shift + interval)
        changes.append(
            (rotation.rotate_inverse(q, p_end - p), rotation.multiply(rotation.conjugate(q), q_end))
        )
    (p_0, q_0), (p_1, q_1) = changes
    slope_p = (p_1 - p_0) / (2 * step)
    slope_q = rotation.log(rotation.multiply(rotation.conjugate(q_0), q_1)) / (2 * step)
    information = np.sum(slope_p**2) / SIGMA_POSITION**2 + np.sum(slope_q**2) / SIGMA_ROTATION**2
    return np.sqrt(4.0 / information)


@pytest.mark.parametrize("align", ["none", "yaw", "sim3"])
def test_a_planted_time_offset_is_recovered(tmp_path, truth, capsys, align):
    t, poses = late_estimate()
    if align == "sim3":
        poses = replace(poses, position=2.0 * poses.position)
    estimate = saved(tmp_path, poses)
    plain = result(capsys, estimate, truth, "--align", align)
    assert plain["time_offset"] is None
    evaluation = result(capsys, estimate, truth, "--align", align, "--time-offset")
    sigma = sigma_of_offset(t)
    assert sigma < 2e-3
    assert evaluation["time_offset"]["value_s"] == pytest.approx(-LATE, abs=4 * sigma)
    # At up to 1.8 m/s, 50 ms are 90 mm, less what an alignment takes. Then noise is left.
    assert evaluation["time_offset"]["ate_rmse_m_before"] == pytest.approx(plain["ate_m"]["rmse"])
    assert plain["ate_m"]["rmse"] > 2 * np.sqrt(3) * SIGMA_POSITION
    noise = np.hypot(np.sqrt(3) * SIGMA_POSITION, 1.8 * 4 * sigma)
    assert evaluation["ate_m"]["rmse"] < noise
    out = run(capsys, estimate, truth, "--align", align, "--time-offset")[1]
    printed = re.search(r"time offset: (\S+) ms \(", out)
    assert float(printed[1]) == pytest.approx(1e3 * evaluation["time_offset"]["value_s"], abs=0.05)
    assert evaluation["time_offset"]["low_s"] < evaluation["time_offset"]["value_s"]
    assert evaluation["time_offset"]["high_s"] > evaluation["time_offset"]["value_s"]


def test_a_motion_that_shows_no_time_offset(tmp_path, capsys):
    """On a circle at constant speed every moment looks alike."""
    t = np.arange(401) * 0.05
    circle = States(
        START + np.arange(401) * SECOND // 20,
        np.stack([np.cos(t), np.sin(t), 0 * t], axis=1),
        rotation.from_euler(np.stack([0 * t, 0 * t, t], axis=1)),
    )
    truth, estimate = saved(tmp_path, circle, "truth.txt"), saved(tmp_path, circle)
    status, _, errors = run(capsys, estimate, truth, "--time-offset")
    assert (status, len(errors)) == (2, 1)
    assert "does not reveal a time offset" in errors[0]
    short = saved(tmp_path, circle.rows(slice(None, 30)), "short.txt")
    status, _, errors = run(capsys, short, truth, "--time-offset")
    assert (status, len(errors)) == (2, 1)
    assert "too little time in common" in errors[0]


@pytest.mark.parametrize("form", ["tum", "csv"])
def test_nees_of_text_with_covariances(tmp_path, truth, capsys, form):
    """OpenVINS' columns: rotation about the body's axes, then position; correlated errors."""
    rng = np.random.default_rng(3)
    poses = track()
    n = len(poses.t_ns)
    factors = rng.normal(size=(2, 3, 3)) * np.array([0.01, 0.1])[:, None, None]
    turned, moved = (rng.normal(size=(n, 3)) @ factor.T for factor in factors)
    position = poses.position - moved
    q_wb = rotation.multiply(poses.q_wb, rotation.exp(-turned))
    upper = np.triu_indices(3)
    columns = np.tile(np.concatenate([(f @ f.T)[upper] for f in factors]), (n, 1))
    path = tmp_path / f"estimate.{form}"
    if form == "csv":
        values = np.column_stack([position, q_wb, columns])
        rows = [
            ",".join([str(s), *map(repr, v)])
            for s, v in zip(poses.t_ns.tolist(), values.tolist(), strict=True)
        ]
    else:
        values = np.column_stack([position, q_wb[:, [1, 2, 3, 0]], columns])
        rows = [
            " ".join([f"{s / 1e9:.9f}", *map(repr, v)])
            for s, v in zip(poses.t_ns.tolist(), values.tolist(), strict=True)
        ]
    path.write_text("\n".join(rows) + "\n")
    nees = result(capsys, path, truth)["nees"]
    assert nees["poses"] == n
    assert nees["velocity"] is None
    for name in ("position", "attitude"):
        assert nees[name]["mean"] == pytest.approx(3.0, abs=4 * np.sqrt(6 / n))
    rows[7] = rows[7].rpartition("," if form == "csv" else " ")[0] + (
        ",nan" if form == "csv" else " nan"
    )
    path.write_text("\n".join(rows) + "\n")
    status, _, errors = run(capsys, path, truth)
    assert (status, len(errors)) == (2, 1)
    assert "line 8: 'nan' is not a finite number of a covariance" in errors[0]


def test_estimate_and_truth_in_one_bag(tmp_path, capsys):
    bag = tmp_path / "both"
    poses = track()
    with open_writer(bag) as writer:
        zero = np.zeros((len(poses.t_ns), 3))
        for topic, shift in (("/ground_truth/odom", 0.0), ("/dead_reckoned/odom", 1.0)):
            encoder = OdometryEncoder("world", "base_link", writer.encoding)
            handle = writer.add_topic(topic, ODOMETRY)
            payloads = encoder.encode(poses.t_ns, poses.position + shift, poses.q_wb, zero, zero)
            writer.write(handle, poses.t_ns, payloads)
    evaluation = result(capsys, bag, bag, "--estimate-topic", "dead_reckoned/odom")
    assert evaluation["ate_m"]["rmse"] == pytest.approx(np.sqrt(3.0))
    assert evaluation["velocity_error_m_s"]["max"] == 0.0


def complain(capsys, *arguments):
    status, out, errors = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert len(errors) == 1
    return errors[0]


def test_bad_files_and_options_are_refused_with_a_line(tmp_path, truth, capsys):
    (tmp_path / "a file").touch()
    apart = saved(tmp_path, track(offset=1000 * SECOND))
    assert "estimate and truth do not overlap in time" in complain(capsys, apart, truth)
    assert "missing.txt" in complain(capsys, tmp_path / "missing.txt", truth)
    still = replace(track(), position=np.zeros((401, 3)))
    line = complain(capsys, saved(tmp_path, still), truth, "--align", "se3")
    assert "on a line or in one place" in line
    estimate = saved(tmp_path, shifted(track()))
    line = complain(capsys, estimate, truth, "--rpe", "1000s")
    assert "delta = 1000 s: the trajectory has only 20 s" in line
    line = complain(capsys, estimate, truth, "-o", tmp_path / "a file" / "x.txt")
    assert "is not a folder" in line


def test_bad_rows_are_told_by_command_and_python(tmp_path, truth, capsys):
    estimate = saved(tmp_path, shifted(track()))
    lines = estimate.read_text().splitlines()
    lines[9] = lines[9].replace(lines[9].split()[1], "nan", 1)
    estimate.write_text("\n".join(lines) + "\n")
    assert "line 10" in complain(capsys, estimate, truth)
    status, _, errors = run(capsys, estimate, truth, "--skip-bad-rows")
    assert (status, errors) == (0, [f"evaluate: {estimate}: 1 bad rows skipped"])
    with pytest.warns(Remark, match="1 bad rows skipped"):
        evaluation = ims.evaluate(estimate, truth, skip_bad_rows=True, rpe=["2s", (5, "m")])
    assert [entry["unit"] for entry in evaluation.to_dict()["rpe"]] == ["s", "m"]
    assert len(evaluation.t_ns) == 400
    with pytest.raises(ims.ConfigurationError, match="rpe = '5 parsec': must be pairs"):
        ims.evaluate(truth, truth, rpe=["5 parsec"])


def test_bag_with_stamps_out_of_order(tmp_path, truth, capsys):
    poses = track()
    order = np.r_[0:200, 201, 200, 202:401]
    status, _, errors = run(capsys, write_bag(tmp_path / "bag", poses.rows(order)), truth)
    assert status == 0
    assert "1 samples came after later ones" in errors[0]


@pytest.mark.parametrize("delta", ["0s", "5 parsec", "-1m"])
def test_a_delta_without_a_known_unit_or_length_is_refused(truth, delta, capsys):
    with pytest.raises(SystemExit, match="2"):
        main([str(truth), str(truth), f"--rpe={delta}"])
    assert "is not a delta such as 1s, 10m or 5frames" in capsys.readouterr().err


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    """Return a folder of tracks of two cameras with noise of 0.7 px, and the truth at 200 Hz."""
    folder = tmp_path_factory.mktemp("tracks") / "flight"
    argv = (
        f"-o {folder} --format tracks --trajectory figure_eight --duration 5s --seed 3 --quiet "
        "--camera euroc_cam0 --camera tum_vi_cam0 --scene cloud --set camera.body_axes=flu "
        "--set camera.pixel_noise=0.7 --set camera.outlier_probability=0.05 "
        "--set cam1.camera.row_time=2e-5 --set camera.time_offset=0.01"
    )
    assert generate.main(argv.split()) == 0
    return folder


def test_the_true_path_leaves_the_pixel_noise(tracks, capsys):
    """2 n values of known deviation: theirs is within 3 / sqrt(4 n) of it, n above 5000: 2.1 %."""
    path = tracks / "groundtruth.tum"
    reprojection = result_of_truth(capsys, path, path, "--tracks", tracks)["reprojection"]
    assert [entry["camera"] for entry in reprojection] == ["cam0", "cam1"]
    for entry in reprojection:
        assert entry["features"] > 5000
        assert entry["rms_px"] == pytest.approx(0.7, rel=0.021)
        assert entry["rms_px"] == pytest.approx(entry["rms_px_of_truth"], rel=1e-12)
        assert entry["behind"] == 0


def test_a_turned_path_sees_landmarks_elsewhere(tracks, capsys, tmp_path):
    """1 degree about the view of a pinhole with f = 458 px is 8 px at the centre."""
    poses = read_poses(tracks / "groundtruth.tum")
    turn = rotation.from_euler(np.array([[0.0, 0.0, np.radians(1.0)]]))
    off = saved(tmp_path, replace(poses, q_wb=rotation.multiply(poses.q_wb, turn)))
    entry = result(capsys, off, tracks / "groundtruth.tum", "--tracks", tracks)["reprojection"][0]
    assert 7.0 < entry["median_px"] < 12.0
    assert entry["rms_px_of_truth"] == pytest.approx(0.7, rel=0.021)
    status, out, _ = run(capsys, off, tracks / "groundtruth.tum", "--tracks", tracks)
    assert status == 0
    assert "reprojection, cam0:" in out


def test_frames_without_a_pose_near_them_are_left_out(tracks, capsys, tmp_path):
    poses = read_poses(tracks / "groundtruth.tum")
    sparse = saved(tmp_path, poses.rows(slice(None, None, 100)))
    truth = tracks / "groundtruth.tum"
    entry = result_of_truth(capsys, sparse, truth, "--tracks", tracks)["reprojection"]
    assert entry[0]["rms_px"] == pytest.approx(0.7, rel=0.1)  # 10 frames
    # Rows of a rolling shutter are between poses half a second apart.
    assert [camera["camera"] for camera in entry] == ["cam0", "cam1"]
    assert entry[1]["features"] < 50
    assert entry[0]["features"] < 0.2 * entry[0]["of"]
    _, out, _ = run(capsys, sparse, truth, "--tracks", tracks)
    for camera in entry:
        few = f"{camera['features']:,} features of {camera['of']:,}, the others without poses"
        assert few in out


def test_bad_tracks_are_one_line(tracks, capsys, tmp_path):
    path = tracks / "groundtruth.tum"
    status, _, errors = run(capsys, path, path, "--tracks", tmp_path / "none")
    assert (status, len(errors)) == (2, 1)
    copy = tmp_path / "copy"
    shutil.copytree(tracks, copy)
    (copy / "tracks.npz").write_bytes((copy / "tracks.npz").read_bytes()[:1000])
    status, _, errors = run(capsys, path, path, "--tracks", copy)
    assert (status, len(errors)) == (2, 1)
    assert "is not the tracks.npz of generate" in errors[0]
    with np.load(tracks / "tracks.npz") as archive:
        arrays = dict(archive)
    np.savez(copy / "tracks.npz", **{**arrays, "landmark": arrays["landmark"] + 10**6})
    status, _, errors = run(capsys, path, path, "--tracks", copy)
    assert (status, len(errors)) == (2, 1)
    assert "landmark: must be 0 to" in errors[0]


def test_nees_with_yaw_and_position_free(tmp_path, capsys):
    poses, yaw, sigma = track(), rotation.exp([0.0, 0.0, 2.0]), np.repeat([0.2, 0.02], 3)
    uncertain = np.minimum(np.arange(n := len(poses.t_ns)), 1)[:, None]  # the start is exact
    errors = uncertain * sigma * np.random.default_rng(12).normal(size=(n, 6))
    q_wb = rotation.multiply(yaw, rotation.multiply(rotation.exp(-errors[:, 3:]), poses.q_wb))
    moved = rotation.rotate(yaw, poses.position - errors[:, :3] + np.array([5.0, -3.0, 2.0]))
    stated = np.diag(np.square(sigma)) * uncertain[..., None]
    bag = write_bag(
        tmp_path / "a", replace(poses, position=moved, q_wb=q_wb), None, (stated, stated)
    )
    nees = result(capsys, bag, write_bag(tmp_path / "truth", poses), "--align", "yaw")["nees"]
    means = [nees["position"]["mean"], nees["attitude"]["mean"]]
    assert means == pytest.approx([3.0, 3.0], abs=4 * np.sqrt(6 / 400))


def test_two_foreign_files_have_a_line_each(tmp_path, capsys):
    for name in ("first.md", "second.md"):
        (tmp_path / name).write_text("# no trajectory\n", encoding="utf-8")
    status, _, errors = run(capsys, tmp_path / "first.md", tmp_path / "second.md")
    assert status == 2
    assert [line.partition(": ")[2].partition(": not a bag")[0] for line in errors] == [
        str(tmp_path / "first.md"),
        str(tmp_path / "second.md"),
    ]
