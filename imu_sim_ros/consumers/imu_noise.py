# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The noise of an IMU in the files and conventions of the programs that take its data.

Continuous-time densities (kalibr, OpenVINS, ORB_SLAM3) and per-sample values (VINS, imu_utils) are
mixed up again and again; each file says in a comment what its numbers mean.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from imu_sim_ros.bags import make_folder
from imu_sim_ros.bags.text import decimal

_FLICKER: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
_SMALLEST: Final = 1e-12  # kalibr and OpenVINS divide by these numbers


class Noise(NamedTuple):
    """Noise of an IMU, one number for all axes (their root mean square), in continuous time."""

    gyroscope_noise_density: float
    gyroscope_random_walk: float
    accelerometer_noise_density: float
    accelerometer_random_walk: float
    gyroscope_bias_instability: float
    accelerometer_bias_instability: float
    rate: float
    gravity: float
    topic: str

    def densities(self) -> dict[str, float]:
        """Return the four numbers of kalibr."""
        return {name: getattr(self, name) for name in self._fields[:4]}

    def lowest_deviation(self, triad: str) -> float:
        """Return the minimum of the Allan deviation of white noise, flicker and random walk.

        ``N^2 / tau + 0.664^2 B^2 + K^2 tau / 3`` is smallest at ``tau = sqrt(3) N / K``.
        """
        n = getattr(self, f"{triad}_noise_density")
        k = getattr(self, f"{triad}_random_walk")
        b = getattr(self, f"{triad}_bias_instability")
        return math.sqrt(2.0 * n * k / math.sqrt(3.0) + (_FLICKER * b) ** 2)


def noise(*, rate: float, gravity: float, topic: str, **per_axis: Sequence[float]) -> Noise:
    """Return the noise of an IMU whose values are given per axis."""
    means = {
        name: math.sqrt(sum(value**2 for value in values) / len(values))
        for name, values in per_axis.items()
    }
    return Noise(**means, rate=rate, gravity=gravity, topic=topic)


def write_all(folder: Path, values: Noise) -> None:
    """Write all files into a new folder."""
    make_folder(folder)
    for name, text in (
        ("imu.yaml", kalibr(values)),
        ("vins_mono.yaml", vins(values)),
        ("vins_fusion.yaml", vins(values)),
        ("kalibr_imu_chain.yaml", openvins(values)),
        ("orb_slam3.yaml", orb_slam3(values)),
        ("imu_utils.yaml", imu_utils(values)),
    ):
        (folder / name).write_text(text, encoding="utf-8")


def _positive(values: Noise) -> tuple[str, dict[str, float]]:
    """Return densities above 0, and a comment where one of them is not the simulation's."""
    zero = [name for name, value in values.densities().items() if value == 0.0]
    comment = ""
    if zero:
        comment = f"# 0 in the simulation, where a number above 0 is wanted: {', '.join(zero)}\n"
    return comment, {name: max(value, _SMALLEST) for name, value in values.densities().items()}


def kalibr(values: Noise) -> str:
    """Return kalibr's imu.yaml."""
    comment, numbers = _positive(values)
    lines = "".join(f"{name}: {decimal(value)}\n" for name, value in numbers.items())
    return (
        "# kalibr: continuous-time densities, what the simulation has.\n"
        "# rad/s/sqrt(Hz), rad/s^2/sqrt(Hz), m/s^2/sqrt(Hz), m/s^3/sqrt(Hz)\n"
        f"{comment}{lines}rostopic: {values.topic}\nupdate_rate: {values.rate:g}\n"
    )


def vins(values: Noise) -> str:
    """Return the IMU's part of a configuration of VINS-Mono or VINS-Fusion."""
    root = math.sqrt(values.rate)
    return (
        "%YAML:1.0\n"
        "# VINS-Mono, VINS-Fusion: values per sample at this rate, not densities: both the noise\n"
        f"# and the walk are multiplied by the square root of the rate, sqrt({values.rate:g} Hz)\n"
        "# (integration_base.h uses them as discrete).\n"
        f'imu_topic: "{values.topic}"\n'
        f"acc_n: {decimal(values.accelerometer_noise_density * root)}\n"
        f"gyr_n: {decimal(values.gyroscope_noise_density * root)}\n"
        f"acc_w: {decimal(values.accelerometer_random_walk * root)}\n"
        f"gyr_w: {decimal(values.gyroscope_random_walk * root)}\n"
        f"g_norm: {decimal(values.gravity)}\n"
    )


def openvins(values: Noise) -> str:
    """Return OpenVINS' kalibr_imu_chain.yaml."""
    comment, numbers = _positive(values)
    lines = "".join(f"  {name}: {decimal(value)}\n" for name, value in numbers.items())
    identity = "    - [ 1.0, 0.0, 0.0 ]\n    - [ 0.0, 1.0, 0.0 ]\n    - [ 0.0, 0.0, 1.0 ]\n"
    zero = "    - [ 0.0, 0.0, 0.0 ]\n" * 3
    pose = (
        "    - [ 1.0, 0.0, 0.0, 0.0 ]\n    - [ 0.0, 1.0, 0.0, 0.0 ]\n"
        "    - [ 0.0, 0.0, 1.0, 0.0 ]\n    - [ 0.0, 0.0, 0.0, 1.0 ]\n"
    )
    return (
        "%YAML:1.0\n"
        "# OpenVINS: continuous-time densities in kalibr's units, what the simulation has.\n"
        f"{comment}imu0:\n  T_i_b:\n{pose}{lines}"
        f"  rostopic: {values.topic}\n  time_offset: 0.0\n  update_rate: {values.rate:.1f}\n"
        f'  model: "kalibr"\n  Tw:\n{identity}  R_IMUtoGYRO:\n{identity}'
        f"  Ta:\n{identity}  R_IMUtoACC:\n{identity}  Tg:\n{zero}"
    )


def orb_slam3(values: Noise) -> str:
    """Return the IMU's part of a configuration of ORB_SLAM3."""
    return (
        "%YAML:1.0\n"
        "# ORB_SLAM3: continuous-time densities, what the simulation has; it multiplies the noise\n"
        "# by the square root of the frequency itself.\n"
        f"IMU.NoiseGyro: {decimal(values.gyroscope_noise_density)}\n"
        f"IMU.NoiseAcc: {decimal(values.accelerometer_noise_density)}\n"
        f"IMU.GyroWalk: {decimal(values.gyroscope_random_walk)}\n"
        f"IMU.AccWalk: {decimal(values.accelerometer_random_walk)}\n"
        f"IMU.Frequency: {values.rate:.1f}\n"
    )


def imu_utils(values: Noise) -> str:
    """Return what imu_utils should find, in the form of its result."""
    root = math.sqrt(values.rate)
    sections = []
    for name, triad, short, unit in (
        ("Gyr", "gyroscope", "gyr", " rad/s"),
        ("Acc", "accelerometer", "acc", " m/s^2"),
    ):
        white = getattr(values, f"{triad}_noise_density") * root
        lowest = values.lowest_deviation(triad)
        axes = "".join(
            f"   {axis}:\n      {short}_n: {white:.9e}\n      {short}_w: {lowest:.9e}\n"
            for axis in ("avg-axis", "x-axis", "y-axis", "z-axis")
        )
        sections.append(f'{name}:\n   unit: "{unit}"\n{axes}')
    return (
        "%YAML:1.0\n---\n"
        f"# What imu_utils finds in these data: _n is the noise of one sample at {values.rate:g}\n"
        "# Hz, density * sqrt(rate); _w is the lowest point of the Allan deviation (the bias\n"
        "# instability), not a random walk.\n"
        "type: IMU\nname: imu_sim_ros\n" + "".join(sections)
    )
