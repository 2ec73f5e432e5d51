# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras in the stacks' files: the values of a simulated rig, in every stack's terms."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.config.cameras import CameraParameters, SceneParameters
from imu_sim_ros.consumers.values import ImuValues

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigValues:
    """One IMU and the cameras beside it, as their consumers see them."""

    imu: ImuValues
    cameras: Mapping[str, CameraParameters]
    """By name, in order."""
    topics: Mapping[str, str]
    """Of each camera's images."""
    scene: SceneParameters

    def imu_camera(self, name: str) -> Array:
        """Return T_ic (4, 4), which maps coordinates from a camera to the IMU."""
        imu = self.imu.imu
        t_bi = _pose(np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm))
        result: Array = _inverse(t_bi) @ _pose(*self.cameras[name].pose())
        return result

    def between(self, first: str, second: str) -> Array:
        """Return T (4, 4), which maps coordinates from the second camera to the first."""
        result: Array = _inverse(self.imu_camera(first)) @ self.imu_camera(second)
        return result

    def camera_imu(self, name: str) -> Array:
        """Return T_ci (4, 4), which maps coordinates from the IMU to a camera."""
        return _inverse(self.imu_camera(name))

    def fits(self, *models: str) -> bool:
        """Return whether all cameras are of the models named by :func:`kind`."""
        return all(kind(camera) in models for camera in self.cameras.values())

    def remarks(self, k3: bool = False) -> Iterator[str]:
        """Yield what a format cannot express, a sentence each.

        :param k3: the format takes a fifth coefficient of the radial-tangential distortion.
        """
        for name, camera in self.cameras.items():
            if len(camera.distortion) == 5 and camera.distortion[4] and not k3:
                yield f"{name}: this format cannot express k3 = {decimal(camera.distortion[4])}"


def kind(camera: CameraParameters) -> str:
    """Return the kind of lens: radtan, equidistant, unified or double_sphere.

    A pinhole without distortion is radtan with zeros, which every stack knows.
    """
    if camera.model != "pinhole":
        return camera.model
    return "equidistant" if camera.distortion_model == "equidistant" else "radtan"


def four(camera: CameraParameters) -> list[float]:
    """Return four coefficients of distortion, zeros where there is none."""
    return [*camera.distortion, 0.0, 0.0, 0.0, 0.0][:4]


def real(value: float) -> str:
    """Return a number that YAML readers parse as floating point."""
    words = decimal(value)
    return words if "." in words else f"{words}.0"


def listed(values: Iterator[float] | list[float] | tuple[float, ...]) -> str:
    """Return numbers as a list of YAML."""
    return f"[{', '.join(real(value) for value in values)}]"


def opencv_matrix(matrix: Array, code: str = "d") -> str:
    """Return a matrix (r, c) as OpenCV's YAML has it.

    :param code: d: double; f: float.
    """
    rows, columns = matrix.shape
    data = ",\n          ".join(", ".join(real(v) for v in row) for row in matrix.tolist())
    return (
        f"!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: {code}\n   data: [{data}]\n"
    )


def _pose(r: Array, p: Array) -> Array:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = r, p
    return result


def _inverse(t: Array) -> Array:
    """Return the inverse of a rigid motion, exact in its last row."""
    r = t[:3, :3].T
    return _pose(r, -r @ t[:3, 3])
