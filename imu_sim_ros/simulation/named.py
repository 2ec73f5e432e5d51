# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of cameras and sensors of the body that are named by preset or file alone."""

from collections.abc import Sequence


def cameras(presets: Sequence[object]) -> dict[str, object]:
    """Return the parameters of cameras cam0, cam1, ..., by dotted name; none without any."""
    names = [f"cam{k}" for k in range(len(presets))]
    layer: dict[str, object] = {"cameras": names} if names else {}
    pairs = zip(names, presets, strict=True)
    return layer | {f"{name}.camera.preset": preset for name, preset in pairs}


def sensors(kind: str, presets: Sequence[object]) -> tuple[list[str], dict[str, object]]:
    """Return the names of sensors of a kind, KIND, KIND1, KIND2, ..., and their parameters.

    :param presets: True: that of the kind's parameters.
    """
    names = [f"{kind}{k}" if k else kind for k in range(len(presets))]
    layer: dict[str, object] = {f"{name}.type": kind for name in names[1:]}
    for name, preset in zip(names, presets, strict=True):
        if preset is not True:
            layer[f"{name}.preset"] = preset
    return names, layer
