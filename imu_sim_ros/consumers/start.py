# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether stacks can initialise from the start of a simulated flight, by their own thresholds."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.consumers.values import ImuValues

Array = NDArray[np.float64]

REST_THRESHOLD: Final = 0.5
"""``init_imu_thresh`` of the estimator_config.yaml that is written [m/s^2]."""
_WINDOW: Final = 1.0
"""Half of its ``init_window_time`` [s]."""
_STATIC: Final = "ov_init/src/static/StaticInitializer.cpp"
_VELOCITY_SIGMA: Final = 0.01
"""Of the velocity 0 that it starts with [m/s]."""
_TILT_SIGMA: Final = 0.02
"""Of the attitude that it takes from gravity [rad]."""
_MANY: Final = 2.0
"""Standard deviations beyond which a start is called bad."""
_GRAVITY: Final = {"VINS-Mono": 1.0, "VINS-Fusion": 0.5}
"""How far the magnitude of gravity may be off, initial_aligment.cpp [m/s^2]."""


class Start(NamedTuple):
    """The true motion of an IMU at the start of a flight, at n times."""

    t: Array
    """(n,) after the start, evenly spaced [s]."""
    accel: Array
    """(n, 3) specific force, without errors [m/s^2]."""
    speed: Array
    """(n,) [m/s]."""


def start_warnings(values: ImuValues, start: Start) -> Iterator[str]:
    """Yield a line for each stack that will initialise badly, with its threshold and the source."""
    yield from _openvins(values, start)
    bias = values.axes("accelerometer_bias")
    size = float(np.linalg.norm(bias))
    for stack, limit in _GRAVITY.items():
        if size > limit:
            yield (
                f"{stack}: the accelerometer's bias of this run, {size:.2f} m/s^2, can put gravity "
                f"further off than the {limit:g} m/s^2 at which it rejects an initialisation with "
                "one camera (initial_aligment.cpp, LinearAlignment)"
            )


def _openvins(values: ImuValues, start: Start) -> Iterator[str]:
    rest, speed = _rest(values, start)
    if rest is None:
        yield (
            f"OpenVINS: starts late or wrongly: in the first {start.t[-1]:.0f} s there is no rest "
            f"of {_WINDOW:g} s (accelerometer's deviation below {REST_THRESHOLD:g} m/s^2, "
            f"init_imu_thresh, and velocity 0 +- {_VELOCITY_SIGMA:g} m/s, {_STATIC}) with a jerk "
            f"after it{speed}; trajectory.lead_in.rest=2 begins with both"
        )
        return
    force = start.accel[np.searchsorted(start.t, rest)]
    across = np.cross(values.axes("accelerometer_bias"), force / np.linalg.norm(force))
    tilt = float(np.linalg.norm(across)) / values.gravity
    if tilt > _MANY * _TILT_SIGMA:
        yield (
            "OpenVINS: the accelerometer's bias of this run tilts its first attitude by "
            f"{tilt:.3f} rad; it takes that to be within +- {_TILT_SIGMA:g} rad ({_STATIC})"
        )


def _rest(values: ImuValues, start: Start) -> tuple[float | None, str]:
    """Return the end of a rest before a jerk [s]; None: why the accelerometer alone would err."""
    count = round(_WINDOW / (start.t[1] - start.t[0]))
    if len(start.t) < 2 * count:
        return None, ""
    white = values.axes("accelerometer_noise_density") ** 2 * values.rate
    windows = np.lib.stride_tricks.sliding_window_view(start.accel, count, axis=0)
    deviation = np.sqrt(windows.var(axis=2).sum(axis=1) + white.sum())
    before, after = deviation[:-count], deviation[count:]
    found = np.flatnonzero((before <= REST_THRESHOLD) & (after >= REST_THRESHOLD)) + count
    still = found[start.speed[found] <= _MANY * _VELOCITY_SIGMA]
    if len(still):
        return float(start.t[still[0]]), ""
    if not len(found):
        return None, ""
    moving = start.speed[found[0]]
    return None, f" (at {start.t[found[0]]:.1f} s it seems so, at a speed of {moving:.2g} m/s)"
