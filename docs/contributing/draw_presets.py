# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the presets: ``python docs/contributing/draw_presets.py docs/images/sensors_allan.png``."""

import sys

import matplotlib as mpl
import numpy as np

from imu_sim_ros.plots import style
from imu_sim_ros.plots.readings import allan_deviation
from imu_sim_ros.sensors import catalogue
from imu_sim_ros.simulation.parameters import load_simulation

PANELS = {
    "consumer": ("consumer",),
    "industrial": ("industrial",),
    "tactical, navigation, lecture": ("tactical", "navigation", "classroom"),
}
UNITS = {"gyroscope": "rad/s", "accelerometer": "m/s$^2$"}
TIMES = np.logspace(-2, 5, 200)


def main() -> None:
    """Write the picture: a column for each grade, a row for each triad."""
    presets = catalogue.descriptions("imus").items()
    figure, panels = style.panels(2, len(PANELS), 13.0, 8.5, sharex=True, sharey="row")
    for column, (title, grades) in enumerate(PANELS.items()):
        names = [name for name, text in presets if text.partition(",")[0].lower() in grades]
        for row, (triad, unit) in enumerate(UNITS.items()):
            panel = panels[row * len(PANELS) + column]
            for k, name in enumerate(names):
                parameters = load_simulation({"imu.preset": name}).imu.triad(triad)
                panel.loglog(
                    TIMES,
                    allan_deviation(parameters, TIMES),
                    "-" if k < 10 else "--",
                    color=mpl.colormaps["tab10"](k % 10),
                    label=name,
                )
            if column == 0:
                panel.set_ylabel(f"{triad}, Allan deviation [{unit}]")
        style.title(panels[column], title)
        panel.set_xlabel("cluster time [s]")
        panel.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8, frameon=False
        )
    style.draw_heading(figure, "Allan deviation of the presets, x axis")
    style.save(figure, sys.argv[1])


if __name__ == "__main__":
    main()
