# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that comes from Python: an object with ``sample(t)``, or a function of time."""

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.arguments import number, refuse
from imu_sim_ros.errors import ConfigurationError, ImuSimError
from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.gate import Quantity
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.types import Array

STEP: Final = 2.0**-9
"""[s] Between the nine poses from which the derivatives of a function are worked out."""
_NODES: Final = np.arange(-4.0, 5.0)
_FASTEST: Final = 3.0 / (8.0 * STEP)
"""[rad/s] At which eight steps turn by less than pi, from where on the turn is ambiguous."""
_ACCELERATION: Final = Quantity("acceleration", 1e7, "m/s^2")
_ANGULAR_ACCELERATION: Final = Quantity("angular acceleration", 1e10, "rad/s^2")
_OF_MOTION: Final = (
    gate.POSITION,
    gate.VELOCITY,
    _ACCELERATION,
    gate.ORIENTATION,
    gate.RATE,
    _ANGULAR_ACCELERATION,
)
_OF_POSES: Final = (gate.POSITION, gate.ORIENTATION)


def given_trajectory(given: Any) -> Trajectory | None:
    """Return what somebody gives as a motion in a form that is checked whenever it is sampled.

    :param given: an object with ``sample(t)``, which returns a :class:`Motion`, or a function that
        returns positions and attitudes at times t (n,); either may have a ``duration`` [s].
    :returns: None for anything else.
    :raises ConfigurationError: for a duration that is none.
    """
    if isinstance(given, type):
        return None
    if callable(getattr(given, "sample", None)):
        return CheckedMotion(given.sample, *_limits(given))
    return Differentiated(given, *_limits(given)) if callable(given) else None


def _limits(given: Any) -> tuple[float, float]:
    """Return duration [s] and highest frequency [Hz]."""
    duration = _called(lambda: getattr(given, "duration", math.inf), "trajectory.duration")
    highest = _called(lambda: getattr(given, "highest_frequency", 0.0), "highest_frequency")
    allowed = "seconds, more than 0; omitted or infinite if the motion has no end"
    return (
        number("trajectory.duration", duration, allowed, 0.0, math.inf, above=True),
        number("trajectory.highest_frequency", highest, "Hz, from 0 to 1e6", 0.0, 1e6),
    )


class CheckedMotion:
    """An object's own motion; what it returns is checked."""

    def __init__(
        self, sample: Callable[[Array], Any], duration: float, highest_frequency: float
    ) -> None:
        self._sample = sample
        self.duration = duration
        self.highest_frequency = highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s].

        :raises ConfigurationError: for what is no motion, and whatever the object raises.
        """
        found = _called(lambda: self._sample(t), "trajectory.sample(t)")
        return Motion(*_checked(found, _OF_MOTION, t, "trajectory.sample(t)", "a Motion: "))


class Differentiated:
    """A function's poses with derivatives from nine of them around each time.

    Position and rotation vector from the attitude at t are followed by the polynomials of degree 8
    through the poses at t - 4 h ... t + 4 h (Fornberg, Math. Comp. 51, 1988): order 8 in h for
    velocity, acceleration, angular rate and acceleration. At the ends the nine poses are the first
    or the last ones, and the order is 8 and 7.
    """

    def __init__(
        self, poses: Callable[[Array], Any], duration: float, highest_frequency: float
    ) -> None:
        if duration < 8.0 * STEP:
            raise ConfigurationError(
                f"trajectory.duration = {duration:g}: must be at least {8.0 * STEP:g} s"
            )
        self._poses = poses
        self.duration = duration
        self.highest_frequency = highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s].

        :raises ConfigurationError: for what are no poses, and whatever the function raises.
        """
        middle = np.clip(t, 4.0 * STEP, self.duration - 4.0 * STEP)
        times = np.concatenate([t[None], middle + STEP * _NODES[:, None]])
        found = _called(lambda: self._poses(times.ravel()), "trajectory(t)")
        position, q_wb = _checked(found, _OF_POSES, times.ravel(), "trajectory(t)", "")
        p = position.reshape(10, -1, 3)
        q = rotation.normalise(q_wb).reshape(10, -1, 4)
        step = rotation.log(rotation.multiply(rotation.conjugate(q[1:-1]), q[2:]))
        fastest = np.linalg.norm(step, axis=-1).max(initial=0.0) / STEP
        if fastest > _FASTEST:
            raise ConfigurationError(
                f"trajectory(t): turns at {fastest:.4g} rad/s; a function may turn at {_FASTEST:g} "
                "rad/s: give an object with sample(t)"
            )
        turn = rotation.log(rotation.multiply(rotation.conjugate(q[0]), q[1:]))
        first, second = _weights((t - middle) / STEP)
        return Motion(
            p[0],
            np.einsum("kn,kni->ni", first, p[1:] - p[0]),
            np.einsum("kn,kni->ni", second, p[1:] - p[0]),
            q[0],
            # The turn is 0 at t itself, so that its right Jacobian is the identity there, and the
            # Jacobian's derivative falls out of the angular acceleration: phi' x phi' = 0.
            np.einsum("kn,kni->ni", first, turn),
            np.einsum("kn,kni->ni", second, turn),
        )


_INVERSE: Final = np.linalg.inv(np.vander(_NODES, increasing=True))
"""(9, 9) coefficients of the polynomial through values at the nodes."""


def _weights(s: Array) -> tuple[Array, Array]:
    """Return the weights (9, n) of nine values in the first and second derivative [1/s, 1/s^2].

    :param s: (n,) where the derivative is taken, in steps from the middle.
    """
    powers = s[None] ** np.arange(9)[:, None]
    k = np.arange(1, 9)[:, None]
    first = _INVERSE[1:].T @ (k * powers[:-1]) / STEP
    second = _INVERSE[2:].T @ (k[1:] * k[:-1] * powers[:-2]) / STEP**2
    return first, second


def _called(function: Callable[[], Any], name: str) -> Any:
    """Return what code of a user's returns.

    :raises ConfigurationError: for whatever it raises, with the line where.
    """
    try:
        return function()
    except ImuSimError:
        raise
    except Exception as error:
        import traceback

        where = traceback.extract_tb(error.__traceback__)[-1]
        raise ConfigurationError(
            f"{name}: raised {type(error).__name__}: {error} (line {where.lineno} of "
            f"{where.filename})"
        ) from error


def _checked(
    found: Any, quantities: tuple[Quantity, ...], t: Array, name: str, kind: str
) -> list[Array]:
    """Return arrays that are what they must be at each of the times.

    :raises ConfigurationError: for another number of them, other shapes, and values that no body
        has, with the time of the first one.
    """
    widths = [4 if quantity is gate.ORIENTATION else 3 for quantity in quantities]
    words = ", ".join(f"{q.name} (n, {w})" for q, w in zip(quantities, widths, strict=True))
    allowed = f"{kind}{words}, for the {len(t)} times"
    if not isinstance(found, tuple | list) or len(found) != len(quantities):
        refuse(name, found, allowed, wrong_type=True)
    arrays = []
    for quantity, width, values in zip(quantities, widths, found, strict=True):
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            refuse(f"{name}: {quantity.name}", values, allowed, wrong_type=True)
        if array.shape != (len(t), width):
            raise ConfigurationError(
                f"{name}: {quantity.name} of the shape {array.shape}: must be {allowed}"
            )
        arrays.append(array)
    verdict = gate.Verdict(None, list(zip(quantities, arrays, strict=True)))
    for row in verdict.bad[:1]:
        raise ConfigurationError(f"{name}: at t = {t[row]:g} s {verdict.why(int(row))}")
    return arrays
