# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One strip of what the package simulates and measures: camera, LiDAR, dead reckoning, noise.

python examples/front_page.py [FOLDER]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import imu_sim_ros as ims

PLACE, MOMENT, HEIGHT = "machine_hall", 4.0, 480
tour = {"trajectory.type": "tour", "scene.type": PLACE, "duration": MOMENT + 0.5}
rig = ims.camera.build_rig(
    {
        **tour,
        "cameras": ["cam0"],
        "camera.preset": "euroc_cam0",
        "camera.encoding": "rgb8",
        "camera.rate": 1.0,
        "camera.phase": MOMENT,
    }
)
_, image = next(rig.images("cam0"))

scans = ims.simulate(
    trajectory="tour",
    scene={"type": PLACE},
    duration=MOMENT + 0.2,
    seed=1,
    sensors=["lidar"],
    lidar={"preset": "os0_128"},
).lidar
points = scans.cloud(len(scans.range) - 1).xyz

flight = ims.simulate(imu="tactical", trajectory="figure_eight", duration=60, rate=200, seed=1)
track = ims.dead_reckon(flight, method="midpoint")

still = ims.simulate(imu="mpu6000", trajectory="static", duration=3600, rate=200, seed=1)
noise = ims.allan(still)


def draw(dark: bool, path: Path) -> None:
    """Draw the four panels on a light or a dark page."""
    ink, muted, accent = (
        ("#E6EDF3", "#30363D", "#58A6FF") if dark else ("#1F2328", "#E4E7EA", "#0969DA")
    )
    plt.rcParams.update(
        {
            "text.color": ink,
            "axes.edgecolor": ink,
            "axes.labelcolor": ink,
            "xtick.color": ink,
            "ytick.color": ink,
            "font.size": 10.0,
        }
    )
    figure = plt.figure(figsize=(13.0, 3.1))
    width, gap = 0.235, 0.02
    titles = ("camera", "LiDAR", "dead reckoning", "Allan deviation")
    panels = [
        figure.add_axes([0.003, 0.03, width, 0.85]),
        figure.add_axes([0.003 + width + gap, 0.03, width, 0.85]),
        figure.add_axes([0.56, 0.19, 0.17, 0.69]),
        figure.add_axes([0.81, 0.19, 0.185, 0.69]),
    ]
    for panel, title in zip(panels, titles, strict=True):
        panel.set_title(title, color=ink, fontsize=12, loc="left")
        panel.set_facecolor("none")
    camera, lidar, path_panel, noise_panel = panels

    camera.imshow(image, aspect="auto")
    camera.axis("off")

    # The scan from behind and above the sensor, nearest points last.
    azimuth, elevation = np.deg2rad(-62.0), np.deg2rad(38.0)
    forward = np.array(
        [
            -np.cos(elevation) * np.cos(azimuth),
            -np.cos(elevation) * np.sin(azimuth),
            -np.sin(elevation),
        ]
    )
    side = np.cross(forward, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, forward)
    depth = points @ forward
    order = np.argsort(-depth)
    below_ceiling = order[points[order, 2] < np.percentile(points[:, 2], 97) - 0.3]
    lidar.scatter(
        points[below_ceiling] @ side,
        points[below_ceiling] @ up,
        c=points[below_ceiling, 2],
        s=0.35,
        cmap="turbo",
        vmin=points[:, 2].min() - 0.6,  # the darkest colours would vanish on a dark page
        linewidths=0,
        rasterized=True,
    )
    lidar.set_aspect("equal", adjustable="datalim")
    lidar.axis("off")

    x, y = flight.truth.position[:, 0], flight.truth.position[:, 1]
    path_panel.plot(x, y, color=ink, linewidth=1.0, label="truth")
    path_panel.plot(
        track.position[:, 0],
        track.position[:, 1],
        color=accent,
        linewidth=2.0,
        label="estimate",
    )
    path_panel.set(xlabel="x [m]", ylabel="y [m]")
    path_panel.set_aspect("equal", adjustable="datalim")
    path_panel.legend(frameon=False, loc="lower left", fontsize=9)

    for axis, colour in zip("xyz", ("#E5484D", "#30A46C", "#3E82F7"), strict=True):
        k = "xyz".index(axis)
        noise_panel.loglog(
            noise.tau,
            np.rad2deg(noise.gyroscope.deviation[:, k]) * 3600,
            color=colour,
            linewidth=1.8,
            label=axis,
        )
    noise_panel.set(xlabel="averaging time [s]", ylabel="gyroscope [deg/h]")
    noise_panel.legend(frameon=False, fontsize=9)
    for panel in panels[2:]:
        panel.grid(color=muted, linewidth=0.7)
        panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=140, transparent=True)
    plt.close(figure)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
for dark, name in ((False, "front_page_light.png"), (True, "front_page_dark.png")):
    draw(dark, folder / name)
    print(folder / name)
