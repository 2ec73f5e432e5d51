# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera rig in the terms of the stacks, and the stacks that cannot initialise on its motion."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.core.rotation import inverse_pose
from imu_sim_ros.core.types import Array, field_values
from imu_sim_ros.datasets.consumers.values import SAME_TIME, ImuValues, yaml_float
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.scene_parameters import SceneParameters


@dataclass(frozen=True)
class RigValues:
    """One IMU and the cameras next to it, as their consumers see them."""

    imu: ImuValues
    cameras: Mapping[str, CameraParameters]
    """Cameras by name, in order."""
    topics: Mapping[str, str]
    """Topic of each camera's images."""
    scene: SceneParameters
    """Scene that the cameras see."""
    bad_starts: tuple["BadStart", ...] = ()
    """Stacks that will initialise badly on this motion."""

    def start_remarks(self, stack: str) -> Iterator[str]:
        """Yield a sentence for each reason for which a stack will initialise badly."""
        yield from (f"WARNING: {start.line}" for start in self.bad_starts if start.stack == stack)

    def imu_camera(self, name: str) -> Array:
        """Return T_ic (4, 4), which maps coordinates from a camera to the IMU."""
        return inverse_pose(self.imu.imu.mount()) @ self.cameras[name].mount()

    def between(self, target: str, source: str) -> Array:
        """Return T (4, 4), which maps coordinates from the source camera to the target camera."""
        return inverse_pose(self.imu_camera(target)) @ self.imu_camera(source)

    def camera_imu(self, name: str) -> Array:
        """Return T_ci (4, 4), which maps coordinates from the IMU to a camera."""
        return inverse_pose(self.imu_camera(name))

    def time_shift(self, name: str) -> float:
        """Return the time shift of a camera, ``t_imu = t_cam + shift`` [s].

        It is the camera's time offset plus error of stamps and delay of readings of the IMU.
        """
        return self.cameras[name].time_offset + self.imu.lateness

    def fits(self, *models: str) -> bool:
        """Return whether all cameras are of these kinds of lens (:func:`lens_kind`)."""
        return all(lens_kind(camera) in models for camera in self.cameras.values())

    def remarks(
        self, expressed: Collection[str] = (), cameras: int | None = None, one_shift: str = ""
    ) -> Iterator[str]:
        """Yield a sentence for each property of the cameras that a format cannot express.

        :param expressed: parameters that the format can express next to lens, mount and rate;
            ``k3``: the fifth coefficient of a pinhole; ``unified.distortion``: four of that sphere;
            ``time_offset``: the time shift between camera and IMU.
        :param cameras: number of cameras in the format, the first ones; None: all.
        :param one_shift: name of a stack that uses the time shift of the first camera for all;
            empty: it has one for each camera.
        """
        cameras_in_format = list(self.cameras.items())[:cameras]
        for name, camera in cameras_in_format:
            terms = list(_inexpressible_errors(camera, expressed))
            shift = self.time_shift(name)
            if shift and "time_offset" not in expressed:
                terms.append(f"time_offset = {decimal(shift)} s (of the camera to the IMU)")
            if terms:
                yield f"{name}: simulated, but not expressible in this format: {', '.join(terms)}"
        if one_shift:
            yield from self._time_shift_notes(one_shift, [name for name, _ in cameras_in_format])
        if "time_offset" in expressed:
            yield from self.imu.delay_remarks()

    def _time_shift_notes(self, stack: str, names: list[str]) -> Iterator[str]:
        """Yield a sentence for each camera whose time shift is not that of the first one."""
        common = self.time_shift(names[0])
        for name in names[1:]:
            shift = self.time_shift(name)
            if abs(shift - common) > SAME_TIME:
                yield (
                    f"{name}: its time shift is {_seconds(shift)}, but {stack} has one for all "
                    f"cameras: that of {names[0]}, {_seconds(common)}"
                )


def _seconds(time: float) -> str:
    """Return a time as text with six digits and its unit: ``0.005 s``."""
    return f"{decimal(float(f'{time:.6g}'))} s"


_NO_TERMS: Final = frozenset(
    [
        *("width", "height", "intrinsics", "xi", "alpha", "distortion", "time_offset"),
        *("lever_arm", "mounting", "rig_mounting", "rate", "phase"),
        *("supersampling", "blur_samples", "exposure_period", "gain", "gain_period"),
        *("pixel_noise", "read_noise", "track_lifetime", "max_features", "grid_rows"),
        *("grid_columns", "border", "min_depth", "max_depth"),
    ]
)
"""Parameters that a format has a place for, that a front end chooses, or that are no error."""


def _inexpressible_errors(camera: CameraParameters, expressed: Collection[str]) -> Iterator[str]:
    """Yield the errors of a camera that a format cannot express, with their values."""
    sphere = camera.model != "pinhole"
    if sphere and any(camera.distortion) and f"{camera.model}.distortion" not in expressed:
        yield f"distortion = [{', '.join(map(decimal, camera.distortion))}]"
    elif any(camera.distortion[4:]) and (sphere or "k3" not in expressed):
        yield f"k3 = {decimal(camera.distortion[4])}"
    values, perfect = field_values(camera), field_values(CameraParameters())
    for name, parameter in parameters(CameraParameters).items():
        value = values[name]
        if isinstance(value, str | bool):  # a choice, such as the encoding, is no error
            continue
        if name in _NO_TERMS or name in expressed or value == perfect[name]:
            continue
        unit = f" {parameter.unit}" if parameter.unit not in ("", "1") else ""
        rolling = " (rolling shutter)" if name == "row_time" else ""
        yield f"{name} = {decimal(value)}{unit}{rolling}"


def lens_kind(camera: CameraParameters) -> str:
    """Return the kind of lens: radtan, equidistant, unified or double_sphere.

    A pinhole without distortion is radtan with zeros, which every stack supports.
    """
    if camera.model != "pinhole":
        return camera.model
    return "equidistant" if camera.distortion_model == "equidistant" else "radtan"


def four_coefficients(camera: CameraParameters) -> list[float]:
    """Return four coefficients of distortion, zeros if there is none."""
    return [*camera.distortion, 0.0, 0.0, 0.0, 0.0][:4]


def yaml_list(values: Iterator[float] | list[float] | tuple[float, ...]) -> str:
    """Return numbers as a YAML list of floating-point numbers: ``[1.0, 0.5]``."""
    return f"[{', '.join(yaml_float(value) for value in values)}]"


def opencv_matrix(matrix: Array, code: str = "d") -> str:
    """Return a matrix (r, c) as OpenCV's YAML has it.

    :param code: d: double; f: float.
    """
    rows, columns = matrix.shape
    data = ",\n          ".join(", ".join(yaml_float(v) for v in row) for row in matrix.tolist())
    return (
        f"!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: {code}\n   data: [{data}]\n"
    )


REST_THRESHOLD: Final = 0.5
"""``init_imu_thresh`` of the estimator_config.yaml that is written [m/s^2]."""
_WINDOW: Final = 1.0
"""Half of the ``init_window_time`` of OpenVINS [s]."""
_STATIC: Final = "ov_init/src/static/StaticInitializer.cpp"
_VELOCITY_SIGMA: Final = 0.01
"""Initial standard deviation of the zero velocity in OpenVINS [m/s]."""
_BIAS_SIGMA: Final = 0.02
"""Initial standard deviation of the accelerometer's bias in OpenVINS [m/s^2].

The attitude's, 0.02 rad, allows ten times as large a bias across gravity.
"""
_MAX_SIGMAS: Final = 2.0
"""Standard deviations beyond which a start is bad."""
_GRAVITY: Final = {"VINS-Mono": 1.0, "VINS-Fusion": 0.5}
"""Largest error of the magnitude of gravity, initial_aligment.cpp [m/s^2]."""


class InitialMotion(NamedTuple):
    """True motion of an IMU at the start of a flight, at n times."""

    t: Array
    """(n,) times after the start, evenly spaced [s]."""
    accel: Array
    """(n, 3) specific force without errors [m/s^2]."""
    speed: Array
    """(n,) speed [m/s]."""


class BadStart(NamedTuple):
    """A stack that will initialise badly."""

    stack: str
    reason: str
    """Reason, with the stack's threshold and its source."""

    @property
    def line(self) -> str:
        """Stack and reason in one line."""
        return f"{self.stack}: {self.reason}"


def bad_starts(values: ImuValues, start: InitialMotion) -> Iterator[BadStart]:
    """Yield the stacks that will initialise badly at the start of a flight."""
    yield from (BadStart("OpenVINS", reason) for reason in _openvins(values, start))
    bias = values.axes("accelerometer_bias")
    size = float(np.linalg.norm(bias))
    for stack, limit in _GRAVITY.items():
        if size > limit:
            yield BadStart(
                stack,
                f"the accelerometer's bias of this run, {size:.2f} m/s^2, can put gravity "
                f"further off than the {limit:g} m/s^2 at which it rejects an initialisation with "
                "one camera (initial_aligment.cpp, LinearAlignment)",
            )


def _openvins(values: ImuValues, start: InitialMotion) -> Iterator[str]:
    """Yield the reasons for which OpenVINS cannot initialise well on this start of a motion."""
    rest, speed = _rest(values, start)
    if rest is None:
        yield (
            f"starts late or wrongly: in the first {start.t[-1]:.0f} s there is no rest "
            f"of {_WINDOW:g} s (accelerometer's deviation below {REST_THRESHOLD:g} m/s^2, "
            f"init_imu_thresh, and velocity 0 +- {_VELOCITY_SIGMA:g} m/s, {_STATIC}) with a jerk "
            f"after it{speed}; trajectory.lead_in.rest=2 begins with both"
        )
        return
    # At rest, the mean reading gives the attitude and the bias along gravity, not the one across.
    force = start.accel[np.searchsorted(start.t, rest)]
    cross = np.cross(values.axes("accelerometer_bias"), force / np.linalg.norm(force))
    across = float(np.linalg.norm(cross))
    if across > _MAX_SIGMAS * _BIAS_SIGMA:
        yield (
            "the accelerometer's bias of this run tilts its first attitude by "
            f"{across / values.gravity:.3f} rad: {across:.2g} m/s^2 of it are across gravity, and "
            f"its static start takes that part for 0 +- {_BIAS_SIGMA:g} m/s^2 ({_STATIC}); "
            "imu.accelerometer_turn_on_bias_sigma=0 is a calibrated sensor"
        )


def _rest(values: ImuValues, start: InitialMotion) -> tuple[float | None, str]:
    """Return the end of the first rest before a jerk [s], and an empty text.

    None without such a rest, with a text about a steady motion that looks like a rest, if any.
    """
    count = round(_WINDOW / (start.t[1] - start.t[0]))
    if len(start.t) < 2 * count:
        return None, ""
    windows = np.lib.stride_tricks.sliding_window_view(start.accel, count, axis=0)
    deviation = np.sqrt(windows.var(axis=2).sum(axis=1) + values.rest_deviation**2)
    deviation_before, deviation_after = deviation[:-count], deviation[count:]
    starts = (
        np.flatnonzero((deviation_before <= REST_THRESHOLD) & (deviation_after >= REST_THRESHOLD))
        + count
    )
    at_rest = starts[start.speed[starts] <= _MAX_SIGMAS * _VELOCITY_SIGMA]
    if len(at_rest):
        return float(start.t[at_rest[0]]), ""
    if not len(starts):
        return None, ""
    moving = start.speed[starts[0]]
    return None, f" (at {start.t[starts[0]]:.1f} s it seems so, at a speed of {moving:.2g} m/s)"
