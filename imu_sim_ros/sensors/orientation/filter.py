# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orientation of a board's filter: a complementary filter over its own readings.

The gyroscope alone gives the attitude q_gi in a frame g that turns only by the gyroscope's errors.
In that frame, gravity and the magnetic field are slow vectors; a low-pass removes motion and noise
from them, and their directions give g in the world. (The alignment in an inertial frame, P. M. G.
Silson, "Coarse Alignment of a Ship's Strapdown Inertial Attitude Reference System Using Velocity
Loci", IEEE Trans. Instrum. Meas. 60 (2011) 1930.)

With the low-pass ``H = (2 tau s + 1) / (tau s + 1)^2``, whose error for a vector that moves
steadily is 0, the tilt of a body that hardly turns is for small errors that of the filter with
proportional and integral gain of R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear Complementary
Filters on the Special Orthogonal Group", IEEE Trans. Autom. Control 53 (2008) 1203, with
``k_P = 2 / tau`` and ``k_I = 1 / tau^2``. Unlike that recurrence it is computed in blocks; samples
are the same, bit for bit, whatever their size.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array

Indices = NDArray[np.int64]

_CHUNK: Final = 256
"""Number of quaternions in a chunk of the scan."""


class RunningProduct:
    """Products ``q_0, q_0 q_1, ...`` of quaternions, scanned in chunks at fixed indices.

    Within a chunk the scan doubles: an entry depends on earlier entries alone, in a fixed order.
    """

    def __init__(self) -> None:
        self._last_product = rotation.IDENTITY
        self._waiting = np.empty((0, 4))

    def next(self, factors: Array) -> Array:
        """Return the products (n, 4) up to each of the next factors (n, 4)."""
        previous_count = len(self._waiting)
        all_factors = np.concatenate([self._waiting, factors])
        count = len(all_factors)
        self._waiting = np.copy(all_factors[count // _CHUNK * _CHUNK :])
        chunks = ceil_divide(count, _CHUNK)
        width = _CHUNK
        if chunks == 1:  # short blocks do not fill a chunk, and later entries are not needed
            width = count
        products: Array = np.empty((chunks * width, 4), order="F")
        products[:count], products[count:] = all_factors, rotation.IDENTITY
        products = products.reshape(chunks, width, 4)
        step = 1
        while step < width:
            products[:, step:] = rotation.multiply(products[:, :-step], products[:, step:])
            step *= 2
        for k in range(chunks):
            products[k] = rotation.multiply(self._last_product, products[k])
            if (k + 1) * _CHUNK <= count:
                self._last_product = rotation.normalise(products[k, -1])
        return products.reshape(-1, 4)[previous_count:count]


class SteadyLowPass:
    """``2 F - F F`` with a first-order low-pass F, on each column (n, 3).

    During the first time constant the output is the mean of all values so far; F continues from it.
    """

    def __init__(self, time_constant: float, dt: float) -> None:
        from scipy import signal  # imported only for filters, since it takes long

        self._filter = signal.lfilter
        self._phi = math.exp(-dt / time_constant)
        self._settling = max(round(time_constant / dt), 1)
        self._count = 0
        self._sum = np.zeros((1, 3))
        self._states = [self._sum, self._sum]

    def next(self, values: Array) -> Array:
        """Return the next n filtered values (n, 3)."""
        settling_rows = min(max(self._settling - self._count, 0), len(values))
        return np.concatenate(
            [self._mean(values[:settling_rows]), self._low(values[settling_rows:])]
        )

    def _mean(self, values: Array) -> Array:
        """Return the mean of all values so far, at each of them."""
        if len(values) == 0:
            return values
        # Added one by one, so that the sums do not depend on the block's size.
        sums = np.cumsum(np.concatenate([self._sum, values]), axis=0)[1:]
        counts = np.arange(self._count + 1, self._count + 1 + len(values))
        means: Array = sums / counts[:, None]
        self._sum, self._count = sums[-1:].copy(), self._count + len(values)
        self._states = [self._phi * means[-1:]] * 2
        return means

    def _low(self, values: Array) -> Array:
        """Return values (n, k) after two equal low-passes, with no lag behind a ramp."""
        if len(values) == 0:
            return values
        b, a = [1.0 - self._phi], [1.0, -self._phi]
        once, self._states[0] = self._filter(b, a, values, axis=0, zi=self._states[0])
        twice, self._states[1] = self._filter(b, a, once, axis=0, zi=self._states[1])
        return 2.0 * once - twice


class OrientationFilter:
    """Filter of readings to orientations in the world."""

    def __init__(self, time_constant: float, dt: float, magnetic_dt: float, field_w: Array) -> None:
        """Start without a known orientation.

        :param dt: time between two readings of gyroscope and accelerometer [s].
        :param magnetic_dt: time between two readings of the magnetic field [s].
        :param field_w: (3,) Earth's field, ENU, for true north from magnetic north [T].
        """
        self._dt = dt
        self._product = RunningProduct()
        self._up = SteadyLowPass(time_constant, dt)
        self._north = SteadyLowPass(time_constant, magnetic_dt)
        self._last_rate: Array | None = None
        self._last_q = rotation.IDENTITY[None]
        self._field = np.array([[1.0, 0.0, 0.0]])
        horizontal = math.hypot(field_w[0], field_w[1]) or 1.0
        self._declination = (field_w[0] / horizontal, field_w[1] / horizontal)

    def next(
        self,
        gyro: Array,
        accel: Array,
        field: Array,
        behind: Indices,
        delay: Array,
        available_from: Indices,
    ) -> Array:
        """Return the orientations q_wi (n, 4) at the next n readings.

        Until the first reading of the magnetic field the heading is arbitrary.

        :param gyro: (n, 3) readings [rad/s].
        :param accel: (n, 3) readings [m/s^2].
        :param field: (m, 3) field measured by the board [T].
        :param behind: (m,) index of the reading before each field; -1: that before the block.
        :param delay: (m,) delay of each field behind that reading [s].
        :param available_from: (m,) index of the first reading at which each field is available; n:
            later.
        """
        previous_rate = gyro[:1] if self._last_rate is None else self._last_rate
        rates = np.concatenate([previous_rate, gyro])
        mean = 0.5 * (rates[:-1] + gyro)
        if self._last_rate is None:
            mean[:1] = 0.0
        q_gi = self._product.next(rotation.exp(mean * self._dt))
        attitudes = np.concatenate([self._last_q, q_gi])
        self._last_rate, self._last_q = rates[-1:], attitudes[-1:]
        up = _unit(self._up.next(rotation.rotate(q_gi, accel)))
        turned = rotation.exp(rates[behind + 1] * delay[:, None])
        q_gm = rotation.multiply(attitudes[behind + 1], turned)
        filtered_field = self._north.next(rotation.rotate(q_gm, field))
        latest = np.searchsorted(available_from, np.arange(len(gyro)), side="right")
        fields = np.concatenate([self._field, filtered_field])
        self._field = fields[-1:].copy()
        return rotation.multiply(self._in_world(up, fields[latest]), q_gi)

    def _in_world(self, up: Array, field: Array) -> Array:
        """Return q_wg (n, 4) from the directions of up and of the field in g."""
        x, y, z = (up * field).T
        north = _unit(field - up * (x + y + z)[:, None])
        east = rotation.cross(north, up)
        sine, cosine = self._declination
        r_wg = np.stack([cosine * east + sine * north, cosine * north - sine * east, up], axis=1)
        return rotation.from_matrix(r_wg)


def _unit(v: Array) -> Array:
    """Return directions (n, 3); z for zero vectors."""
    x, y, z = v.T
    length = np.sqrt(x * x + y * y + z * z)
    nothing = length == 0.0
    directions: Array = v / np.where(nothing, 1.0, length)[:, None]
    directions[nothing, 2] = 1.0
    return directions
