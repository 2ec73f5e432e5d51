# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of each place, from a tour through it.

python examples/places.py [FOLDER] [PLACE ...]
"""

import sys
from pathlib import Path

import imu_sim_ros as ims
from imu_sim_ros.sensors.camera.images.files import png

# Seconds into the tour at which something is in view.
MOMENTS = {"office": 22.0, "corridor": 8.0, "warehouse": 1.5, "machine_hall": 4.0, "street": 52.0}
# EuRoC's lens in colour, at 1 Hz.
CAMERA = {
    "camera.preset": "euroc_cam0",
    "camera.encoding": "rgb8",
}

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
for place in sys.argv[2:] or MOMENTS:
    moment = MOMENTS[place]
    tour = {"trajectory.type": "tour", "scene.type": place, "duration": moment + 0.5}
    tour_camera = {"cameras": ["cam0"], "camera.rate": 1.0, "camera.phase": moment}
    rig = ims.camera.build_rig({**CAMERA, **tour_camera, **tour})
    _, image = next(rig.images("cam0"))
    name = folder / f"place_{place}.png"
    name.write_bytes(png(image))
    print(name)
