# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about cameras and clouds: descriptions that contradict images, times of points."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.recordings.cameras import COEFFICIENTS, CameraInfo, CameraRecord, CloudRecord
from imu_sim_ros.recordings.findings.finding import Evidence, check

_SCANNED: Final = frozenset({"ring", "line", "channel", "intensity", "reflectivity", "i"})
"""Fields of a point that scanners send and depth cameras do not."""


def _calibrated_cameras(camera: CameraRecord) -> Iterator[tuple[int, CameraInfo]]:
    """Yield the descriptions with intrinsics, each with the number of its message."""
    for row, info in zip(camera.rows, camera.infos, strict=True):
        if info.k[0, 0] > 0.0 and info.k[1, 1] > 0.0:
            yield row, info


@check(
    "warning",
    "its pixels have no directions",
    "calibrate the camera, and give its driver the file (camera_info_url)",
)
def intrinsics_absent(camera: CameraRecord) -> Iterator[Evidence]:
    """Find a camera_info whose K is not that of a calibrated camera: zeros."""
    without = len(camera.infos) - len(list(_calibrated_cameras(camera)))
    if camera.infos and without == len(camera.infos):
        fx, fy = camera.infos[0].k[0, 0], camera.infos[0].k[1, 1]
        yield Evidence(f"K has fx = {fx:g}, fy = {fy:g}")


@check(
    "error",
    "the intrinsics of one image do not hold for another one",
    "fix focus and zoom, and record again; or cut the recording where they change",
)
def intrinsics_changed(camera: CameraRecord) -> Iterator[Evidence]:
    """Find a camera_info that changes within the recording."""
    calibrated = list(_calibrated_cameras(camera))
    if len(calibrated) < 2:
        return
    (_, first_info), (row, second_info) = calibrated[:2]
    shown = [_numbers(info) for info in (first_info, second_info)]
    text = f"{shown[0]} becomes {shown[1]}" if shown[0] != shown[1] else "it changes"
    yield Evidence(f"{text}; {len(calibrated)} descriptions", row, len(calibrated) - 1)


def _numbers(info: CameraInfo) -> str:
    """Return focal lengths and principal point as text."""
    numbers = (info.k[0, 0], info.k[1, 1], info.k[0, 2], info.k[1, 2])
    return f"fx, fy, cx, cy = {', '.join(f'{value:.6g}' for value in numbers)}"


@check(
    "error",
    "intrinsics of another image size are wrong by the ratio of the sizes",
    "calibrate at the size of the images, or state binning and region of interest in camera_info",
)
def image_size(camera: CameraRecord) -> Iterator[Evidence]:
    """Find a camera_info of another size than its images, binning and region included."""
    if camera.size is None:
        return
    for row, info in zip(camera.rows, camera.infos, strict=True):
        if (info.height, info.width) != (0, 0) and info.image_size != camera.size:
            described, images = (f"{w} x {h}" for h, w in (info.image_size, camera.size))
            part = " after binning and region of interest" if info.is_part else ""
            yield Evidence(f"described are {described} pixels{part}, images have {images}", row)
            return


@check(
    "error",
    "what reads the coefficients takes them for others, or stops",
    "write as many coefficients as the distortion model has",
)
def distortion_count(camera: CameraRecord) -> Iterator[Evidence]:
    """Find a camera_info whose coefficients are too few or many for its model, or not finite."""
    for row, info in _calibrated_cameras(camera):
        problem = distortion_problem(info)
        if problem:
            yield Evidence(problem, row)
            return


def distortion_problem(info: CameraInfo) -> str:
    """Return a text if coefficients are too few or many, or not finite; empty if not."""
    if not np.isfinite(info.d).all():
        return f"coefficients {', '.join(f'{value:g}' for value in info.d)}: not finite"
    counts = COEFFICIENTS.get(info.distortion_model, (len(info.d),))
    if len(info.d) in counts:
        return ""
    expected = " or ".join(map(str, counts))
    return f"{len(info.d)} coefficients; {info.distortion_model or 'no model'} has {expected}"


@check(
    "warning",
    "what reads the coefficients does not know what they mean, or takes them for others",
    "name the model as sensor_msgs does: plumb_bob, rational_polynomial, equidistant",
)
def distortion_unknown(camera: CameraRecord) -> Iterator[Evidence]:
    """Find a camera_info with coefficients of a distortion model that is not known."""
    for row, info in _calibrated_cameras(camera):
        if info.d and info.distortion_model not in COEFFICIENTS:
            yield Evidence(f"{info.distortion_model} with {len(info.d)} coefficients", row)
            return


@check(
    "note",
    "K holds for the full image; what takes it for these images is wrong by offset and factor",
    "nothing: convert_bag writes the model of the images; others have to convert it",
)
def image_part(camera: CameraRecord) -> Iterator[Evidence]:
    """Find images that are binned, or a region of the full one."""
    for row, info in zip(camera.rows, camera.infos, strict=True):
        if info.is_part:
            x, y, height, width = info.region
            region = f", region {width} x {height} at ({x}, {y})" if height and width else ""
            factors = " x ".join(str(max(factor, 1)) for factor in info.binning)
            yield Evidence(f"{info.width} x {info.height}, binning {factors}{region}", row)
            return


CAMERAS: Final = (
    intrinsics_changed,
    image_size,
    distortion_count,
    distortion_unknown,
    intrinsics_absent,
    image_part,
)
"""Checks of the description of a camera."""
UNUSABLE: Final = (
    *(intrinsics_changed.kind, image_size.kind),
    *(distortion_count.kind, intrinsics_absent.kind),
)
"""Kinds of findings after which the description does not hold for the images."""


@check(
    "note",
    "motion within a scan cannot be taken out of it",
    "let the driver send the time of each point",
)
def point_times_absent(cloud: CloudRecord) -> Iterator[Evidence]:
    """Find clouds of a scanner whose points have no times."""
    if not cloud.times and not cloud.organised and _SCANNED & set(cloud.fields):
        yield Evidence(f"fields of a point: {', '.join(cloud.fields)}")


@check(
    "warning",
    "motion within a scan is taken out of it wrongly, or not at all",
    "let the driver send the time of each point",
)
def point_times_constant(cloud: CloudRecord) -> Iterator[Evidence]:
    """Find clouds of a scanner whose points all have the same time."""
    for name, clouds in cloud.times.items():
        several = [times for times in clouds if len(times) > 1]
        if several and all(np.all(times == times[0]) for times in several):
            value = float(several[0][0])
            yield Evidence(f"{name} of all points of a cloud is {value:.9g}")


CLOUDS: Final = (point_times_constant, point_times_absent)
"""Checks of clouds."""
