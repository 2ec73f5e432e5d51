# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stereo recording that is small enough for tests: 94 x 60 pixels, grey and in colour."""

from collections.abc import Mapping

SETTINGS = {
    "camera.body_axes": "flu",
    "camera.width": "94",
    "camera.height": "60",
    "camera.intrinsics": "[57.3,57.2,45.9,31.0]",
    "camera.dropout_probability": "0.2",
    "cam1.camera.encoding": "rgb8",
    "cam1.camera.depth": "true",
}


def small_stereo(duration: str, settings: Mapping[str, str]) -> list[str]:
    """Return the options of ``generate`` for the recording before a board of AprilTags.

    :param settings: parameters beyond those of all such recordings.
    """
    return [
        *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--trajectory", "target"),
        *("--duration", duration, "--seed", "5", "--quiet", "--scene", "aprilgrid"),
        *(
            word
            for name, value in {**SETTINGS, **settings}.items()
            for word in ("--set", f"{name}={value}")
        ),
    ]
