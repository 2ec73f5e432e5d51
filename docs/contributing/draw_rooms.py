# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the rooms: ``python docs/contributing/draw_rooms.py docs/images/rooms.png``."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

FLOORS = (
    (("commands", "arguments, printing"), ("nodes", "ROS 2, no mathematics")),
    (("jobs", "what Python calls"), ("campaigns", "many runs"),
     ("reports", "pages"), ("plots", "pictures")),
    (("formats", "the door"), ("datasets", "EuRoC, CSV, tracks, stacks"),
     ("navigation", "readings to path"), ("calibration", "readings to parameters")),
    (("simulation", "trajectory + sensors = blocks of samples"),),
    (("sensors", "one folder a sensor: parameters, model, topics"),
     ("bags", "messages and containers")),
    (("trajectory", "where the body is"),),
    (("places", "geometry, materials, light"), ("recordings", "clock and findings")),
    (("terminal", "tables, progress, signals"),),
    (("parameters", "declared once"),),
    (("inputs", "files, rows, poses as text"),),
    (("core", "records, rotations, times, errors, names"),),
)  # fmt: skip


def main() -> None:
    """Draw one row a floor; who stands higher may import what is below."""
    figure, axes = plt.subplots(figsize=(10.0, 7.4))
    for floor, rooms in enumerate(reversed(FLOORS)):
        width = 10.0 / len(rooms)
        for k, (name, text) in enumerate(rooms):
            box = FancyBboxPatch(
                (k * width + 0.06, floor + 0.08),
                width - 0.12,
                0.84,
                boxstyle="round,pad=0,rounding_size=0.08",
                facecolor="#eef3fa",
                edgecolor="#3b6ea5",
            )
            axes.add_patch(box)
            middle = (k + 0.5) * width
            axes.text(middle, floor + 0.62, name, ha="center", va="center", weight="bold", size=10)
            axes.text(middle, floor + 0.32, text, ha="center", va="center", size=8)
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, len(FLOORS))
    axes.axis("off")
    figure.tight_layout(pad=0.2)
    figure.savefig(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
