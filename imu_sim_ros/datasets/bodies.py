# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the poses of bodies that move before cameras."""

import math
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.datasets.columns import Tables
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.view import View

HEADER: Final = "t_ns,body,name,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz"
RATE: Final = 100
"""Sample rate of the table [Hz]."""
_BLOCK: Final = 4096
"""Number of times that are computed at once."""


def add_tables(tables: Tables, folder: Path, view: View, scene: Scene) -> None:
    """Write ``bodies.csv`` and ``body_landmarks.csv`` if something moves in a scene.

    The first has the pose of each body in the world, its velocity there and its angular rate, 100
    times a second of true time; the second the landmarks on each body, in the body's axes.

    :param folder: existing folder.
    :param view: view of a camera that sees the bodies: it knows the times of the simulation.
    """
    crowd = scene.crowd
    if crowd is None:
        return
    table = tables.csv(folder / "bodies.csv", HEADER)
    count, total = len(crowd.bodies), math.floor(view.duration * RATE) + 1
    names = np.array([body.name.encode() for body in crowd.bodies])
    for start in range(0, total, _BLOCK):
        index = np.arange(start, min(start + _BLOCK, total))
        t_ns = view.t0_ns + index * (1_000_000_000 // RATE)
        states = [body.states(t_ns, view.seconds(t_ns)) for body in crowd.bodies]
        number = np.tile(np.arange(count), len(index))
        position, q_wb, velocity, rate = (
            np.stack(columns, axis=1).reshape(len(number), -1)
            for columns in zip(
                *((s.position, s.q_wb, s.velocities(), s.body_rates()) for s in states), strict=True
            )
        )
        rows = (number + 1, names[number], position, q_wb, velocity, rate)
        table.write(t_ns.repeat(count), *rows)
    landmarks = tables.csv(folder / "body_landmarks.csv", "id,body,x,y,z")
    first_id = len(scene.landmarks)
    for body, (points_b, _) in enumerate(crowd.landmarks, start=1):
        landmarks.write(first_id + np.arange(len(points_b)), np.full(len(points_b), body), points_b)
        first_id += len(points_b)
