# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inverted pendulums in MuJoCo as a vector environment of Gymnasium, whose policy sees an IMU.

python examples/gymnasium_imu.py [COUNT]

Needs `pip install mujoco gymnasium`. Each environment has an IMU of its own: a unit with its own
calibration, spread about a preset. The same policy balances all pendulums, once with MuJoCo's ideal
readings and once with those of the IMUs.
"""

import sys

import gymnasium
import mujoco
import numpy as np

import imu_sim_ros as ims

MODEL = """
<mujoco>
  <option timestep="0.005" gravity="0 0 -9.81" integrator="RK4"/>
  <worldbody>
    <body pos="0 0 1">
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.03" mass="1"/>
      <site name="imu" pos="0 0 0.5"/>
    </body>
  </worldbody>
  <actuator><motor joint="hinge" gear="1" ctrlrange="-4 4"/></actuator>
  <sensor><gyro site="imu"/><accelerometer site="imu"/></sensor>
</mujoco>
"""
SPREAD = {"gyroscope_bias": ("gaussian", 0.02), "accelerometer_bias": ("gaussian", 0.1)}
"""Domain randomisation, in addition to the tolerances of the data sheet."""


class Pendulums(gymnasium.vector.VectorEnv):
    """Observations are readings: angular rate, then specific force, (count, 6)."""

    def __init__(self, count, imu=None, seed=1):
        """Make the environments; without an IMU observations are ideal."""
        self.num_envs = count
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.data = [mujoco.MjData(self.model) for _ in range(count)]
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (6,))
        self.single_action_space = gymnasium.spaces.Box(-4.0, 4.0, (1,))
        self.observation_space = gymnasium.vector.utils.batch_space(
            self.single_observation_space, count
        )
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, count)
        self.sensors = None
        if imu is not None:
            rate = 1.0 / self.model.opt.timestep
            self.sensors = ims.ErrorModel(imu=imu, rate=rate, seed=seed, count=count, spread=SPREAD)
        self.ended = np.ones(count, dtype=bool)

    def _start(self, chosen, rng):
        """Begin episodes anew: another angle, and another unit of the IMU."""
        for k in np.flatnonzero(chosen):
            mujoco.mj_resetData(self.model, self.data[k])
            self.data[k].qpos[0] = rng.uniform(-0.1, 0.1)
        if self.sensors is not None:
            self.sensors.reset(chosen)

    def _observe(self):
        ideal = np.array([data.sensordata for data in self.data])
        if self.sensors is None:
            return ideal
        samples = self.sensors.read(round(self.data[0].time * 1e9), ideal[:, :3], ideal[:, 3:])
        return np.hstack([samples.gyro, samples.accel])

    def reset(self, *, seed=None, options=None):
        """Begin all episodes."""
        super().reset(seed=seed)
        self._start(np.ones(self.num_envs, dtype=bool), self.np_random)
        for data in self.data:
            mujoco.mj_forward(self.model, data)
        return self._observe(), {}

    def step(self, actions):
        """Step all environments; those that have fallen begin anew."""
        self._start(self.ended, self.np_random)
        for data, action in zip(self.data, actions, strict=True):
            data.ctrl[:] = action
            mujoco.mj_step(self.model, data)
        self.angle = np.array([data.qpos[0] for data in self.data])
        self.ended = np.abs(self.angle) > 0.5
        reward = 1.0 - np.abs(self.angle)
        return self._observe(), reward, self.ended, np.zeros(self.num_envs, dtype=bool), {}


def balance(environments, steps=1000, seed=5):
    """Return the deviation from upright [rad] and the share of steps in which one fell.

    The policy is a complementary filter over the readings, and a torque from its angle and rate.
    """
    observed, _ = environments.reset(seed=seed)
    dt, angle, fallen, squares = environments.model.opt.timestep, 0.0, 0, 0.0
    for _ in range(steps):
        rate, level = observed[:, 1], np.arctan2(-observed[:, 3], observed[:, 5])
        angle = 0.995 * (angle + rate * dt) + 0.005 * level
        torque = -12.0 * angle - 2.0 * rate
        observed, _, ended, _, _ = environments.step(torque[:, None])
        angle = np.where(ended, 0.0, angle)
        fallen += np.count_nonzero(ended)
        squares += np.mean(environments.angle**2)
    return np.sqrt(squares / steps), fallen / (steps * environments.num_envs)


def main():
    """Balance with and without errors."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    for imu in (None, "mpu6000"):
        deviation, falls = balance(Pendulums(count, imu))
        name = "ideal readings" if imu is None else f"{count} units of {imu}"
        print(f"{name}: {deviation:.3f} rad from upright, {1000 * falls:.2f} falls in 1000 steps")


if __name__ == "__main__":
    main()
