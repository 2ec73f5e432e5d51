# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a dataset says about a camera: EuRoC's sensor.yaml, both ways, and kalibr's camchain."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages import CameraInfo
from imu_sim_ros.bags.text import decimal
from imu_sim_ros.config import rotation_problems
from imu_sim_ros.datasets.images import pose_text
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import parse_yaml, read_text
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND

_TO_EUROC: Final = {
    "plumb_bob": "radial-tangential",
    "rational_polynomial": "radial-tangential8",
    "equidistant": "equidistant",
}
_TO_ROS: Final = {
    **{euroc: ros for ros, euroc in _TO_EUROC.items()},
    "none": "plumb_bob",
    "radtan": "plumb_bob",
    "radtan8": "rational_polynomial",
}
_SHAPES: Final = {"pinhole": (), "unified": ("xi",), "double_sphere": ("xi", "alpha")}
"""Numbers of each camera model beside the intrinsics of a pinhole."""
_KALIBR: Final = {"pinhole": "pinhole", "omni": "unified", "ds": "double_sphere"}
_LARGEST: Final = 1 << 20
"""Pixels along a side; larger ones are a mistake."""
_PLUMB_BOB: Final = 5


class Description(NamedTuple):
    """What is known about a camera; None: not known."""

    info: CameraInfo | None = None
    pose: NDArray[np.float64] | None = None
    """T_bc (4, 4): maps points of the camera into the body."""


def sensor_yaml(found: Description, stamps: Sequence[int], comment: str) -> str:
    """Return EuRoC's description of a camera; what is not known is left out."""
    text = f"# Camera\nsensor_type: camera\ncomment: {comment}\n\n"
    if found.pose is not None:
        text += f"# T_BS maps points of the camera into the body.\n{pose_text(found.pose)}\n"
    if len(stamps) > 1:
        period = float(np.median(np.diff(sorted(stamps))))
        text += f"rate_hz: {round(NANOSECONDS_PER_SECOND / period, 3):g}\n"
    if found.info is None:
        return text
    info, d = found.info, found.info.d
    model, kind = "pinhole", _TO_EUROC.get(info.distortion_model, info.distortion_model or "none")
    names = _SHAPES.get(info.distortion_model, ())
    if names:  # the spheres, whose numbers come first in D
        model, kind = info.distortion_model, "radial-tangential" if len(d) > len(names) else "none"
    shape = "".join(f"{name}: {decimal(value)}\n" for name, value in zip(names, d, strict=False))
    d = d[len(names) :] or (0.0,) * (4 if names else 0)
    if info.distortion_model == "plumb_bob" and len(d) == _PLUMB_BOB and d[4] == 0.0:
        d = d[:4]
    numbers = ", ".join(decimal(float(info.k[at])) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return (
        f"{text}resolution: [{info.width}, {info.height}]\ncamera_model: {model}\n{shape}"
        f"intrinsics: [{numbers}] # fu, fv, cu, cv\ndistortion_model: {kind}\n"
        f"distortion_coefficients: [{', '.join(decimal(float(value)) for value in d)}]\n"
    )


def read_sensor_yaml(path: Path) -> Description:
    """Return what a EuRoC folder's sensor.yaml says about a camera.

    :raises InputError: with a line for each value that cannot be used.
    """
    keys = _Keys(path, _mapping(path))
    pose = keys.pose("T_BS", "data")
    if "intrinsics" not in keys.tree:
        return keys.finished(None, pose)
    model = keys.one_of("camera_model", tuple(_SHAPES))
    shape = [keys.numbers(name, (1,))[0] for name in _SHAPES[model]]
    focal = keys.numbers("intrinsics", (4,))
    return keys.finished(keys.info(model, shape, focal, "distortion_coefficients"), pose)


def read_camchain(path: Path, camera: str) -> Description:
    """Return what kalibr's camchain says about a camera; the body is the IMU.

    :raises InputError: with a line for each value that cannot be used.
    """
    tree = _mapping(path).get(camera)
    if not isinstance(tree, dict):
        return Description()
    keys = _Keys(path, tree, f"{camera}: ")
    t_ci = keys.pose("T_cam_imu")
    model = _KALIBR[keys.one_of("camera_model", tuple(_KALIBR))]
    count = len(_SHAPES[model])
    numbers = keys.numbers("intrinsics", (count + 4,))
    info = keys.info(model, numbers[:count], numbers[count:], "distortion_coeffs")
    return keys.finished(info, None if t_ci is None else inverse(t_ci))


def inverse(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the transform (4, 4) the other way."""
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def _mapping(path: Path) -> dict[str, Any]:
    lines = read_text(path).splitlines(keepends=True)
    if lines and lines[0].startswith("%YAML:"):  # OpenCV's own first line, which is no YAML
        lines = lines[1:]
    try:
        tree = parse_yaml("".join(lines))
    except ValueError as error:
        raise InputError(f"{path}: not YAML: {error}") from None
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must hold names and values")
    return tree


class _Keys:
    """The values of a description, and what is wrong with them."""

    def __init__(self, path: Path, tree: dict[str, Any], prefix: str = "") -> None:
        self.tree = tree
        self._name, self._problems = f"{path}: {prefix}", list[str]()

    def finished(self, info: CameraInfo | None, pose: NDArray[np.float64] | None) -> Description:
        if self._problems:
            raise InputError(self._problems)
        return Description(info, pose)

    def one_of(self, key: str, allowed: Sequence[str]) -> str:
        value = self.tree.get(key)
        if value in allowed:
            return str(value)
        self._refuse(key, value, f"must be one of {', '.join(allowed)}")
        return allowed[0]

    def numbers(self, key: str, counts: Sequence[int]) -> list[float]:
        """Return as many finite numbers as one of the counts; of none given any number."""
        value = self.tree.get(key)
        entries: list[Any] = value if isinstance(value, list) else [value]
        try:
            found = [float(entry) for entry in entries if not isinstance(entry, bool)]
        except (TypeError, ValueError):
            found = []
        fits = len(found) == len(entries) and (not counts or len(found) in counts)
        if fits and np.isfinite(found).all():
            return found
        words = f"{' or '.join(map(str, counts))} finite numbers" if counts else "finite numbers"
        self._refuse(key, value, f"must be {words}")
        return [0.0] * (counts[0] if counts else 0)

    def pose(self, key: str, below: str = "") -> NDArray[np.float64] | None:
        """Return a transform (4, 4), of 16 numbers or of four rows; None where there is none."""
        value = self.tree.get(key)
        if value is not None and below:
            value = value.get(below) if isinstance(value, dict) else value
        if value is None:
            return None
        try:
            matrix = np.array(value, dtype=np.float64).reshape(4, 4)
        except (TypeError, ValueError):
            self._refuse(key, value, "must be a matrix of 4 x 4 numbers")
            return None
        if not np.isfinite(matrix).all() or not np.allclose(matrix[3], (0, 0, 0, 1)):
            self._refuse(key, value, "must be finite, its last row 0, 0, 0, 1")
            return None
        nine: Any = tuple(matrix[:3, :3].ravel().tolist())
        self._problems += rotation_problems(nine, f"{self._name}{key}")
        return matrix

    def info(
        self, model: str, shape: Sequence[float], focal: Sequence[float], coefficients: str
    ) -> CameraInfo:
        """Return the model in the terms of sensor_msgs/CameraInfo."""
        width, height = self.numbers("resolution", (2,))
        if not all(1 <= side <= _LARGEST and side == int(side) for side in (width, height)):
            self._refuse("resolution", self.tree.get("resolution"), "must be width, height [px]")
        told = self.tree.get("distortion_model", "none")
        kind = _TO_ROS.get(told, told if isinstance(told, str) else "")
        d = self.numbers(coefficients, ()) if self.tree.get(coefficients) else []
        if kind == "plumb_bob":
            d = [*d, *[0.0] * (_PLUMB_BOB - len(d))]
        if model != "pinhole":
            kind, d = model, [*shape, *(d if told != "none" else [])]
        fx, fy, cx, cy = focal
        k = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        p = np.column_stack([k, np.zeros(3)])
        return CameraInfo(int(height), int(width), kind, tuple(d), k, np.eye(3), p)

    def _refuse(self, key: str, value: Any, allowed: str) -> None:
        words = "missing" if value is None else repr(value)
        shown = words if len(words) <= 60 else words[:57] + "..."
        self._problems.append(f"{self._name}{key} = {shown}: {allowed}")
