# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMUs on the segments of a moving person, each on its mount and with its own errors."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bvhio")
pytest.importorskip("ezc3d")

import mocap

import imu_sim_ros as ims
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import walk

pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
SECONDS = 4.0


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    path = tmp_path_factory.mktemp("segments") / "walk.bvh"
    walk.write(path, SECONDS)
    return path


@pytest.mark.parametrize(
    ("upper", "lower"), [("LeftArm", "LeftForeArm"), ("RightUpLeg", "RightLeg")]
)
def test_joint_angles_of_integrated_readings_are_those_of_the_formula(walking, upper, lower):
    """Elbow and knee to 0.1 degree, from noise-free readings alone after a known start.

    Each IMU is mounted elsewhere and turned on its segment; the joint has one angle, about y.
    """
    turned = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    mounts = {upper: {"lever_arm": [0.0, 0.05, -0.1]}, lower: {"mounting": turned}}
    flights = ims.simulate(
        trajectory=walking, segments=mounts, imu="perfect", rate=100, duration=SECONDS
    )
    q_upper, q_lower = (ims.dead_reckon(flight).q_wb for flight in flights.values())
    joint = rotation.multiply(rotation.conjugate(q_upper), q_lower)
    angle = np.rad2deg(rotation.log(joint))
    expected = walk.angles(lower, flights[upper].t)[:, 1]
    assert np.abs(angle[:, 1] - expected).max() < 0.1
    assert np.abs(angle[:, [0, 2]]).max() < 0.1


def test_mount_is_on_the_segment(tmp_path):
    """A segment that turns at w about a fixed axis: w^2 r towards the axis, at the mount."""
    rate, radius = 2.0, 0.3
    t = np.arange(301) / 60.0
    skeleton = [
        "HIERARCHY", "ROOT Base", "{", "OFFSET 0 0 0", "CHANNELS 0", "JOINT Wheel", "{",
        "OFFSET 0 150 0", "CHANNELS 1 Yrotation", "End Site", "{", "OFFSET 0 20 0", "}", "}", "}",
    ]  # fmt: skip
    path = tmp_path / "wheel.bvh"
    path.write_text(mocap.bvh(skeleton, np.rad2deg(rate * t)[:, None], "0.0166667"))
    flights = ims.simulate(
        trajectory=path,
        segments={"Wheel": {"lever_arm": [radius, 0.0, 0.0]}},
        imu="perfect",
        rate=50,
        gravity=[0.0, 0.0, -9.81],
    )
    inner = slice(25, -25)  # the ends of a spline are less exact
    accel = flights["Wheel"].accel[inner]
    np.testing.assert_allclose(
        accel, np.tile([-(rate**2) * radius, 0, 9.81], (len(accel), 1)), atol=5e-3
    )
    gyro = flights["Wheel"].gyro[inner]
    np.testing.assert_allclose(gyro, np.tile([0, 0, rate], (len(gyro), 1)), atol=1e-3)


def test_each_unit_has_its_seed_and_is_that_of_a_single_simulation(walking):
    arguments = {"imu": "mpu6000", "rate": 50, "duration": 2.0}
    flights = ims.simulate(
        trajectory=walking, segments=["LeftArm", "RightArm"], seed=5, **arguments
    )
    assert [*flights] == ["LeftArm", "RightArm"]
    for seed, (name, flight) in enumerate(flights.items(), 5):
        motion = {"type": "poses", "file": str(walking), "topic": name}
        alone = ims.simulate(trajectory=motion, seed=seed, **arguments)
        np.testing.assert_array_equal(flight.gyro, alone.gyro)
        np.testing.assert_array_equal(flight.accel, alone.accel)
        np.testing.assert_array_equal(flight.truth.position, alone.truth.position)
        np.testing.assert_array_equal(flight.truth.gyro_bias, alone.truth.gyro_bias)
    assert repr(flights["RightArm"]).startswith("<Flight mpu6000 on RightArm of walk: 100 at 50 Hz")


def test_other_sensors_of_each_imu(walking):
    flights = ims.simulate(
        trajectory=walking, segments=["Head"], sensors=["magnetic_field"], rate=50, duration=1
    )
    assert len(flights["Head"].magnetic_field) == 100  # its own rate


def test_generate_writes_what_simulate_returns(walking, tmp_path, capsys):
    """All segments in a bag, each in its namespace with its truth and its frame; one by itself."""
    bag = tmp_path / "all.mcap"
    options = ["--trajectory", str(walking), "--rate", "50", "--duration", "1s", "--seed", "1"]
    assert generate.main(["-o", str(bag), "--segment", "all", *options]) == 0
    with open_bag(bag) as opened:
        names = {topic.name for topic in opened.topics}
    expected = {
        f"/{name}/{topic}"
        for name in walk.SKELETON
        for topic in ("imu/data_raw", "ground_truth/odom")
    }
    assert names == expected | {"/ground_truth/odom"}
    flights = ims.simulate(trajectory=walking, segments="all", rate=50, duration=1, seed=1)
    assert [*flights] == [*walk.SKELETON]
    for name in ("Hips", "LeftFoot"):
        readings = ims.read_readings(bag, f"/{name}/imu/data_raw")
        np.testing.assert_array_equal(readings.gyro, flights[name].gyro)
        truth = ims.read_states(bag, f"/{name}/ground_truth/odom")
        np.testing.assert_allclose(truth.position, flights[name].truth.position, atol=1e-12)
        assert truth.child_frame_id == name
    alone = tmp_path / "alone.mcap"
    assert generate.main(["-o", str(alone), "--segment", "LeftFoot", *options]) == 0
    with open_bag(alone) as opened:
        assert {topic.name for topic in opened.topics} == {"/imu/data_raw", "/ground_truth/odom"}
    capsys.readouterr()


def test_truth_of_a_segment_is_the_motion_capture(walking, tmp_path):
    """Programs that compare poses take the file and the name of the segment."""
    bag = tmp_path / "arm.mcap"
    ims.generate(bag, trajectory=walking, segments="LeftForeArm", rate=50, duration=2)
    result = ims.evaluate(walking, bag, estimate_topic="LeftForeArm")
    # The truth is interpolated between 50 Hz: a dt^2 / 8 at 5.4 m/s^2.
    assert result.rms_position < 5.4 * 0.02**2 / 8.0
    poses = ims.convert(walking, tmp_path / "all.mcap").output
    assert ims.read_states(poses, "/LeftForeArm").frame_id == "world"


def test_inspect_compares_no_clocks_of_different_segments(tmp_path):
    """Segments of a walk move alike at some offset; the clocks of their IMUs need not differ."""
    walking, bag = tmp_path / "walk.bvh", tmp_path / "two.mcap"
    walk.write(walking, 12.0)
    segments = ["LeftForeArm", "LeftLeg"]
    ims.generate(bag, trajectory=walking, segments=segments, imu="perfect", rate=50)
    inspection = ims.inspect(bag)
    assert len(inspection.sensors) == 2
    (offset,) = inspection.offsets
    assert "LeftForeArm" in offset.source


def test_transforms_hang_on_the_segments(walking, tmp_path):
    bag = tmp_path / "tf.mcap"
    ims.generate(
        bag, trajectory=walking, segments={"Head": {"lever_arm": [0.1, 0.0, 0.2]}, "Hips": {}},
        rate=50, duration=1, topics=["tf_static"],
    )  # fmt: skip
    states = ims.read_states  # the door reads transforms between two frames
    with pytest.raises(InputError, match="1 poses"):
        states(bag, "/tf_static:Head.Head_imu_link")


def test_segments_of_markers_start_and_end_together(tmp_path):
    """Frames without one of the segments at the start and at the end are left out of all."""
    t = np.arange(201) / 100.0
    position = mocap.markers(t)
    gap = position.copy()
    gap[:10, :2], gap[-20:, :2] = np.nan, np.nan
    points = {f"A{k}": position[:, k] for k in range(4)} | {f"B{k}": gap[:, k] for k in range(4)}
    path = mocap.c3d(tmp_path / "two.c3d", 100.0, points)
    flights = ims.simulate(trajectory=path, segments="all", imu="perfect", rate=100)
    assert flights["A"].t0_ns == flights["B"].t0_ns == 100_000_000
    assert len(flights["A"]) == len(flights["B"]) == 170
    # The axes of each segment are those of the world in its own first complete frame.
    rates = [np.linalg.norm(flight.gyro[30:-30], axis=1) for flight in flights.values()]
    np.testing.assert_allclose(rates[0], rates[1], atol=5e-3)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"segments": ["LeftForArm"]}, "no topic LeftForArm of poses.*did you mean /LeftForeArm"),
        ({"segments": ["Head", "Head"]}, "two IMUs named Head"),
        ({"segments": []}, "segments: none"),
        ({"segments": 3}, "segments = 3"),
        ({"segments": {"Head": {"lever_am": [0, 0, 0]}}}, "Head.imu.lever_am: unknown"),
        (
            {"segments": ["Head"], "trajectory": "circle"},
            "Head.segment = Head: needs recorded",
        ),
        ({"segments": "all", "trajectory": "circle"}, "needs a trajectory file that has segments"),
    ],
)
def test_segments_that_are_none(walking, arguments, line):
    with pytest.raises((ConfigurationError, InputError), match=line) as error:
        ims.simulate(**{"trajectory": walking, "duration": 1, **arguments})
    assert len(error.value.problems) == 1


def test_poses_as_arrays_have_no_segments(walking):
    states = ims.read_states(walking, "Head")
    with pytest.raises(InputError, match="poses given as arrays have no segment Head"):
        ims.simulate(trajectory=states, segments=["Head"])
