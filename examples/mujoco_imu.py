# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A pendulum in MuJoCo with a real IMU on it: errors are added inside the simulator's step.

python examples/mujoco_imu.py [FOLDER [SECONDS]]

Needs `pip install mujoco`; writes mujoco_imu.png.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

import imu_sim_ros as ims

MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 -9.81" integrator="RK4"/>
  <worldbody>
    <body pos="0 0 2">
      <joint type="ball" damping="0.002"/>
      <geom type="capsule" fromto="0 0 0 0 0 -1" size="0.03" mass="1"/>
      <site name="imu" pos="0 0 -1"/>
    </body>
  </worldbody>
  <sensor>
    <gyro site="imu"/>
    <accelerometer site="imu"/>
    <framepos objtype="site" objname="imu"/>
    <framequat objtype="site" objname="imu"/>
    <framelinvel objtype="site" objname="imu"/>
  </sensor>
</mujoco>
"""
START = [0.8, 0.5, 0.3]
"""[rad/s] of the ball joint, after the arm was turned aside."""


def simulate(seconds=60.0, imu="adis16470", seed=1):
    """Return MuJoCo's ideal readings and poses, and the blocks of the IMU's readings.

    After a step the sensors hold the values at its beginning: so the stamp is that time.
    """
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qpos[:] = [np.cos(0.4), np.sin(0.4), 0.0, 0.0]
    data.qvel[:] = START
    sensor = ims.ErrorModel(imu=imu, rate=1000, seed=seed)
    count = round(seconds / model.opt.timestep)
    ideal, blocks = np.empty((count, 16)), []
    for k in range(count):
        t_ns = round(data.time * 1e9)
        mujoco.mj_step(model, data)
        ideal[k] = data.sensordata
        blocks.append(sensor.read(t_ns, ideal[k, :3], ideal[k, 3:6]))
    return ideal, blocks


def truth_of(ideal, t_ns):
    """Return MuJoCo's poses as the truth of an evaluation."""
    position, q_wb, velocity = ideal[:, 6:9], ideal[:, 9:13], ideal[:, 13:16]
    return ims.Odometry(t_ns, position, q_wb, velocity, ideal[:, :3], "MuJoCo")


def main(folder, seconds):
    """Simulate, dead-reckon and draw."""
    ideal, blocks = simulate(seconds)
    t_ns = np.concatenate([block.t_ns for block in blocks])
    gyro = np.concatenate([block.gyro for block in blocks])
    accel = np.concatenate([block.accel for block in blocks])
    readings = ims.Readings(t_ns, gyro, accel, "adis16470 on a pendulum")
    truth = truth_of(ideal, t_ns)
    start = ims.NavigationState(truth.position[0], truth.velocity[0], truth.q_wb[0])
    track = ims.dead_reckon(readings, initial=start)
    bias = np.concatenate([block.gyro_bias for block in blocks])
    print(readings)
    print(ims.evaluate(track, truth))
    print(f"bias of the gyroscope: {np.round(bias[-1], 5)} rad/s")
    draw(folder, t_ns * 1e-9, ideal, gyro, accel, truth, track)


def draw(folder, t, ideal, gyro, accel, truth, track):
    """Write the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9, 7), constrained_layout=True)
    grid = figure.add_gridspec(3, 3)
    beginning, peak = slice(0, 10_000), slice(1350, 1410)
    rows = ((gyro, ideal[:, :3], "rate x [rad/s]"), (accel, ideal[:, 3:6], "force x [m/s²]"))
    for row, (measured, true, label) in enumerate(rows):
        whole, close = figure.add_subplot(grid[row, :2]), figure.add_subplot(grid[row, 2])
        for axis, part in ((whole, beginning), (close, peak)):
            axis.plot(t[part], true[part, 0], lw=4.0, color="0.7", label="MuJoCo")
            axis.plot(t[part], measured[part, 0], lw=0.9, label="ADIS16470")
        whole.set_ylabel(label)
        close.set_title("60 ms of it", fontsize=9)
        if row == 0:
            whole.set_ylim(bottom=-5.0)
            whole.legend(loc="lower right", ncols=2)
    error_axes = figure.add_subplot(grid[2, :])
    distance = np.linalg.norm(track.position - truth.position, axis=1)
    error_axes.plot(t[beginning], distance[beginning])
    error_axes.set_ylabel("position error of\ndead reckoning [m]")
    error_axes.set_xlabel("time [s]")
    figure.suptitle("A pendulum in MuJoCo: ideal readings, and those of an ADIS16470")
    figure.savefig(folder / "mujoco_imu.png", dpi=110)


if __name__ == "__main__":
    folder, seconds = (*sys.argv[1:], *(".", "60")[len(sys.argv) - 1 :])
    main(Path(folder), float(seconds))
