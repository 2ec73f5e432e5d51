# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""OpenVINS: ``kalibr_imu_chain.yaml`` (ov_msckf/src/core/VioManagerOptions.h)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.consumers.values import ImuValues, comment, remarks, rows

Array = NDArray[np.float64]

_EXPRESSED: Final = (
    "gyroscope_scale_misalignment",
    "accelerometer_scale_misalignment",
    "gyroscope_g_sensitivity",
)


def triangular(response: Array) -> tuple[Array, Array]:
    """Return T and R with ``S = T R``: T lower triangular, R a rotation.

    OpenVINS' model ``kalibr`` reads ``w_m = T_w R_IMUtoGYRO w + T_g a + b`` (Simulator.cpp) and
    keeps nothing but the lower triangle of T's inverse: a full S has to be divided between the two.

    :param response: (3, 3) S, invertible.
    """
    q, r = np.linalg.qr(response.T)  # S^T = Q R, so S = R^T Q^T
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    # An S that is triangular already stays as it is, to the last digit.
    if not np.triu(response, 1).any() and (np.diag(response) > 0.0).all():
        return response, np.eye(3)
    return np.tril(r.T * signs), signs[:, None] * q.T


def imu_chain(values: ImuValues) -> str:
    """Return OpenVINS' kalibr_imu_chain.yaml, whole."""
    head = comment(
        [
            "OpenVINS kalibr_imu_chain.yaml, whole: continuous-time densities in kalibr's units, "
            "as the simulation has them.",
            "w_m = Tw R_IMUtoGYRO w + Tg a + b and a_m = Ta R_IMUtoACC a + b",
            *remarks(values, _EXPRESSED, above_zero=True),
        ]
    )
    densities = "".join(
        f"  {name}: {decimal(value)}\n" for name, value in values.positive_densities().items()
    )
    tw, r_gyro = triangular(values.response("gyroscope"))
    ta, r_acc = triangular(values.response("accelerometer"))
    tg = np.reshape(values.axes("gyroscope_g_sensitivity"), (3, 3))
    intrinsics = "".join(
        f"  {name}:\n{rows(matrix, '    ')}"
        for name, matrix in (
            ("Tw", tw),
            ("R_IMUtoGYRO", r_gyro),
            ("Ta", ta),
            ("R_IMUtoACC", r_acc),
            ("Tg", tg),
        )
    )
    return (
        f"%YAML:1.0\n{head}imu0:\n  T_i_b:\n{rows(np.eye(4), '    ')}{densities}"
        f"  rostopic: {values.topic}\n  time_offset: 0.0\n"
        f'  update_rate: {decimal(values.rate)}\n  model: "kalibr"\n{intrinsics}'
    )
