# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The poses of bodies that move before cameras, as tables."""

import math
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.datasets.columns import Tables
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.view import View

HEADER: Final = "t_ns,body,name,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz"
RATE: Final = 100
"""Of the table [Hz]."""
_BLOCK: Final = 4096


def add_tables(tables: Tables, folder: Path, view: View, scene: Scene) -> None:
    """Write ``bodies.csv`` and ``body_landmarks.csv`` if something moves in a scene.

    The first has each body's pose in the world, its velocity there and its angular rate at true
    times, 100 times a second; the second the landmarks on it, in its own axes.

    :param folder: that exists.
    :param view: of a camera that sees it: it knows the times of the simulation.
    """
    crowd = scene.crowd
    if crowd is None:
        return
    table = tables.csv(folder / "bodies.csv", HEADER)
    count, total = len(crowd.each), math.floor(view.duration * RATE) + 1
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
    first_id = len(scene.landmarks)
    for which, (own, _) in enumerate(crowd.landmarks, start=1):
        points.write(first_id + np.arange(len(own)), np.full(len(own), which), own)
        first_id += len(own)
