# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The truth of what cameras see: landmarks at rest, and where bodies move."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import BODIES_TOPIC, LANDMARKS_TOPIC
from imu_sim_ros.core.records import States
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.declaration import Mounted, Payloads, Rendering, Sensor, Topic
from imu_sim_ros.sensors.deferred import Deferred
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.samples import Rows, Samples
from imu_sim_ros.sensors.world import Window, World

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import RowTemplate
    from imu_sim_ros.sensors.camera.frames import Camera

DATASETS: Final = ("euroc", "csv", "tracks", "tum_vi", "vio_data_simulation")
"""Dataset layouts with ground truth of cameras."""


class AtFrames(FixedModel):
    """Ground truth at the frames of cameras."""

    def __init__(
        self, mounted: Mounted[RigParameters], t0_ns: int, cameras: Mapping[str, Any]
    ) -> None:
        self.mounted = mounted
        self.cameras: list[Camera] = [
            cameras[name] for name in mounted.sensor.needs(mounted.parameters)
        ]
        """Cameras whose frames set the times."""


class Landmarks(AtFrames):
    """All landmarks at rest, once: at the start."""

    def __init__(
        self, mounted: Mounted[RigParameters], t0_ns: int, cameras: Mapping[str, Any]
    ) -> None:
        super().__init__(mounted, t0_ns, cameras)
        self._t0_ns = t0_ns

    def read(self, window: Window, world: World) -> Samples:
        """Return the landmarks if the start is in a window."""
        count = int(window.begin <= 0 < window.end)
        times = np.full(count, self._t0_ns)
        values = Deferred(position=lambda: world.scene.landmarks)
        return Samples(
            true_t_ns=times,
            t_ns=times,
            release_t_ns=times,
            delivered=np.arange(count),
            values=values,
        )


class BodyTruth(AtFrames):
    """The motion of a body of the scene, at the frames of the first camera."""

    def read(self, window: Window, world: World) -> Samples:
        """Return the motion at the true times of the frames that are not lost."""
        (camera,) = self.cameras
        frames = camera.frames(window, world)
        t_ns, release_t_ns = (
            times[frames.delivered] for times in (frames.true_t_ns, frames.release_t_ns)
        )

        def states() -> States:
            crowd = world.scene.crowd
            assert crowd is not None
            body = next(
                candidate for candidate in crowd.bodies if candidate.name == self.mounted.name
            )
            return body.states(t_ns, camera.view.seconds(t_ns))

        numbers = np.arange(len(t_ns))
        return Samples(
            true_t_ns=t_ns,
            t_ns=t_ns,
            release_t_ns=release_t_ns,
            delivered=numbers,
            values=Deferred(states=states),
        )


def _cloud(mounted: Mounted[RigParameters], encoding: str) -> Payloads:
    """Return the encoder of the landmarks in the world as PointCloud2."""
    from imu_sim_ros.bags.messages.encode_cameras import PointCloud2Encoder

    encoder = PointCloud2Encoder(mounted.environment.world_frame, encoding)

    def payloads(readings: Samples, rows: Rows, _: object) -> list[bytes]:
        fields = [*((axis, "<f4") for axis in "xyz"), ("id", "<u4")]
        clouds = []
        for t_ns in readings.t_ns[rows].tolist():
            points = np.zeros(len(readings.position), fields)
            for axis, column in zip("xyz", readings.position.T, strict=True):
                points[axis] = column
            points["id"] = np.arange(len(points))
            clouds.append(encoder.encode(t_ns, points))
        return clouds

    return payloads


def _odometry(mounted: Mounted[RigParameters], encoding: str) -> Payloads:
    """Return the encoder of a moving body's true motion as Odometry."""
    from imu_sim_ros.bags.messages.encode import OdometryEncoder

    encoder = OdometryEncoder(mounted.environment.world_frame, mounted.name, encoding)

    def payloads(readings: Samples, rows: Rows, _: object) -> "RowTemplate":
        states: States = readings.states.rows(rows)
        velocity_b = rotation.rotate_inverse(states.q_wb, states.velocities())
        columns = (states.position, states.q_wb, velocity_b, states.body_rates())
        return encoder.pattern(readings.t_ns[rows], *columns)

    return payloads


LANDMARKS: Final[Sensor[RigParameters]] = Sensor(
    name="landmarks",
    quantity=LANDMARKS_TOPIC,
    section=RigParameters,
    model=Landmarks,
    needs=lambda rig: rig.cameras[:1],
    topics=(Topic(LANDMARKS_TOPIC, "sensor_msgs/msg/PointCloud2", (), _cloud, latched=True),),
    readings=None,
    faulty_parts=(),
    text="landmarks at rest that cameras see",
    rendering=Rendering(DATASETS),
)


def moving_body_truth(name: str) -> Sensor[RigParameters]:
    """Return the true motion of a body of a scene as a sensor."""
    topic = f"{BODIES_TOPIC}/{name}"
    return Sensor(
        name=name,
        quantity=topic,
        section=RigParameters,
        model=BodyTruth,
        topics=(Topic(topic, "nav_msgs/msg/Odometry", (), _odometry),),
        readings=None,
        needs=lambda rig: rig.cameras[:1],
        faulty_parts=(),
        text="true motion of a body that moves in the scene",
        rendering=Rendering(DATASETS),
    )
