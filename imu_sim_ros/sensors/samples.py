# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The samples of a sensor: one form for all sensors."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from imu_sim_ros.core.records import TimeSeries, concatenate
from imu_sim_ros.core.types import Integers, Times, shapes

Rows: TypeAlias = "slice | Integers"
"""Selection of some of n samples."""


_FEW_ROWS: Final = tuple(np.arange(count) for count in range(17))
for _rows_of_few in _FEW_ROWS:
    _rows_of_few.flags.writeable = False


def all_rows(count: int) -> Integers:
    """Return the rows 0 .. count - 1 of samples; always the same array for a few of them."""
    return _FEW_ROWS[count] if count < len(_FEW_ROWS) else np.arange(count)


class Samples(NamedTuple):
    """Output of one sensor in a window of time, and the truth of it: n consecutive samples.

    All arrays but ``delivered`` have n rows. ``samples.NAME`` is ``samples.values["NAME"]``. Those
    of an IMU, for each of its triads (``gyro_...`` in rad/s, ``accel_...`` in m/s^2, all (n, 3)):

    ``gyro``, ``accel``
        the readings: the digital output (rounding and saturation) of the sum ``ideal +
        response_error + bias + noise + low_pass + vibration``.
    ``ideal_gyro``, ``ideal_accel``
        angular rate and specific force at the IMU in its own frame, without any error.
    ``gyro_bias``, ``accel_bias``
        sum of all bias terms.
    ``gyro_scale``, ``accel_scale``
        scale factor from turn-on, temperature and age; 1 without error.
    ``gyro_noise``, ``accel_noise``
        white noise, before the low-pass.
    ``gyro_response_error``, ``accel_response_error``
        what scale factors, misalignment, non-linearity and g-sensitivity add:
        ``scale * (S x + q x^2 + G f + H f^2) - x``, with x the ideal reading; no G and H in the
        accelerometer.
    ``gyro_low_pass``, ``accel_low_pass``
        what the low-pass adds: its output minus its input.
    ``gyro_vibration``, ``accel_vibration``
        vibration of the vehicle, ``imu.vibration``.
    ``temperature``
        (n,) of the sensor [degC].
    ``motion``
        the body's :class:`~imu_sim_ros.trajectory.motion.Motion` at ``true_t_ns``.
    """

    true_t_ns: Times
    """(n,) true times of the samples [ns]."""
    t_ns: Times
    """(n,) the stamps of the messages, with the errors of the sensor's clock [ns]."""
    release_t_ns: Times
    """(n,) when a message leaves the driver: true time and transport latency [ns]."""
    delivered: Integers
    """(m,) rows that are delivered, in order: dropped ones are missing, duplicates occur twice."""
    values: Mapping[str, Any]
    """Readings and their truth by name, arrays (n, ...) or a tuple of such arrays."""
    first: int = 0
    """Index of the first sample."""
    span_ns: int = 0
    """Time from the true time of a sample until it is complete [ns]."""

    def __getattr__(self, name: str) -> Any:
        """Return one of the values."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(f"no {name} was measured") from None

    def at(self, begin: int, end: int) -> "Samples":
        """Return the samples ``begin .. end - 1``."""
        rows = slice(begin, end)
        sent = self.delivered[(self.delivered >= begin) & (self.delivered < end)] - begin
        return self._replace(
            true_t_ns=self.true_t_ns[rows],
            t_ns=self.t_ns[rows],
            release_t_ns=self.release_t_ns[rows],
            delivered=sent,
            values={name: _rows(column, rows) for name, column in self.values.items()},
            first=self.first + begin,
        )

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *self.values})

    def __repr__(self) -> str:
        return shapes(self, getattr(self.values, "made", self.values))


def join_samples(parts: Sequence[Samples]) -> Samples:
    """Return consecutive samples, of one part at least, as one."""
    if len(parts) == 1:
        return parts[0]
    shifts = np.cumsum([0, *(len(part.true_t_ns) for part in parts[:-1])])
    return parts[0]._replace(
        true_t_ns=np.concatenate([part.true_t_ns for part in parts]),
        t_ns=np.concatenate([part.t_ns for part in parts]),
        release_t_ns=np.concatenate([part.release_t_ns for part in parts]),
        delivered=np.concatenate(
            [part.delivered + shift for part, shift in zip(parts, shifts, strict=True)]
        ),
        values={name: _join([part.values[name] for part in parts]) for name in parts[0].values},
    )


def _rows(values: Any, rows: slice) -> Any:
    """Return rows of an array, of a tuple of arrays, or of a record."""
    if isinstance(values, TimeSeries):
        return values.rows(rows)
    if isinstance(values, tuple):
        return type(values)(*(column[rows] for column in values))
    return values[rows]


def _join(parts: Sequence[Any]) -> Any:
    """Return arrays, tuples of arrays, or records, one behind the other."""
    if isinstance(parts[0], TimeSeries):
        return concatenate(parts)
    if isinstance(parts[0], tuple):
        return type(parts[0])(*map(_join, zip(*parts, strict=True)))
    if all(part.strides[0] == 0 for part in parts):  # an error that the sensor does not have
        return np.broadcast_to(parts[0][:1], (sum(map(len, parts)), *parts[0].shape[1:]))
    return np.concatenate(parts)
