# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Other people's estimators on simulated clouds: KISS-ICP and RKO-LIO, with the files for them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation

pytest.importorskip("kiss_icp")
pytest.importorskip("rko_lio")

TURNING = {
    "type": "harmonic",
    "rest_before": 0.5,
    "x": {"amplitude": [1.5], "angular_frequency": [0.5]},
    "y": {"amplitude": [1.0], "angular_frequency": [1.0]},
}
RAYS = {"preset": "vlp16", "firing_period": 221.184e-6}
"""A VLP-16 with a quarter of its rays: tests are short."""


def fly(rate, duration=4.0):
    """Return a flight in a warehouse whose heading swings at up to so many rad/s, at 0.64 Hz."""
    yaw = {"amplitude": [rate / 4.0], "angular_frequency": [4.0]}
    return ims.simulate(
        imu="adis16448",
        trajectory={**TURNING, "yaw": yaw},
        duration=duration,
        rate=200,
        seed=1,
        sensors=["lidar"],
        lidar=RAYS,
        scene={"type": "warehouse"},
    )


def error(estimate, truth):
    """Return the root mean square distance [m] after the best rigid motion (Umeyama 1991)."""
    a, b = estimate - estimate.mean(axis=0), truth - truth.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return np.sqrt((((a @ turn) - b) ** 2).sum(axis=1).mean())


def kiss_icp(flight):
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.mapping.voxel_size = 0.3
    odometry, places = KissICP(config), []
    for k in range(len(flight.lidar)):
        cloud = flight.lidar.cloud(k)
        odometry.register_frame(cloud.xyz.astype(float), cloud.time / 0.1)
        places.append(odometry.last_pose[:3, 3].copy())
    t = (flight.lidar.true_t_ns - flight.t0_ns) * 1e-9 + 0.05  # the middle of the scan
    return error(np.array(places), flight.trajectory.sample(t).position)


def rko_lio(flight):
    from rko_lio.config import LIOConfig
    from rko_lio.lio import LIO

    odometry, mount = LIO(LIOConfig(voxel_size=0.3)), np.eye(4)
    readings = iter(zip(flight.t_ns, flight.gyro, flight.accel, strict=True))
    for k in range(len(flight.lidar)):
        cloud = flight.lidar.cloud(k)
        stamps = cloud.t_ns + np.rint(cloud.time * 1e9).astype(np.int64)
        for t_ns, gyro, accel in readings:
            odometry.add_imu_measurement(accel, gyro, int(t_ns), mount)
            if t_ns > stamps[-1]:
                break
        odometry.register_scan(cloud.xyz.astype(float), stamps, mount)
    t_ns, poses = odometry.poses_with_timestamps()
    t = (np.asarray(t_ns) - flight.t0_ns) * 1e-9
    return error(np.array(poses)[:, :3], flight.trajectory.sample(t).position)


def test_both_follow_slow_turns_and_an_imu_helps_in_fast_ones():
    """Within 8 cm over 3 m at 0.5 rad/s; at 4 rad/s a scan turns by 23 deg, which needs an IMU."""
    slow = fly(0.5)
    assert kiss_icp(slow) < 0.08
    assert rko_lio(slow) < 0.08
    fast = fly(4.0)
    with_imu = rko_lio(fast)
    assert with_imu < 0.08
    assert kiss_icp(fast) > 3.0 * with_imu


def plane_icp(flight):
    """Return the error of small_gicp's ICP from points to planes, against the last scans."""
    gicp = pytest.importorskip("small_gicp")
    pose, previous, places, keyframes, target = np.eye(4), np.eye(4), [], [], None
    for k in range(len(flight.lidar)):
        cloud = flight.lidar.cloud(k)
        within_range = cloud.range < 60.0
        # The sensor turns slowly: over a scan it moves as over the last one.
        step = np.linalg.inv(previous) @ pose
        xyz = cloud.xyz[within_range] + (cloud.time[within_range, None] / 0.1 - 0.5) * step[:3, 3]
        source, _ = gicp.preprocess_points(xyz, downsampling_resolution=0.25, num_threads=1)
        if target is not None:
            guess = pose @ step
            registration = gicp.align(
                *(target[0], source, target[1], guess),
                registration_type="PLANE_ICP",
                max_correspondence_distance=1.0,
                num_threads=1,
            )
            previous, pose = pose, registration.T_target_source
        places.append(pose[:3, 3].copy())
        points = np.asarray(source.points())[:, :3] @ pose[:3, :3].T + pose[:3, 3]
        if not keyframes or np.linalg.norm(places[-1] - keyframes[-1][0]) > 0.3:
            keyframes = [*keyframes, (places[-1], points)][-15:]
            all_points = np.concatenate([points for _, points in keyframes])
            target = gicp.preprocess_points(all_points, downsampling_resolution=0.25, num_threads=1)
    t = (flight.lidar.true_t_ns - flight.t0_ns) * 1e-9 + 0.05
    return error(np.array(places), flight.trajectory.sample(t).position)


def test_a_corridor_is_in_the_clouds_for_who_uses_its_few_walls_across():
    """Registration from points to planes errs by 3 cm over 7 m; KISS-ICP, points to points, stays.

    9 of 10 points are on walls along the way, and are as near to their neighbours wherever the
    sensor is.
    """
    flight = ims.simulate(
        imu="adis16448", trajectory="tour", duration=8.0, rate=200, seed=1, sensors=["lidar"],
        lidar=RAYS, scene={"type": "corridor"},
    )  # fmt: skip
    assert plane_icp(flight) < 0.05
    assert kiss_icp(flight) > 1.0


def tum(path):
    """Return stamps [s] and positions (n, 3) of a TUM file."""
    rows = np.loadtxt(path)
    return rows[:, 0], rows[:, 1:4]


def test_their_programs_run_on_a_bag_with_the_files_for_them(tmp_path, monkeypatch):
    """Clouds, times and extrinsics from a rosbag2 folder: the path of the body, to 10 cm."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    mount = ["lever_arm=[0.2, -0.1, 0.3]", "mounting=[0, -1, 0, 1, 0, 0, 0, 0, 1]"]
    argv = [
        *("-o", "flight", "--trajectory", "tour", "--scene", "office", "--duration", "4s"),
        *("--imu", "adis16448", "--lidar", "vlp16", "--with-configs", "--quiet", "--seed", "1"),
        *("--set", "lidar.firing_period=221.184e-6"),
        *(word for assignment in mount for word in ("--set", f"lidar.{assignment}")),
    ]
    assert generate.main(argv) == 0
    bin_folder = Path(sys.executable).parent
    configs = tmp_path / "flight_configs"
    for program, *options in (
        ("kiss_icp_pipeline", "--topic", "/points"),
        ("rko_lio", "--imu", "/imu/data_raw", "--lidar", "/points", "-o", "rko"),
    ):
        file = configs / f"{program.removesuffix('_pipeline')}.yaml"
        command = [bin_folder / program, "flight", "--config", file, *options]
        subprocess.run(command, check=True, capture_output=True)
    truth = ims.read_odometry("flight")

    def of_body(stamps):
        """Return the positions of the body, whose attitude a tour does not change."""
        axes = truth.position.T
        return np.stack(
            [np.interp(stamps, truth.t_ns * 1e-9, coordinate) for coordinate in axes], axis=1
        )

    (estimate,) = (tmp_path / "rko").rglob("*_tum.txt")
    stamps, places = tum(estimate)
    assert len(stamps) >= 39  # the last scan ends after the last reading
    assert error(places, of_body(stamps)) < 0.1
    # With the LiDAR's mount the path is the body's own, not one turned by it.
    moved = places - places[0]
    path = rotation.rotate_inverse(truth.q_wb[:1], of_body(stamps))
    assert np.linalg.norm(moved[-1] - (path[-1] - path[0])) < 0.2
    estimate = next((tmp_path / "results" / "latest").resolve().glob("*_tum.txt"))
    stamps, places = tum(estimate)
    assert len(stamps) == 40
    assert error(places, of_body(stamps + 0.05)) < 0.1


def test_lio_sam_gets_the_rings_that_it_sorts_points_by(tmp_path):
    """LIO-SAM's ``livox`` reads x, y, z, intensity, ring, time, and counts the points of lines.

    src/imageProjection.cpp of 0be1fbe: points beyond Horizon_SCAN in their line are left out.
    """
    for layout in ("livox", "velodyne"):
        argv = ["-o", str(tmp_path / f"{layout}.mcap"), "--duration", "0.1s", "--imu", "adis16448"]
        argv += ["--lidar", "mid360", "--set", f"lidar.layout={layout}", "--scene", "ground"]
        assert generate.main([*argv, "--with-configs", "--quiet"]) == 0
    assert not (tmp_path / "livox.mcap_configs" / "lio_sam.yaml").exists()
    assert (tmp_path / "livox.mcap_configs" / "fast_lio.yaml").exists()
    text = (tmp_path / "velodyne.mcap_configs" / "lio_sam.yaml").read_text()
    settings = yaml.safe_load(text)["lio_sam"]
    assert (settings["sensor"], settings["N_SCAN"], settings["Horizon_SCAN"]) == ("livox", 4, 5000)
    assert settings["pointCloudTopic"] == "/points"


def test_the_files_have_the_mount_and_the_noise(tmp_path):
    """R_il and p_il in closed form: IMU and LiDAR are both moved and turned on the body."""
    path = tmp_path / "a.mcap"
    argv = [
        *("-o", str(path), "--duration", "0.2s", "--imu", "adis16448", "--with-configs", "--quiet"),
        *("--lidar", "os1_64", "--set", "lidar.lever_arm=[1.0, 2.0, 3.0]"),
        *("--set", "lidar.mounting=[0, -1, 0, 1, 0, 0, 0, 0, 1]"),
        *("--set", "imu.lever_arm=[0.5, 0.0, 0.0]", "--rate", "200"),
        *("--set", "imu.mounting=[1, 0, 0, 0, 0, -1, 0, 1, 0]"),
    ]
    assert generate.main(argv) == 0
    settings = {
        name: yaml.safe_load((tmp_path / "a.mcap_configs" / f"{name}.yaml").read_text())
        for name in ("fast_lio", "lio_sam", "rko_lio", "kiss_icp")
    }
    r_bi = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    r_bl = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    r_il, p_il = r_bi.T @ r_bl, r_bi.T @ np.array([0.5, 2.0, 3.0])
    mapping = settings["fast_lio"]["mapping"]
    assert np.allclose(np.reshape(mapping["extrinsic_R"], (3, 3)), r_il)
    assert np.allclose(mapping["extrinsic_T"], p_il)
    assert settings["fast_lio"]["preprocess"] == {
        "lidar_type": 3, "scan_line": 64, "scan_rate": 10, "timestamp_unit": 3, "blind": 0.8,
    }  # fmt: skip
    sam = settings["lio_sam"]["lio_sam"]
    assert np.allclose(np.reshape(sam["extrinsicRot"], (3, 3)), r_il.T)
    assert np.allclose(sam["extrinsicTrans"], -r_il.T @ p_il)
    assert (sam["sensor"], sam["N_SCAN"], sam["Horizon_SCAN"]) == ("ouster", 64, 1024)
    density = ims.simulate(imu="adis16448", duration=0.1).parameters.imu.accelerometer.noise_density
    assert mapping["acc_cov"] == pytest.approx(density[0] ** 2 * 200.0)
    assert sam["imuAccNoise"] == pytest.approx(density[0])
    of_lidar = settings["rko_lio"]["extrinsic_lidar2base_quat_xyzw_xyz"]
    half = np.sqrt(0.5)
    assert np.allclose(of_lidar, [0, 0, half, half, 1, 2, 3])
    of_imu = settings["rko_lio"]["extrinsic_imu2base_quat_xyzw_xyz"]
    assert np.allclose(of_imu, [half, 0, 0, half, 0.5, 0, 0])
    assert settings["kiss_icp"]["data"]["min_range"] == 0.8
    # 40 m at 10 % are 126 m at 100 %.
    assert settings["kiss_icp"]["data"]["max_range"] == pytest.approx(40.0 / np.sqrt(0.1), rel=1e-6)
