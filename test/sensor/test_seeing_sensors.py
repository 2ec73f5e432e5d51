# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a sensor needs that sees or ranges: the scene of the world, its mount, several of a kind."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros import rotation, sensors
from imu_sim_ros.bags.messages.encode import VECTOR3_STAMPED
from imu_sim_ros.commands import generate
from imu_sim_ros.inputs.gate import POSITION
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.parameters import files
from imu_sim_ros.places.geometry import Caster
from imu_sim_ros.sensors.declaration import Sensor, SensorReadings, topic
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.parameters import SensorParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mounted, mounts
from imu_sim_ros.types import Array

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


def read(given: dict[str, Any], **own: Any) -> tuple[Body, dict[str, Any]]:
    parameters = load_simulation(given, own)
    body = Body(parameters, sensors={"beam", "side"})
    return body, body.next(10**6)


def test_beams_end_on_the_walls_of_a_room() -> None:
    """Both sensors end their beams on the room's planes; x of the second one is y of the body."""
    body, found = read(
        GIVEN, **{"scene.type": "room", "scene.size": [60.0, 50.0, 40.0], "scene.boxes": 0}
    )
    for name, axis in (("beam", 0), ("side", 1)):
        one = found[name]
        motion = body.trajectory.sample((one.true_t_ns - body.t0_ns) * 1e-9)
        arm = np.array([[0.1, 0.2, 0.3]]) if name == "side" else np.zeros((1, 3))
        start = motion.position + rotation.rotate(motion.q_wb, arm)
        end = start + one.ideal[:, None] * rotation.to_matrix(motion.q_wb)[:, :, axis]
        off = np.abs(np.abs(end) - [30.0, 25.0, 20.0]).min(axis=1)
        assert off.max() < 1e-9
    assert np.std(found["beam"].distance - found["beam"].ideal) == pytest.approx(0.01, rel=0.3)


def test_sensors_of_a_kind_have_noise_faults_frames_and_topics_of_their_own(
    tmp_path: Path,
) -> None:
    body, found = read(GIVEN)
    noise = [found[name].distance - found[name].ideal for name in ("beam", "side")]
    # 200 pairs of independent numbers: a correlation is below 5 / sqrt(200) = 0.35.
    assert abs(np.corrcoef(noise)[0, 1]) < 0.35
    sensors = mounted(body.parameters)
    assert sensors["beam"].frame == "base_link"
    placed = mounts(sensors)["side_link"]
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
        topics = {one.topic: one.msgcount for one in bag.connections}
    assert topics["/distance"] == topics["/side/distance"] == 200
    assert (tmp_path / "a_truth_side.yaml").exists()


def _reader(path: Path) -> Any:
    from rosbags.highlevel import AnyReader

    return AnyReader([path])


def test_cameras_and_other_sensors_share_the_scene(tmp_path: Path) -> None:
    """A place leaves the paths of both free; without cameras it is made as well."""
    given = {**GIVEN, "scene.type": "office", "side.lever_arm": [0.0, 0.0, 1.5]}
    _, alone = read(given)
    assert np.isfinite(alone["side"].ideal).all()
    assert alone["side"].ideal.min() > 0.0
    path = tmp_path / "b.mcap"
    options = [f"--set={k}={v}" for k, v in given.items() if k != "trajectory.type"]
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
    first, second = (yaml.safe_load((folder / f"gps{k}/sensor.yaml").read_text()) for k in (0, 1))
    assert first["T_BS"]["data"] == np.eye(4).ravel().tolist()
    t_bs = np.reshape(second["T_BS"]["data"], (4, 4))
    assert t_bs[:3, :3].ravel().tolist() == SIDEWAYS
    assert t_bs[:3, 3].tolist() == [0.5, 0.0, 0.0]
    assert second["rate_hz"] == 5
    rows = np.loadtxt(folder / "gps1/data.csv", delimiter=",", skiprows=1)
    assert len(rows) == 5
    again = load_simulation(files.load(tmp_path / "euroc_truth_gnss1.yaml"))
    assert again.each_sensor["gnss1"].lever_arm == (0.5, 0.0, 0.0)
