# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigs of parameters, which the tests of cameras share."""

from dataclasses import replace

from imu_sim_ros.camera import Rig
from imu_sim_ros.sensors.camera.rig_parameters import load_rig
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.cameras import scene_around
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.parameters import trajectory_layer

T0_NS = 1_000_000_000


def make_rig(trajectory="figure_eight", duration=10.0, seed=3, scene=None, **values):
    """Build a rig from parameters, ``__`` for a dot; one camera in a room unless they say more.

    :param scene: of another rig, whose parameters make the same one.
    """
    parameters = {
        "cameras": ["cam0"],
        "scene.type": "room",
        **{k.replace("__", "."): v for k, v in values.items()},
    }
    path = {k: parameters.pop(k) for k in list(parameters) if k.startswith("trajectory.")}
    simulation = load_simulation({**trajectory_layer(trajectory), **path})
    motion = build_trajectory(simulation.trajectory)
    rig = load_rig(parameters)
    configuration = replace(simulation, cameras=rig.cameras, rig=rig, duration=duration, seed=seed)
    world = World(motion, configuration, T0_NS, scene_around if scene is None else lambda _: scene)
    return Rig(mount_sensors(configuration), world)
