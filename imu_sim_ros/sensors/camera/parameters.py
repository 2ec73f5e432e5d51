# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a camera: model, distortion, place on the body, timing and the tracks it gives."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from imu_sim_ros.core.rotation import pose_matrix
from imu_sim_ros.core.timebase import LOWEST_RATE
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    Matrix,
    Vector,
    choice,
    flag,
    integer,
    matrix,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.sensors.parameters import (
    LARGEST_LATENCY,
    LONGEST,
    MountedParameters,
    RatedParameters,
    rotation_problems,
)

COUNTS: Final[dict[str, tuple[int, ...]]] = {"none": (0,), "radtan": (4, 5), "equidistant": (4,)}
"""Numbers of coefficients that each distortion model takes: k1 k2 p1 p2 (k3), k1 k2 k3 k4."""


def radial_coefficients(model: str, distortion: Sequence[float]) -> tuple[float, ...]:
    """Return k1, k2, ... of ``1 + k1 s + k2 s^2 + ...`` with s the radius, or angle, squared."""
    if model == "radtan":
        return (*distortion[:2], *distortion[4:5])
    return tuple(distortion)


def fold(model: str, distortion: Sequence[float]) -> tuple[float, float]:
    """Return the radius (or the angle [rad]) at which the distortion folds, and its image there.

    There the polynomial's slope, ``1 + 3 k1 s + 5 k2 s^2 + ...``, becomes zero for the first time.

    :returns: both infinite if it never folds; for the equidistant model at most pi.
    """
    k = radial_coefficients(model, distortion)
    limit = math.pi if model == "equidistant" else math.inf
    slope = [1.0] + [(2 * j + 3) * value for j, value in enumerate(k)]
    roots = np.roots(slope[::-1]) if any(k) else np.zeros(0)
    real = roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)].real
    radius = min(limit, math.sqrt(float(real.min()))) if len(real) else limit
    if math.isinf(radius):
        return radius, radius
    return radius, float(distorted_radius(np.array([radius]), k)[0])


def distorted_radius(r: Array, k: Sequence[float]) -> Array:
    """Return ``r (1 + k1 r^2 + k2 r^4 + ...)`` for r of any shape."""
    s = r * r
    factor = np.zeros_like(r)
    for value in reversed(k):
        factor = (factor + value) * s
    return r * (1.0 + factor)


IMAGES = ("raw", "compressed", "both", "none")
ENCODINGS = ("mono8", "rgb8")
FLOWS = ("none", "raw", "kitti")
MIP_LEVELS = ("nearest", "trilinear")
RESPONSES = ("srgb", "linear")


@dataclass(frozen=True)
class ImageParameters:
    """Photometry, noise and encoding of images; grey values are 0 to 255."""

    images: str = choice(
        "raw",
        IMAGES,
        "messages on topics and in bags: raw: NAME/image_raw; compressed: "
        "NAME/image_raw/compressed, PNG; both; none: only tracks, for scenes without surfaces",
    )
    encoding: str = choice("mono8", ENCODINGS, "pixel encoding: grey values or colours")
    depth: bool = flag(
        False,
        "also the depth along the view, without errors: NAME/depth/image_raw, 32FC1 in m; in EuRoC "
        "folders NAME/depth, PNG of 16 bits in mm; 0 if nothing is seen",
    )
    flow: str = choice(
        "none",
        FLOWS,
        "also the optical flow to the next image, without errors, and which pixels have one: "
        "NAME/flow/image_raw, 32FC2 in px, NaN if there is none; in EuRoC folders NAME/flow: "
        "raw: .npy of the same; kitti: KITTI's PNG of 16 bits instead",
    )
    frame: str = text("", "frame of the messages; empty: NAME_optical_frame")
    antialiasing: bool = flag(
        True,
        "pixels see what is in their areas: every surface at an edge, and textures along their "
        "footprints; false: what is at their centres, with stepped edges",
    )
    supersampling: int = integer(
        1,
        "rays along each side of a pixel, each of a part of its area",
        minimum=1,
        maximum=8,
    )
    mip_levels: str = choice(
        "nearest",
        MIP_LEVELS,
        "levels of a texture that a pixel samples: nearest: the one that fits best; trilinear: "
        "the two next to it",
    )
    exposure_time: float = number(
        0.0,
        "motion blur: how long the shutter is open; 0: an instant",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
    )
    blur_samples: int = integer(
        8, "instants combined into one blurred image", minimum=2, maximum=64
    )
    exposure_change: float = number(
        0.0,
        "amplitude of a slow variation of exposure_time, relative to it, as from automatic "
        "exposure; the grey values follow",
        unit="1",
        minimum=0.0,
        maximum=0.95,
    )
    exposure_period: float = number(
        10.0, "period of that change", unit="s", minimum=0.0, above_minimum=True, maximum=LONGEST
    )
    gain: float = number(
        1.0, "factor applied to all grey values", minimum=0.0, above_minimum=True, maximum=1e6
    )
    gain_change: float = number(
        0.0,
        "amplitude of a slow variation of the gain, as from automatic exposure",
        minimum=0.0,
        maximum=0.95,
    )
    gain_period: float = number(
        10.0, "period of that change", unit="s", minimum=0.0, above_minimum=True, maximum=LONGEST
    )
    response: str = choice(
        "srgb",
        RESPONSES,
        "grey values as functions of light: srgb: its power 1/2.2, as in photos; linear: in "
        "proportion to it, as machine vision cameras give them: shadows are darker, contrast is "
        "higher",
    )
    auto_exposure: float = number(
        0.0,
        "grey value to which automatic exposure brings the mean of an image, by a factor of all "
        "grey values; noise is multiplied with dark images; 0: off",
        unit="grey value",
        minimum=0.0,
        maximum=255.0,
    )
    auto_exposure_lag: float = number(
        0.5,
        "time constant with which that factor follows a change",
        unit="s",
        minimum=0.0,
        maximum=10.0,
    )
    auto_exposure_limit: float = number(
        4.0,
        "largest factor by which it makes images brighter or darker",
        minimum=1.0,
        maximum=100.0,
    )
    vignetting: float = number(
        0.0,
        "darkening at the farthest corner; grows with the square of the distance",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )
    shot_noise: float = number(
        0.0,
        "standard deviation at grey value 255; proportional to the square root of the value",
        unit="grey value",
        minimum=0.0,
        maximum=1e6,
    )
    read_noise: float = number(
        1.0, "standard deviation at every grey value", unit="grey value", minimum=0.0, maximum=1e6
    )
    repeat_probability: float = number(
        0.0,
        "probability that a frame repeats the one before it",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        if self.exposure_change > 0.0 and self.exposure_time == 0.0:
            yield (
                f"{prefix}exposure_change = {self.exposure_change:g}: {prefix}exposure_time must "
                "be above 0 s for it"
            )


MODELS = ("pinhole", "unified", "double_sphere")
LARGEST_IMAGE = 16384
"""Largest width or height of an image [px]."""
FARTHEST = 1e6
"""Largest distance of visible things [m]."""


@dataclass(frozen=True)
class CameraModelParameters:
    """Projection and distortion model. The centre of the first pixel is at (0, 0)."""

    preset: str = text("vio_data_simulation", "file in config/cameras, or a path, to start from")
    model: str = choice(
        "pinhole",
        MODELS,
        "pinhole; unified: Mei's sphere, with xi; double_sphere: with xi and alpha",
    )
    distortion_model: str = choice(
        "none",
        tuple(COUNTS),
        "distortion after the projection; equidistant (Kannala-Brandt) with pinhole only",
    )
    width: int = integer(640, "width of the image", unit="px", minimum=1, maximum=LARGEST_IMAGE)
    height: int = integer(480, "height of the image", unit="px", minimum=1, maximum=LARGEST_IMAGE)
    intrinsics: tuple[float, ...] = numbers(
        (400.0, 400.0, 319.5, 239.5), "fx, fy, cx, cy", unit="px"
    )
    distortion: tuple[float, ...] = numbers(
        (), "radtan: k1, k2, p1, p2 and optionally k3; equidistant: k1, k2, k3, k4"
    )
    xi: float = number(0.0, "distance between the spheres' centres", minimum=-1.0, maximum=10.0)
    alpha: float = number(
        0.5, "parameter alpha of the double sphere model", minimum=0.0, maximum=1.0
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from self._intrinsics_problems(prefix)
        counts = COUNTS[self.distortion_model]
        if len(self.distortion) not in counts:
            allowed = " or ".join(map(str, counts))
            yield (
                f"{prefix}distortion = {list(self.distortion)}: must have {allowed} entries for "
                f"{prefix}distortion_model {self.distortion_model}"
            )
            return
        if self.model != "pinhole" and self.distortion_model == "equidistant":
            yield (
                f"{prefix}distortion_model = 'equidistant': must be radtan or none for "
                f"{prefix}model {self.model}"
            )
        elif len(self.intrinsics) == 4 and min(self.intrinsics[:2]) > 0.0:
            yield from self._fold_problems(prefix)

    def _intrinsics_problems(self, prefix: str) -> Iterator[str]:
        """Yield problems of focal lengths and principal point."""
        if len(self.intrinsics) != 4:
            shown = list(self.intrinsics)
            yield f"{prefix}intrinsics = {shown}: must be four numbers: fx, fy, cx, cy"
            return
        fx, fy, cx, cy = self.intrinsics
        for name, value in (("fx", fx), ("fy", fy)):
            if value <= 0.0:
                yield f"{prefix}intrinsics: {name} = {value:g}: must be above 0 px"
        for name, value, size in (("cx", cx, self.width), ("cy", cy, self.height)):
            if not -0.5 <= value <= size - 0.5:
                yield (
                    f"{prefix}intrinsics: {name} = {value:g}: must be inside the image, from -0.5 "
                    f"to {size - 0.5:g} px"
                )

    def _fold_problems(self, prefix: str) -> Iterator[str]:
        """Yield a problem if the distortion folds the image within its borders."""
        radius, image = fold(self.distortion_model, self.distortion)
        fx, fy, cx, cy = self.intrinsics
        x = max(cx + 0.5, self.width - 0.5 - cx) / fx
        y = max(cy + 0.5, self.height - 0.5 - cy) / fy
        corner = math.hypot(x, y)
        if image < corner:
            what = "angle" if self.distortion_model == "equidistant" else "normalised radius"
            yield (
                f"{prefix}distortion = {list(self.distortion)}: folds at a {what} of {radius:.4g}, "
                f"{image * fx:.1f} px from the centre, inside the image, whose farthest corner is "
                f"at {corner * fx:.1f} px"
            )


@dataclass(frozen=True)
class CameraMountParameters(MountedParameters):
    """Pose of the camera on the body. Camera axes: x to the right, y down, z along the view."""

    lever_arm: Vector = vector(0.0, "position of the camera in the body frame, p_bc", unit="m")
    mounting: Matrix = matrix(IDENTITY_MATRIX, "rotation R_bc of the camera in the body")
    body_axes: str = choice(
        "trajectory",
        ("trajectory", "preset", "flu"),
        "preset: the body's axes are those in which lever_arm and mounting are given; flu: the "
        "body is forward, left, up, and rig_mounting turns the whole rig to look forward; "
        "trajectory: preset for recorded poses and for a given mounting, flu for all others",
    )
    rig_mounting: Matrix = matrix(
        IDENTITY_MATRIX,
        "rotation from the axes of lever_arm and mounting to forward, left, up; for body_axes flu",
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each matrix that is not a rotation."""
        yield from rotation_problems(self.mounting, f"{prefix}mounting")
        yield from rotation_problems(self.rig_mounting, f"{prefix}rig_mounting")

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return R_bc (3, 3) and p_bc (3,) [m] with the rig turned as body_axes says.

        Which axes a trajectory has is decided before: see :func:`~.rig_parameters.axes`.
        """
        r, p = np.reshape(self.mounting, (3, 3)), np.asarray(self.lever_arm)
        if self.body_axes != "flu":
            return r, p
        turn = np.reshape(self.rig_mounting, (3, 3))
        return turn @ r, turn @ p

    def mount(self) -> Array:
        """Return the pose T_bc (4, 4) of :meth:`pose`."""
        return pose_matrix(*self.pose())


@dataclass(frozen=True)
class CameraTimingParameters(RatedParameters):
    """Frame times, exposure, and errors of the stamps."""

    rate: float = number(20.0, "frames per second", unit="Hz", minimum=LOWEST_RATE, maximum=1000.0)
    trigger: str = choice(
        "free",
        ("free", "synchronised"),
        "free: its own clock, the first frame at phase; synchronised: each frame at the time of an "
        "IMU sample, so the rate must divide the IMU's",
    )
    phase: float = number(
        0.0, "time of the first frame after the start", unit="s", minimum=0.0, maximum=LONGEST
    )
    time_offset: float = number(
        0.0,
        "IMU time minus camera stamp (kalibr's timeshift_cam_imu, VINS' td): stamp = time of the "
        "middle of the exposure - time_offset",
        unit="s",
        minimum=-10.0,
        maximum=10.0,
    )
    jitter: float = number(
        0.0,
        "standard deviation of the stamps' error, truncated at 0.45 of the interval",
        unit="s",
        minimum=0.0,
    )
    latency: float = number(
        0.0,
        "delay from the middle of the exposure to the message",
        unit="s",
        minimum=0.0,
        maximum=LARGEST_LATENCY,
    )
    dropout_probability: float = number(
        0.0, "probability that a frame is lost", unit="1", minimum=0.0, maximum=1.0
    )
    row_time: float = number(
        0.0,
        "rolling shutter: time from one row to the next, the middle row at the frame's time; 0: "
        "global shutter",
        unit="s",
        minimum=0.0,
        maximum=1e-3,
    )


@dataclass(frozen=True)
class TrackParameters:
    """Feature tracks: which landmarks are seen, and their errors."""

    pixel_noise: float = number(
        1.0, "standard deviation in u and in v", unit="px", minimum=0.0, maximum=LARGEST_IMAGE
    )
    outlier_probability: float = number(
        0.0,
        "probability that a feature is an outlier anywhere in the image",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )
    mismatch_probability: float = number(
        0.0,
        "probability that a feature is given the pixel of another one in the same frame",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )
    track_lifetime: int = integer(
        0,
        "frames after which a landmark gets a new id; 0: never, the id is the landmark",
        minimum=0,
        maximum=2**31 - 1,
    )
    max_features: int = integer(
        200, "largest number of features in a frame; 0: all", minimum=0, maximum=2**31 - 1
    )
    grid_rows: int = integer(
        4, "features are spread over this many rows of cells", minimum=1, maximum=256
    )
    grid_columns: int = integer(
        5, "features are spread over this many columns of cells", minimum=1, maximum=256
    )
    border: float = number(
        0.0,
        "features closer to the image edge are not seen",
        unit="px",
        minimum=0.0,
        maximum=LARGEST_IMAGE,
    )
    min_depth: float = number(
        0.1,
        "closer landmarks are not seen",
        unit="m",
        minimum=0.0,
        above_minimum=True,
        maximum=FARTHEST,
    )
    max_depth: float = number(
        100.0,
        "landmarks farther away are not seen",
        unit="m",
        minimum=0.0,
        above_minimum=True,
        maximum=FARTHEST,
    )


_IN_MEMORY: Final = 1 << 23
"""Memory for the images of one camera that are read at once [bytes]."""
_MOST_FRAMES: Final = 64
"""Largest number of frames that are read at once."""


@dataclass(frozen=True)
class CameraParameters(
    ImageParameters,
    TrackParameters,
    CameraTimingParameters,
    CameraMountParameters,
    CameraModelParameters,
):
    """Parameters of a camera: lens, mount, timing, tracks of features, and images."""

    @property
    def longest_window(self) -> float:
        """Longest time that is read at once [s]: its images take about 8 MB of memory."""
        size = self.width * self.height * (3 if self.encoding == "rgb8" else 1)
        return min(max(_IN_MEMORY // size, 1), _MOST_FRAMES) / self.rate

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from CameraModelParameters.problems(self, prefix)
        yield from CameraMountParameters.problems(self, prefix)
        yield from ImageParameters.problems(self, prefix)
        if self.max_depth <= self.min_depth:
            yield (
                f"{prefix}max_depth = {self.max_depth:g}: must be above {prefix}min_depth, "
                f"{self.min_depth:g} m"
            )
        if 2.0 * self.border >= min(self.width, self.height):
            yield f"{prefix}border = {self.border:g}: leaves no part of the image"
        if self.row_time * self.height * self.rate > 1.0:
            yield (
                f"{prefix}row_time = {self.row_time:g}: {self.height} rows must be read in less "
                f"than the interval, {1.0 / self.rate:g} s"
            )
        longest = self.exposure_time * (1.0 + self.exposure_change)
        if longest * self.rate > 1.0:
            changed = f", with {prefix}exposure_change up to {longest:g} s" * (
                self.exposure_change > 0.0
            )
            yield (
                f"{prefix}exposure_time = {self.exposure_time:g}{changed}: must be shorter than "
                f"the interval, {1.0 / self.rate:g} s"
            )
        if self.jitter * self.rate > 0.25:
            yield (
                f"{prefix}jitter = {self.jitter:g}: must be at most a quarter of the interval, "
                f"{0.25 / self.rate:g} s"
            )
