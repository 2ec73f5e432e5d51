# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The poses of bodies that move before cameras: as a table, and as messages."""

import math
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.bags.messages.encode import OdometryEncoder
from imu_sim_ros.conventions import BODIES_TOPIC
from imu_sim_ros.datasets.columns import Tables
from imu_sim_ros.sensors.camera.rig import Rig

HEADER: Final = "t_ns,body,name,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz"
RATE: Final = 100
"""Of the table [Hz]."""
_BLOCK: Final = 4096


def add_tables(tables: Tables, folder: Path, rig: Rig) -> None:
    """Write ``bodies.csv`` and ``body_landmarks.csv`` if something moves in a rig's scene.

    The first has each body's pose in the world, its velocity there and its angular rate at true
    times, 100 times a second; the second the landmarks on it, in its own axes.

    :param folder: that exists.
    """
    crowd = rig.scene.crowd
    if crowd is None:
        return
    table = tables.csv(folder / "bodies.csv", HEADER)
    view = next(iter(rig.views.values()))
    count, total = len(crowd.each), math.floor(rig.duration * RATE) + 1
    names = np.array([body.name.encode() for body in crowd.each])
    for first in range(0, total, _BLOCK):
        index = np.arange(first, min(first + _BLOCK, total))
        t_ns = view.t0_ns + index * (1_000_000_000 // RATE)
        states = [body.state(view.seconds(t_ns)) for body in crowd.each]
        number = np.tile(np.arange(count), len(index))
        zeros = np.zeros((len(number), 2))
        position, q_wb, velocity, rate = (
            np.stack([getattr(state, name) for state in states], axis=1).reshape(len(number), -1)
            for name in ("position", "q_wb", "velocity", "heading_rate")
        )
        rows = (number + 1, names[number], position, q_wb, velocity, zeros, rate)
        table.write(t_ns.repeat(count), *rows)
    points = tables.csv(folder / "body_landmarks.csv", "id,body,x,y,z")
    first_id = len(rig.scene.landmarks)
    for which, (own, _) in enumerate(crowd.landmarks, start=1):
        points.write(first_id + np.arange(len(own)), np.full(len(own), which), own)
        first_id += len(own)


class BodyMessages:
    """Where each body is at the frames of the first camera: nav_msgs/Odometry, a topic for each."""

    def __init__(self, rig: Rig, world_frame: str, encoding: str = "cdr") -> None:
        self.view = next(iter(rig.views.values()))
        self._bodies = rig.scene.crowd.each if rig.scene.crowd else ()
        self._encoders = [
            OdometryEncoder(world_frame, body.name, encoding) for body in self._bodies
        ]

    def messages(self, number: int) -> dict[str, bytes]:
        """Return the messages of a frame, by topic; their stamps are its true time."""
        t_ns = int(self.view.frames(number, 1).true_t_ns[0])
        t = self.view.seconds(np.array([t_ns]))
        found = {}
        for body, encoder in zip(self._bodies, self._encoders, strict=True):
            state = body.state(t)
            velocity = rotation.rotate_inverse(state.q_wb, state.velocity)[0]
            rate = (0.0, 0.0, float(state.heading_rate[0]))
            found[f"{BODIES_TOPIC}/{body.name}"] = encoder.message(
                t_ns, state.position[0], state.q_wb[0], velocity, rate
            )
        return found
