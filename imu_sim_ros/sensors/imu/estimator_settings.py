# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise in the settings of estimators: ORB_SLAM3, LIO-SAM, Basalt; values per sample are refused.

- ORB_SLAM3 (Settings.cc) and LIO-SAM (gtsam's preintegration) have densities in continuous time.
- Basalt (calibration.hpp) has densities per axis, and corrects ``x = (I + M) reading - b``: here
  ``reading = S x + bias`` with ``S = (I + M)^-1`` and ``bias = S b``.
- VINS (integration_base.h), FAST-LIO (use-ikfom.hpp) and the results of imu_utils have values per
  sample, and no rate that would turn them into densities.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import nearest, short_repr
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.files import dotted_values
from imu_sim_ros.parameters.yaml_text import YamlMapping

_DENSITIES: Final = {
    # ORB_SLAM3
    "IMU.NoiseGyro": "gyroscope_noise_density",
    "IMU.NoiseAcc": "accelerometer_noise_density",
    "IMU.GyroWalk": "gyroscope_random_walk",
    "IMU.AccWalk": "accelerometer_random_walk",
    "IMU.Frequency": "update_rate",
    # LIO-SAM
    "imuGyrNoise": "gyroscope_noise_density",
    "imuAccNoise": "accelerometer_noise_density",
    "imuGyrBiasN": "gyroscope_random_walk",
    "imuAccBiasN": "accelerometer_random_walk",
    "imuGravity": "gravity",
    # Basalt
    "gyro_noise_std": "gyroscope_noise_density",
    "accel_noise_std": "accelerometer_noise_density",
    "gyro_bias_std": "gyroscope_random_walk",
    "accel_bias_std": "accelerometer_random_walk",
    "imu_update_rate": "update_rate",
}
"""Keys of an IMU's file by the ends of the names in the settings."""
_SAMPLE: Final = "the noise of one sample (VINS, imu_utils): the density is {key}/sqrt(rate)"
_WALK: Final = "a walk per sample (VINS), or the lowest Allan deviation (imu_utils), not a density"
_VARIANCE: Final = "a variance per sample (FAST-LIO): the density is sqrt({key}/rate)"
_PER_SAMPLE: Final = {
    "gyr_n": (_SAMPLE, "gyroscope_noise_density"),
    "acc_n": (_SAMPLE, "accelerometer_noise_density"),
    "gyr_w": (_WALK, "gyroscope_random_walk"),
    "acc_w": (_WALK, "accelerometer_random_walk"),
    "gyr_cov": (_VARIANCE, "gyroscope_noise_density"),
    "acc_cov": (_VARIANCE, "accelerometer_noise_density"),
    "b_gyr_cov": (_VARIANCE, "gyroscope_random_walk"),
    "b_acc_cov": (_VARIANCE, "accelerometer_random_walk"),
}
"""Values without a density: their meaning, and the parameter that has to be set."""
_CORRECTIONS: Final = {
    "calib_accel_bias": ("accelerometer", ([0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2])),
    "calib_gyro_bias": ("gyroscope", ([0, 1, 2] * 3, [0, 0, 0, 1, 1, 1, 2, 2, 2])),
}
"""Basalt's corrections: triad, and the rows and columns of M behind the three entries of b."""
_SIMILAR: Final = 0.85
"""Similarity from which on an unknown name is a typing error."""


def is_readable(tree: YamlMapping) -> bool:
    """Return True if a tree holds the IMU's noise in an estimator's terms."""
    return any(_key(name) in (*_DENSITIES, *_PER_SAMPLE) for name in _names(tree))


def _names(tree: YamlMapping, prefix: str = "") -> list[str]:
    """Return the paths of all values in a tree."""
    names = []
    for name, value in tree.items():
        path = f"{prefix}{name}"
        names += _names(value, f"{path}.") if isinstance(value, Mapping) else [path]
    return names


def _key(name: str) -> str:
    """Return the end of a dotted name by which the settings are known."""
    return name if name in _DENSITIES else name.rpartition(".")[2]


def keys_of_imu(tree: YamlMapping, path: str | Path) -> tuple[dict[str, object], list[str]]:
    """Return the keys of an IMU's file for the settings of an estimator, and the unused names.

    :param tree: content of the settings.
    :param path: path of the settings, for the messages.
    :raises ConfigurationError: with a line for each value per sample, and each bad correction.
    """
    keys: dict[str, object] = {}
    unused: list[str] = []
    problems: dict[str, str] = {}
    for name, value in dotted_values(tree, str(path)).items():
        key = _key(name)
        if key in _PER_SAMPLE:
            meaning, parameter = _PER_SAMPLE[key]
            line = f"{path}: {name} = {short_repr(value)}: {meaning.format(key=key)}"
            problems.setdefault(key, f"{line}; set imu.{parameter}")
        elif key in _DENSITIES:
            keys[_DENSITIES[key]] = value
        elif key in _CORRECTIONS:
            triad, (rows, columns) = _CORRECTIONS[key]
            response = _response(value, rows, columns)
            if response is None:
                problems[key] = f"{path}: {name} = {short_repr(value)}: not a correction of Basalt"
                continue
            matrix, bias = response
            keys[f"{triad}_scale_misalignment"] = np.ravel(matrix).tolist()
            keys[f"{triad}_bias"] = bias.tolist()
        elif (suggested := nearest(name, _DENSITIES, _SIMILAR)) and suggested not in tree:
            problems[key] = f"{path}: {name}: unknown key; did you mean {suggested}?"
        elif not name.endswith((".rows", ".cols", ".dt")):
            unused.append(name.removesuffix(".data"))
    if problems:
        raise ConfigurationError(list(problems.values()))
    return keys, unused


def _response(value: object, rows: list[int], columns: list[int]) -> tuple[Array, Array] | None:
    """Return S (3, 3) and the bias (3,) of a correction of Basalt; None if it is none."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if numbers.shape != (3 + len(rows),) or not np.isfinite(numbers).all():
        return None
    correction = np.eye(3)
    correction[rows, columns] += numbers[3:]
    if abs(np.linalg.det(correction)) < 1e-9:
        return None
    response: Array = np.asarray(np.linalg.inv(correction), dtype=np.float64)
    return response, response @ numbers[:3]
