# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions of cameras and clouds in a recording: the terms of sensor_msgs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import AnyArray, Array

COEFFICIENTS: Final[dict[str, tuple[int, ...]]] = {
    "": (0,),
    "none": (0,),
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (8, 12, 14),
    **dict.fromkeys(("equidistant", "fisheye"), (4,)),
    "unified": (1, 5, 6),
    "double_sphere": (2, 6, 7),
}
"""Numbers of coefficients of each distortion model (OpenCV, calib3d); those of the spheres with xi,
or xi and alpha, in front. Other models are not known."""

PLUMB_BOB: Final = 5
"""Number of coefficients that ROS writes for its model plumb_bob."""
ROS_DISTORTIONS: Final = {
    **dict.fromkeys(("none", "radtan"), "plumb_bob"),
    "radtan8": "rational_polynomial",
    "equidistant": "equidistant",
}
"""Names in image_geometry by those of kalibr, as in its converters."""


class CameraInfo(NamedTuple):
    """A camera's model in the terms of sensor_msgs/CameraInfo."""

    height: int
    """Rows of the full image [px]."""
    width: int
    """Columns of the full image [px]."""
    distortion_model: str
    """Name of the distortion model."""
    d: tuple[float, ...]
    """Parameters of the distortion."""
    k: Array
    """(3, 3) intrinsic matrix of the full image [px]."""
    r: Array
    """(3, 3) rectification."""
    p: Array
    """(3, 4) projection of the rectified image."""
    binning: tuple[int, int] = (0, 0)
    """Pixels of the full image that are combined, along x and y; 0 and 1: none are."""
    region: tuple[int, int, int, int] = (0, 0, 0, 0)
    """Offset along x and y, height and width of the region of interest in the full image [px];
    a size of 0: all of it."""

    @classmethod
    def of_lens(
        cls, size: tuple[int, int], intrinsics: Sequence[float], model: str, d: Sequence[float]
    ) -> "CameraInfo":
        """Return the description of a camera whose images are not rectified: R is I, P is [K 0].

        :param size: height and width [px].
        :param intrinsics: fx, fy, cx, cy [px].
        :param model: name of the distortion model.
        :param d: its parameters; those of plumb_bob are filled up with zeros, as ROS writes them.
        """
        fx, fy, cx, cy = intrinsics
        k = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        if model == "plumb_bob" and len(d) in COEFFICIENTS[model]:
            d = (*d, *[0.0] * (PLUMB_BOB - len(d)))
        return cls(*size, model, tuple(d), k, np.eye(3), np.column_stack([k, np.zeros(3)]))

    @property
    def image_size(self) -> tuple[int, int]:
        """Height and width of the image that it describes [px]."""
        _, _, height, width = self.region
        if not (height and width):
            height, width = self.height, self.width
        x, y = (max(factor, 1) for factor in self.binning)
        return height // y, width // x

    @property
    def is_part(self) -> bool:
        """True if the image is binned or a region of the full one."""
        return self.image_size != (self.height, self.width)

    def of_image(self) -> "CameraInfo":
        """Return the model of the image itself, without binning and region.

        The offset moves the principal point, then binning divides (image_geometry,
        PinholeCameraModel).
        """
        (x, y, *_), (height, width) = self.region, self.image_size
        move = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, 1.0]])
        shrink = np.diag([1.0 / max(factor, 1) for factor in self.binning] + [1.0])
        k, p = (np.asarray(shrink @ move @ matrix) for matrix in (self.k, self.p))
        return CameraInfo(height, width, self.distortion_model, self.d, k, self.r, p)

    def rectified(self) -> "CameraInfo | None":
        """Return the model of the rectified image: that of P, without distortion.

        None: P has no focal length, so that it is not known.
        """
        k = np.asarray(self.p[:, :3])
        if not (k[0, 0] > 0.0 and k[1, 1] > 0.0):
            return None
        return self._replace(distortion_model="plumb_bob", d=(0.0,) * 4, k=k, r=np.eye(3))

    def is_equal(self, other: "CameraInfo") -> bool:
        """Return True if both describe the same camera."""
        return (
            (*self[:3], self.binning, self.region) == (*other[:3], other.binning, other.region)
            and np.array_equal(self.d, other.d, equal_nan=True)
            and np.array_equal(self.k, other.k)
            and np.array_equal(self.r, other.r)
            and np.array_equal(self.p, other.p)
        )


@dataclass(frozen=True)
class CameraRecord:
    """The descriptions of one camera, and the size of its images."""

    source: str
    """Name of the file and topic."""
    infos: tuple[CameraInfo, ...]
    """Descriptions that differ from the one before, in the order of the file."""
    rows: tuple[int, ...] = (0,)
    """Number of the message of each, from 0."""
    size: tuple[int, int] | None = None
    """Height and width of the images [px]; None: there are none."""


@dataclass(frozen=True)
class CloudRecord:
    """The first clouds of a topic."""

    source: str
    """Name of the file and topic."""
    fields: tuple[str, ...]
    """Names of the fields of a point."""
    organised: bool
    """True for the rows and columns of an image, as depth cameras send them."""
    times: Mapping[str, tuple[AnyArray, ...]]
    """Times of the points of each cloud, by the name of the field."""


TIME_FIELDS: Final = ("time", "t", "timestamp", "time_stamp", "offset_time", "time_offset")
"""Names that drivers give to the time of a point (velodyne, ouster, hesai, livox, robosense)."""
