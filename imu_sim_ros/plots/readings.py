# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings over time, and the Allan deviations of several sensors from their parameters."""

import numpy as np

from imu_sim_ros.calibration.noise.terms import TERMS, gauss_markov_deviation
from imu_sim_ros.core.conventions import AXES, AXIS_COLOURS
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure
from imu_sim_ros.sensors.imu.triads import TriadParameters

_MAX_POINTS = 4000
"""Largest number of points of a curve."""


def readings(t_ns: Integers, gyro: Array, accel: Array, name: str) -> Figure:
    """Draw angular rate and specific force over time, a line for each axis.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    :param name: name of the sensor or the file, for the title.
    """
    picture, panels = style.panels(2, 1, 8.0, 5.0, sharex=True)
    step = max(1, len(t_ns) // _MAX_POINTS)
    t = (t_ns[::step] - t_ns[0]) * 1e-9 if len(t_ns) else np.empty(0)
    for axes, values, label in (
        (panels[0], gyro, "angular rate [rad/s]"),
        (panels[1], accel, "specific force [m/s$^2$]"),
    ):
        for k, axis in enumerate(AXES):
            axes.plot(t, values[::step, k], color=AXIS_COLOURS[axis], lw=0.8, label=axis)
        axes.set_ylabel(label)
    style.add_legend_above(panels[0], 3)
    panels[1].set_xlabel("time [s]")
    style.draw_heading(picture, name)
    return picture


def allan_deviation(triad: TriadParameters, tau: Array) -> Array:
    """Return the Allan deviation (m,) of a triad's x axis at cluster times [s] (IEEE 952)."""
    variance = np.zeros(len(tau))
    sizes = {
        "noise_density": triad.noise_density,
        "random_walk": triad.random_walk,
        "bias_instability": triad.bias_instability,
    }
    for term in TERMS:
        if term.key in sizes:
            variance += (sizes[term.key][0] * term.deviation(tau)) ** 2
    time = triad.correlation_time[0]
    if time > 0.0:
        variance += (triad.gauss_markov[0] * gauss_markov_deviation(tau, time)) ** 2
    return np.sqrt(variance)
