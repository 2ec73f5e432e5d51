# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Needs of a sensor that sees or ranges: the scene of the world, its mount, several of a kind."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros import sensors
from imu_sim_ros.bags.messages.encode import VECTOR3_STAMPED
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.gate import POSITION
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.parameters import files
from imu_sim_ros.places.geometry import Caster
from imu_sim_ros.sensors.declaration import Sensor, SensorReadings, topic
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.parameters import SensorParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors, mounts

VECTOR = (VECTOR3_STAMPED, "Vector3StampedEncoder")
SIDEWAYS = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""R_bs of a sensor whose x axis is the body's y axis."""
GIVEN: dict[str, Any] = {
    "trajectory.type": "figure_eight",
    "duration": 2.0,
    "seed": 5,
    "sensors": ["beam", "side"],
    "side.type": "beam",
    "side.lever_arm": [0.1, 0.2, 0.3],
    "side.mounting": SIDEWAYS,
}


@dataclass(frozen=True, repr=False)
class BeamReadings(SensorReadings):
    distance: Array
    ideal: Array


class Beam(SensorModel):
    """The distance along x to whatever is there."""

    def __init__(self, mounted: Any, t0_ns: int, _: Any) -> None:
        super().__init__(mounted, t0_ns)
        self._noise = self.stream("noise")

    def measure(self, t: Array, world: Any) -> dict[str, Array]:
        motion = world.motion(t)
        x = rotation.rotate(self.attitude(motion), np.array([[1.0, 0.0, 0.0]]))
        ideal = Caster(world.scene.surfaces).cast(self.position(motion), x).distance
        return {"distance": ideal + 0.01 * self._noise.standard_normal(len(t)), "ideal": ideal}


@pytest.fixture(autouse=True)
def beam(monkeypatch: Any) -> None:
    monkeypatch.setattr(sensors, "_REGISTERED", {})
    ims.register_sensor(
        Sensor(
            *("beam", "beam", SensorParameters, Beam),
            topics=(topic("distance", *VECTOR, lambda r, n, _: [r.distance[n, None] * [1, 0, 0]]),),
            table=Table("beam", "Beam", POSITION, {}, VECTOR3_STAMPED, "distance"),
            readings=BeamReadings,
            sees=True,
        )
    )


def read_sensors(settings: dict[str, Any], **overrides: Any) -> tuple[Body, dict[str, Any]]:
    parameters = load_simulation(settings, overrides)
    body = Body(parameters, sensors={"beam", "side"})
    return body, body.next(10**6)


def test_beams_end_on_the_walls_of_a_room() -> None:
    """Both sensors end their beams on the room's planes; x of the second one is y of the body."""
    body, samples = read_sensors(
        GIVEN, **{"scene.type": "room", "scene.size": [60.0, 50.0, 40.0], "scene.boxes": 0}
    )
    for name, axis in (("beam", 0), ("side", 1)):
        beam = samples[name]
        motion = body.trajectory.sample((beam.true_t_ns - body.t0_ns) * 1e-9)
        arm = np.array([[0.1, 0.2, 0.3]]) if name == "side" else np.zeros((1, 3))
        start = motion.position + rotation.rotate(motion.q_wb, arm)
        end = start + beam.ideal[:, None] * rotation.to_matrix(motion.q_wb)[:, :, axis]
        off = np.abs(np.abs(end) - [30.0, 25.0, 20.0]).min(axis=1)
        assert off.max() < 1e-9
    assert np.std(samples["beam"].distance - samples["beam"].ideal) == pytest.approx(0.01, rel=0.3)


def test_sensors_of_a_kind_have_noise_faults_frames_and_topics_of_their_own(
    tmp_path: Path,
) -> None:
    body, samples = read_sensors(GIVEN)
    noise = [samples[name].distance - samples[name].ideal for name in ("beam", "side")]
    # 200 pairs of independent numbers: a correlation is below 5 / sqrt(200) = 0.35.
    assert abs(np.corrcoef(noise)[0, 1]) < 0.35
    sensors = mount_sensors(body.parameters)
    assert sensors["beam"].frame == "base_link"
    placed = mounts(sensors)["base_link", "side_link"]
    assert placed[:3, 3].tolist() == [0.1, 0.2, 0.3]
    assert placed[:3, :3].ravel().tolist() == SIDEWAYS
    body.reset()
    body.inject(Fault("dropout", value=1.0, triad="side"))
    lost = body.next(10**6)
    assert len(lost["side"].delivered) == 0
    assert len(lost["beam"].delivered) == len(lost["beam"].t_ns)
    path = tmp_path / "a.mcap"
    options = [f"--set={k}={v}" for k, v in GIVEN.items() if k != "trajectory.type"]
    assert generate.main(["-o", str(path), "--trajectory", "figure_eight", *options]) == 0
    with _reader(path) as bag:
        topics = {connection.topic: connection.msgcount for connection in bag.connections}
    assert topics["/distance"] == topics["/side/distance"] == 200
    assert (tmp_path / "a_truth_side.yaml").exists()


def _reader(path: Path) -> Any:
    from rosbags.highlevel import AnyReader

    return AnyReader([path])


def test_cameras_and_other_sensors_share_the_scene(tmp_path: Path) -> None:
    """A place leaves the paths of both free; without cameras it is made as well."""
    settings = {**GIVEN, "scene.type": "office", "side.lever_arm": [0.0, 0.0, 1.5]}
    _, alone = read_sensors(settings)
    assert np.isfinite(alone["side"].ideal).all()
    assert alone["side"].ideal.min() > 0.0
    path = tmp_path / "b.mcap"
    options = [f"--set={k}={v}" for k, v in settings.items() if k != "trajectory.type"]
    camera = ["--camera", "euroc_cam0", "--topics", "distance,cam0/camera_info"]
    assert generate.main(["-o", str(path), "--trajectory", "figure_eight", *options, *camera]) == 0


def test_a_scene_without_anything_that_sees_is_refused() -> None:
    with pytest.raises(ims.ConfigurationError, match="scene.size"):
        load_simulation({"scene.size": [60.0, 50.0, 40.0]})


def test_folders_and_truths_describe_each_sensor_of_a_kind(tmp_path: Path) -> None:
    """Read back: T_BS of the second receiver, its own number and its own rate."""
    options = [
        *("--gnss", "phone", "--gnss", "zed_f9p", "--duration", "1s", "--imu", "perfect"),
        *(f"--set=gnss1.mounting={SIDEWAYS}", "--set=gnss1.lever_arm=[0.5,0,0]"),
        "--set=gnss1.rate=5",
    ]
    folder = tmp_path / "euroc"
    assert generate.main(["-o", str(folder), "--format", "euroc", "--quiet", *options]) == 0
    antenna, second = (yaml.safe_load((folder / f"gps{k}/sensor.yaml").read_text()) for k in (0, 1))
    assert antenna["T_BS"]["data"] == np.eye(4).ravel().tolist()
    t_bs = np.reshape(second["T_BS"]["data"], (4, 4))
    assert t_bs[:3, :3].ravel().tolist() == SIDEWAYS
    assert t_bs[:3, 3].tolist() == [0.5, 0.0, 0.0]
    assert second["rate_hz"] == 5
    rows = np.loadtxt(folder / "gps1/data.csv", delimiter=",", skiprows=1)
    assert len(rows) == 5
    again = load_simulation(files.load(tmp_path / "euroc_truth_gnss1.yaml"))
    assert again.each_sensor["gnss1"].lever_arm == (0.5, 0.0, 0.0)


SEEING: dict[str, Any] = {
    "sensors": ["beam", "lidar"],
    "lidar.preset": "vlp16",
    "cameras": ["cam0"],
    "cam0.camera.preset": "euroc_cam0",
}
"""A camera, a LiDAR and a sensor of another package on one body."""


def warnings_of(scene: dict[str, Any], **overrides: Any) -> dict[str, list[str]]:
    """Return the lines on the scene by sensor."""
    settings = {"trajectory.type": "figure_eight", "duration": 10.0, **SEEING, **overrides}
    parameters = load_simulation(
        {**settings, **{f"scene.{name}": value for name, value in scene.items()}}
    )
    lines: dict[str, list[str]] = {name: [] for name in ("beam", "lidar", "cam0", "scene")}
    for line in Body(parameters, sensors={"beam", "lidar", "cam0"}).warnings():
        name, text = line.split(": ", 1)
        lines[name].append(text)
    return lines


def wall(x: float) -> dict[str, Any]:
    """Return the scene of a wall of 60 m x 40 m square to x."""
    corners = [x, -30.0, -20.0, x, 30.0, -20.0, x, -30.0, 20.0]
    return {"type": "planes", "corners": corners}


def test_a_path_through_surfaces_is_told_for_each_sensor_that_sees() -> None:
    """The figure of eight crosses x = 0.5 m twice per period, and cameras alone had a line."""
    lines = warnings_of(wall(0.5))
    assert not lines.pop("scene")
    for name, texts in lines.items():
        assert texts[0].startswith("the path goes through the scene planes at "), name
        assert texts[1].startswith("the path comes as close as 0.0"), name


def test_a_suitable_path_has_no_lines() -> None:
    assert not any(warnings_of({"type": "room"}).values())


def test_a_mesh_that_the_path_leaves_is_told_for_each_sensor_that_sees(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    box = trimesh.creation.box((7, 14, 6))
    box.invert()
    box.faces = box.faces[1:]
    box.export(tmp_path / "box.ply")
    lines = warnings_of({"type": "mesh", "mesh": str(tmp_path / "box.ply")})
    assert [text[:26] for text in lines.pop("scene")] == ["the mesh is not watertight"]
    for name, texts in lines.items():
        text = "\n".join(texts)
        assert "the path goes through the mesh at" in text, name
        assert "the path is outside of the mesh for" in text, name
        assert "the path comes as close as 0.0" in text, name


def test_nothing_in_sight_is_told_for_each_sensor_that_sees() -> None:
    """A board of 0.6 m behind a camera, and beyond the range of the LiDAR."""
    board = {"type": "checkerboard", "position": [-30.0, 0.0, 0.0]}
    lines = warnings_of(board, **{"lidar.maximum_range": 10.0})
    text = "nothing in sight: nothing of scene.type = 'checkerboard' is in its field of view"
    assert lines["cam0"] == lines["lidar"] == [text]
    lines = warnings_of({"type": "house"}, **{"trajectory.type": "static"})
    text = "nothing in sight of scene.type = 'house', which has no surfaces"
    assert lines["lidar"] == lines["beam"] == [text]
    assert lines["cam0"] == []


def test_empty_clouds_are_told_with_their_share_of_the_time() -> None:
    """A figure of eight comes within 6 m of a wall at x = -8 m for part of the time."""
    values = {"lidar.maximum_range": 6.0, "trajectory.type": "figure_eight"}
    parameters = load_simulation(
        {**values, "duration": 20.0, "sensors": ["lidar"], "lidar.firing_period": 1e-3,
         **{f"scene.{name}": value for name, value in wall(-8.0).items()}}
    )  # fmt: skip
    body = Body(parameters, sensors={"lidar"})
    [line] = body.warnings()
    scans = body.next(10**6)["lidar"]
    empty = ~np.isfinite(scans.range).any(axis=1)
    assert 0.2 < empty.mean() < 0.8
    # 100 of 200 scans: the share is that of every second one.
    share = float(line.removeprefix("lidar: nothing in sight for ").split("%")[0]) / 100.0
    assert share == pytest.approx(empty.mean(), abs=0.02)
