# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings over time."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.conventions import AXES
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure

Array = NDArray[np.float64]

_MOST_POINTS = 4000


def readings(t_ns: NDArray[np.int64], gyro: Array, accel: Array, name: str) -> Figure:
    """Draw angular rate and specific force over time, a line for each axis.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param name: of the sensor or the file, for the title.
    """
    picture, panels = style.panels(2, 1, 8.0, 5.0, sharex=True)
    step = max(1, len(t_ns) // _MOST_POINTS)
    t = (t_ns[::step] - t_ns[0]) * 1e-9 if len(t_ns) else np.empty(0)
    for axes, values, label in (
        (panels[0], gyro, "angular rate [rad/s]"),
        (panels[1], accel, "specific force [m/s$^2$]"),
    ):
        for k, axis in enumerate(AXES):
            axes.plot(t, values[::step, k], color=style.AXIS_COLOURS[axis], lw=0.8, label=axis)
        axes.set_ylabel(label)
    style.legend_above(panels[0], 3)
    panels[1].set_xlabel("time [s]")
    picture.suptitle(name)
    return picture
