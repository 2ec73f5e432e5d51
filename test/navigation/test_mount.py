# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU that is offset and turned in the body: every way to dead-reckon states the body's motion.

With readings without errors nothing is left but the steps of the integration: 2.3e-5 m after 6 s of
figure_eight at 200 Hz, mounted or not. With mounting or lever arm ignored it is 247 m and 0.15 m.
"""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands.dead_reckon import main
from imu_sim_ros.commands.generate import main as generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator

MOUNTING = [1, 0, 0, 0, 0, -1, 0, 1, 0]
ARM = [0.1, -0.2, 0.3]
PLACE = {"lever_arm": ARM, "mounting": MOUNTING}
OF_STEPS = 5e-5
"""[m] Twice what the steps leave of an exact record."""


def flight(trajectory="figure_eight", duration=6.0, imu="perfect", seed=1, **world):
    return ims.simulate(
        imu={"preset": imu, **PLACE}, trajectory=trajectory, duration=duration, seed=seed, **world
    )


def generated(path, *arguments):
    place = [f"--set=imu.{name}={json.dumps(value)}" for name, value in PLACE.items()]
    common = ["--imu", "perfect", "--trajectory", "figure_eight", "--duration", "6s", "--quiet"]
    assert generate([*common, *place, "-o", str(path), *arguments]) == 0
    return path


@pytest.mark.parametrize("world", [{}, {"earth_rotation": True, "latitude_deg": 48.0}])
def test_a_flight_from_its_truth(world):
    track = ims.dead_reckon(flight(**world))
    assert track.to_dict()["final_position_error_m"] < OF_STEPS
    assert track.to_dict()["rms_velocity_error_m_s"] < OF_STEPS


def test_a_flight_that_starts_level_at_rest():
    """A body at rest that is level by its own axes, whatever those of the IMU."""
    track = ims.dead_reckon(flight("static", 4.0), initial="level")
    np.testing.assert_allclose(track.position[-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(track.q_wb[-1]), [1, 0, 0, 0], atol=1e-9)


@pytest.mark.parametrize("name", ["own.mcap", "moved.mcap", "folder"])
def test_a_file_says_where_its_imu_is(tmp_path, capsys, name):
    """The realised truth next to it, /tf_static and sensor.yaml have the mount."""
    of_form = {
        "own.mcap": [],
        "moved.mcap": ["--topics", "imu/data_raw,ground_truth/odom,tf_static"],
        "folder": ["--format", "euroc"],
    }
    path = generated(tmp_path / name, *of_form[name])
    if name != "own.mcap":
        (tmp_path / f"{path.stem}_truth.yaml").unlink()
    assert main([str(path), "--json"]) == 0
    out = capsys.readouterr()
    assert json.loads(out.out)["final_position_error_m"] < OF_STEPS
    assert out.err == ""


def test_an_unknown_place_is_said_and_can_be_given(tmp_path, capsys):
    path = generated(tmp_path / "flight.mcap")
    (tmp_path / "flight_truth.yaml").unlink()
    assert main([str(path), "--json"]) == 0
    out = capsys.readouterr()
    assert "nothing says where imu_link is in base_link" in out.err
    assert json.loads(out.out)["final_position_error_m"] > 100.0
    place_options = [f"--set=imu.{name}={json.dumps(value)}" for name, value in PLACE.items()]
    assert main([str(path), "--json", *place_options]) == 0
    assert json.loads(capsys.readouterr().out)["final_position_error_m"] < OF_STEPS


def test_imus_of_different_places_need_a_name(tmp_path):
    place = ["--set", f"right.imu.mounting={MOUNTING}"]
    two = ["--set", "imus=[left, right]", *place, "--quiet"]
    path = tmp_path / "two.mcap"
    common = ["--imu", "perfect", "--trajectory", "figure_eight", "--duration", "6s"]
    assert generate([*common, *two, "-o", str(path)]) == 0
    for side in ("left", "right"):
        track = ims.dead_reckon(path, imu_topic=f"/{side}/imu/data_raw")
        assert track.to_dict()["final_position_error_m"] < OF_STEPS
    renamed = tmp_path / "renamed.mcap"
    names = [f"--topic={side}/imu/data_raw=/{side[0]}" for side in ("left", "right")]
    assert generate([*common, *two, *names, "-o", str(renamed)]) == 0
    with pytest.raises(InputError, match="IMUs of different mounts"):
        ims.dead_reckon(renamed, imu_topic="/r")


def test_the_nees_of_a_campaign_with_a_lever_arm_is_consistent(tmp_path):
    """Also its consistency: what the lever arm adds to the covariance."""
    plan = tmp_path / "plan.yaml"
    place = f"imu.mounting: {MOUNTING}, imu.lever_arm: [3.0, -2.0, 1.0]"
    motion = "trajectory.type: figure_eight, duration: 4.0"
    plan.write_text(f"parameters: {{imu.preset: adis16448, {place}, {motion}}}\nseeds: 40\n")
    rows = ims.campaign(plan, tmp_path / "campaign").runs
    for name in ("position", "velocity", "attitude"):
        mean = np.mean([row[f"nees_{name}"] for row in rows])
        # chi-square of 3: mean 3, deviation of the mean sqrt(6 / 40) = 0.39; three of them.
        assert abs(mean - 3.0) < 3.0 * np.sqrt(6.0 / 40.0), name


def test_the_node_gives_what_the_record_gives():
    """And says in which frames: those of the odometry that it started from."""
    built = flight(imu="adis16448")
    track = ims.dead_reckon(built, covariance=True)
    imu = {f"imu.{name}": value for name, value in PLACE.items()}
    values = {"initial_state": "truth", "imu.preset": "adis16448", **imu}
    parameters = load_integrator(values)
    odometer = LiveIntegrator(parameters, lambda _: None, lambda: False)
    truth = built.truth
    earlier = (
        truth.position[0],
        truth.q_wb[0],
        rotation.rotate_inverse(truth.q_wb[0], truth.velocity[0]),
        truth.angular_velocity[0],
    )
    rows = odometer.add_truth(
        LiveState(int(truth.t_ns[0]), *map(tuple, earlier), frames=("map", "vehicle"))
    )
    for t_ns, gyro, accel in zip(
        built.t_ns.tolist(), built.gyro.tolist(), built.accel.tolist(), strict=True
    ):
        rows += odometer.add_reading(LiveReading(t_ns, tuple(gyro), tuple(accel)))
    assert odometer.frames == ("map", "vehicle")
    np.testing.assert_allclose([r.position for r in rows], track.position, atol=1e-10)
    np.testing.assert_allclose([r.q_wb for r in rows], track.q_wb, atol=1e-10)
    velocity_b = rotation.rotate_inverse(track.q_wb, track.velocity)
    np.testing.assert_allclose([r.velocity_b for r in rows], velocity_b, atol=1e-10)
    np.testing.assert_allclose(
        np.sqrt(np.diag(rows[-1].covariance)),
        np.sqrt(np.diag(track.covariance[-1])),
        rtol=0.01,
    )
