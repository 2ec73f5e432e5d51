# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the presets: ``python docs/contributing/draw_presets.py docs/images/sensors_allan.png``."""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from imu_sim_ros.sensors import catalogue
from imu_sim_ros.simulation.parameters import load_simulation

PANELS = {
    "consumer": ("consumer",),
    "industrial": ("industrial",),
    "tactical, navigation, and the lecture's": ("tactical", "navigation", "classroom"),
}
UNITS = {"gyroscope": "rad/s", "accelerometer": "m/s²"}
TIMES = np.logspace(-2, 5, 200)


def deviation(triad):
    """Return the Allan deviation of white noise, 1/f noise and random walk, x axis."""
    white = triad.noise_density[0] / np.sqrt(TIMES)
    walk = triad.random_walk[0] * np.sqrt(TIMES / 3.0)
    return np.sqrt(white**2 + (0.664 * triad.bias_instability[0]) ** 2 + walk**2)


def main() -> None:
    """Write the picture."""
    presets = catalogue.descriptions("imus").items()
    figure, axes = plt.subplots(
        2, len(PANELS), figsize=(13, 7.5), sharex=True, sharey="row", layout="constrained"
    )
    for column, (title, grades) in enumerate(PANELS.items()):
        chosen = [name for name, text in presets if text.partition(",")[0].lower() in grades]
        colours = plt.get_cmap("tab20")(np.linspace(0, 1, 20))[: len(chosen)]
        for row, (name, unit) in enumerate(UNITS.items()):
            panel = axes[row, column]
            for preset, colour in zip(chosen, colours, strict=True):
                triad = load_simulation({"imu.preset": preset}).imu.triad(name)
                panel.loglog(TIMES, deviation(triad), color=colour, label=preset)
            panel.grid(alpha=0.4)
            if column == 0:
                panel.set_ylabel(f"{name} [{unit}]")
        axes[0, column].set_title(title)
        axes[0, column].legend(fontsize=8, ncols=2)
        axes[1, column].set_xlabel("averaging time [s]")
    figure.suptitle("Allan deviation of the presets: white noise, 1/f and random walk, x axis")
    figure.savefig(sys.argv[1], dpi=110)


if __name__ == "__main__":
    main()
