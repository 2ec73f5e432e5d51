# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error chain of one triad, from the ideal reading to the digital output.

Scale, misalignment and what else responds to the input, what is added to it, low-pass, range,
resolution.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import components
from imu_sim_ros.core.components import clip, combine, components_of, quantise, rint
from imu_sim_ros.core.random_streams import Seed, Units
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.sensors.errors.terms import (
    BIAS,
    DRIFT_OF_SCALE,
    Surroundings,
    TriadEffect,
    TurnOnScale,
    WhiteNoise,
    is_set,
)
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters

_Kind = TypeVar("_Kind", bound=TriadEffect)


class Response:
    """The response of a triad to its input x: ``S x + q x^2 + G f + H f^2`` (lecture eq. 7 and 25).

    G, the g-sensitivity, and H, that to the square of each axis, are the gyroscope's only; f is the
    ideal specific force.
    """

    def __init__(self, parameters: TriadParameters) -> None:
        """Store the coefficients; those of a batch are (count, ...)."""
        response = parameters.response()
        self._s = _matrix(response)
        quadratic = np.asarray(parameters.quadratic)
        self._quadratic = _entries(quadratic) if quadratic.any() else None
        self._g, self._h = (
            _matrix(np.reshape(values, (*np.shape(values)[:-1], 3, 3))) if is_set(values) else None
            for values in (parameters.g_sensitivity, parameters.g_squared_sensitivity)
        )
        linear = self._quadratic is None and self._g is None and self._h is None
        self.is_perfect = linear and bool((response == np.eye(3)).all())
        """True if the response returns its input."""

    def apply(
        self, ideal: components.AnyVector, force: components.AnyVector
    ) -> components.AnyVector:
        """Return the response to inputs of the triad and specific forces [m/s^2]."""
        if self.is_perfect:
            return ideal
        x, y, z = components.transform(self._s, ideal)
        if self._quadratic is not None:
            (qx, qy, qz), (u, v, w) = self._quadratic, ideal
            x, y, z = x + qx * u * u, y + qy * v * v, z + qz * w * w
        if self._g is not None:
            u, v, w = components.transform(self._g, force)
            x, y, z = x + u, y + v, z + w
        if self._h is not None:
            u, v, w = force
            u, v, w = components.transform(self._h, (u * u, v * v, w * w))
            x, y, z = x + u, y + v, z + w
        return x, y, z


def _entries(values: Array) -> components.AnyVector:
    """Return parameters (..., 3) by axis: numbers of one unit, contiguous arrays of a batch."""
    if values.ndim == 1:
        x, y, z = values.tolist()
        return x, y, z
    x, y, z = (np.ascontiguousarray(values[..., k]) for k in range(3))
    return x, y, z


def _matrix(values: Array) -> components.Matrix[Any]:
    """Return the entries of a matrix (..., 3, 3), each as :func:`_entries` has it."""
    x, y, z = (_entries(values[..., k, :]) for k in range(3))
    return (*x, *y, *z)


@dataclass
class _Group:
    """Axes with the same cut-off, filtered together."""

    axes: NDArray[np.intp]
    """Indices of the axes."""
    sections: Array
    """Second-order sections of the filter, as of scipy.signal."""
    settled: Array
    """(sections, 2) state of one axis whose input has always been 1."""
    state: Array | None = None
    """(sections, 2, ..., axes) states of the filters."""

    @property
    def columns(self) -> slice | NDArray[np.intp]:
        """The axes, as a slice if they are neighbours: they are then filtered in place."""
        first_axis, last_axis = int(self.axes[0]), int(self.axes[-1])
        neighbours = last_axis - first_axis + 1 == len(self.axes)
        return slice(first_axis, last_axis + 1) if neighbours else self.axes

    def settled_on(self, values: Array) -> Array:
        """Return the state of filters whose input has always been values (..., axes)."""
        state: Array = self.settled.reshape(*self.settled.shape, *(1,) * values.ndim) * values
        return state


class LowPass:
    """A Butterworth low-pass on each axis that has a cut-off.

    The bilinear transform with the cut-off matched: -3 dB exactly at the cut-off. The filter starts
    settled on the first sample.
    """

    def __init__(self, cutoffs: Array, order: int, rate: float, shape: tuple[int, ...]) -> None:
        """Set up the filters.

        :param cutoffs: (3,) cut-offs below half the rate [Hz], the same for all units; 0: none.
        :param rate: rate of the values that are filtered [Hz].
        :param shape: () or the (count,) of a batch.
        """
        from scipy import signal  # half a second of import that only a low-pass costs

        self._filter = signal.sosfilt
        self._fresh = np.zeros(shape, np.bool_)
        self._groups: list[_Group] = []
        for cutoff in np.unique(cutoffs[cutoffs > 0.0]):
            sections = signal.butter(order, cutoff, fs=rate, output="sos")
            axes = np.flatnonzero(cutoffs == cutoff)
            self._groups.append(_Group(axes, sections, signal.sosfilt_zi(sections)))

    def begin(self, units: Units) -> None:
        """Restart the filters of some units of a batch with their next samples."""
        self._fresh[units] = True

    def apply(self, values: Array) -> Array:
        """Filter the next n samples (n, ..., 3) in place; return filtered minus unfiltered."""
        unfiltered = np.copy(values)
        if len(values) == 0:
            return unfiltered
        for group in self._groups:
            x = values[..., group.columns]
            if group.state is None:
                group.state = group.settled_on(x[0])
            elif self._fresh.any():
                group.state[:, :, self._fresh] = group.settled_on(x[0, self._fresh])
            values[..., group.columns], group.state = self._filter(
                group.sections, x, axis=0, zi=group.state
            )
        self._fresh[...] = False
        return np.subtract(values, unfiltered, out=unfiltered)


_WHOLE: Final = 1.0 + 1e-6
"""A range this close to whole steps counts as whole steps: files round their numbers."""


class _Digits(NamedTuple):
    """Steps and range of an axis, of one unit or of the units of a batch."""

    rounded: bool | Mask
    """True if the output has digital steps; a mask where the units of a batch differ."""
    step: Any
    """1 where there are none."""
    limited: bool
    minimum: Any
    """Last step within the range, or the range itself where there are no steps."""
    maximum: Any

    def digital(self, x: Any) -> Any:
        """Return values after rounding and saturation."""
        rounded, step, limited, minimum, maximum = self
        if rounded is False:
            return clip(x, minimum, maximum) if limited else x
        if rounded is True:
            return quantise(x, step, minimum, maximum)
        x = x / step
        x = np.where(rounded, rint(x), x)
        return (clip(x, minimum, maximum) if limited else x) * step


class Digitiser:
    """Rounding to whole steps, and saturation: at the last whole step within the range."""

    def __init__(self, parameters: TriadParameters) -> None:
        """Store range and resolution, (..., 3); 0 is none."""
        limits, steps = np.asarray(parameters.range), np.asarray(parameters.resolution)
        rounded = steps > 0.0
        steps = np.where(rounded, steps, 1.0)
        maximum = np.where(rounded, np.floor(limits / steps * _WHOLE), limits)
        maximum = np.where(limits > 0.0, maximum, np.inf)
        self._is_perfect = not (rounded.any() or limits.any())
        self._axes = [
            _Digits(
                rounded=_shared_value(rounded[..., k]),
                step=step,
                limited=bool(limits[..., k].any()),
                minimum=low,
                maximum=high,
            )
            for k, (step, low, high) in enumerate(
                zip(_entries(steps), _entries(-maximum), _entries(maximum), strict=True)
            )
        ]

    def apply(self, values: components.AnyVector) -> components.AnyVector:
        """Return values saturated and rounded."""
        if self._is_perfect:
            return values
        (x, y, z), (of_x, of_y, of_z) = values, self._axes
        return of_x.digital(x), of_y.digital(y), of_z.digital(z)


def _shared_value(rounded: Mask) -> bool | Mask:
    """Return the value that all units share, if they do."""
    alike = rounded.all() or not rounded.any()
    return bool(rounded.any()) if alike else rounded


class IncrementRounding(TriadEffect):
    """Delta angles or velocities in whole steps, as a counter of pulses gives them.

    The sum of all increments is rounded, and an increment is the difference of two rounded sums:
    the remainder of the rounding is carried over, so that angles do not drift. That is the
    quantisation noise of IEEE Std 952-1997, C.1.5, with ``Q = step / sqrt(12)``.
    """

    parameter = "increment_resolution"

    def configure(self, parameters: TriadParameters) -> None:
        """Set the steps (..., 3); 0 is none. The sum of an axis with another step begins at 0."""
        previous = self.strength
        super().configure(parameters)
        self.state[np.broadcast_to(self.strength != previous, self.state.shape)] = 0.0

    def apply(self, values: Array) -> None:
        """Round the increments of mean readings (n, ..., 3) in place."""
        counted = self.strength > 0.0
        step = np.where(counted, self.strength, 1.0)
        sums = np.empty((len(values) + 1, *values.shape[1:]))
        sums[0] = self.state
        np.multiply(values, self.dt / step, out=sums[1:])
        np.cumsum(sums, axis=0, out=sums)  # adds one after the other, whatever the block's size
        self.state = np.where(counted, sums[-1], 0.0)
        rounded = np.diff(np.rint(sums), axis=0) * (step / self.dt)
        values[...] = np.where(counted, rounded, values)


class Reading(NamedTuple):
    """Readings of a triad and their errors in the order of conventions.ERRORS, all (n, ..., 3).

    All but the scale are in the unit of the triad.
    """

    reading: Array
    """Digital output."""
    bias: Array
    """Sum of all biases."""
    scale: Array
    """Factors by which the response is multiplied."""
    noise: Array
    """White noise."""
    response_error: Array
    """Response to the ideal reading, with the scale, minus the ideal reading."""
    low_pass: Array
    """Change of the reading by the low-pass."""
    vibration: Array
    """Vibration that is added to the filtered reading."""


NumberAdditions: TypeAlias = tuple[
    components.AnyVector | None, components.AnyVector, components.AnyVector | None
]
"""Scale, bias and noise of one reading: :class:`Additions` of one."""


class Additions(NamedTuple):
    """Additive errors of n readings of a triad that do not depend on the readings."""

    scale: Array | None
    """(n, ..., 3) scale factors; None: 1."""
    bias: Array
    """(n, ..., 3) biases without faults."""
    noise: Array | None
    """(n, ..., 3) white noise; None: none."""

    def at(self, rows: slice) -> "Additions":
        """Return some consecutive ones."""
        scale = None if self.scale is None else self.scale[rows]
        noise = None if self.noise is None else self.noise[rows]
        return Additions(scale, self.bias[rows], noise)

    def followed_by(self, following: "Additions") -> "Additions":
        """Return these and those of the next readings of the same triad."""
        scale, bias, noise = (
            None if values is None or next_values is None else np.concatenate([values, next_values])
            for values, next_values in zip(self, following, strict=True)
        )
        assert bias is not None
        return Additions(scale, bias, noise)

    def numbers(self) -> "list[NumberAdditions]":
        """Return those of each reading of one unit, by component."""
        scale, noise = (
            itertools.repeat(None) if values is None else values.tolist()
            for values in (self.scale, self.noise)
        )
        return list(zip(scale, self.bias.tolist(), noise, strict=False))


class Triad:
    """One triad; see the package's docstring for the order of the errors."""

    def __init__(
        self, name: str, imu: ImuParameters, seed: Seed, rate: float, ratio: int = 1
    ) -> None:
        """Start; :meth:`configure` gives the errors their strength.

        :param seed: seed of a batch, an array that changes before units :meth:`begin` again.
        :param rate: samples per second [Hz].
        :param ratio: readings inside the sensor for each sample.
        """
        self._name, self._imu, self._seed = name, imu, seed
        self._ratio, self._rate = ratio, rate * ratio
        """Readings per second [Hz]."""
        cutoffs = np.asarray(imu.low_pass(name, rate))
        self._low_pass: LowPass | None = None
        if cutoffs.any():
            self._low_pass = LowPass(cutoffs, imu.bandwidth_order, self._rate, np.shape(seed))
        self._made: dict[type[TriadEffect], TriadEffect] = {}
        self._last: Array | components.AnyVector | None = None
        """The last reading, which a sensor that is stuck repeats."""

    def configure(self, parameters: TriadParameters) -> None:
        """Apply new values of live parameters, from the next sample on.

        :param parameters: the constants of the unit, or of the units of a batch, are drawn
            (:func:`realise_unit`).
        """
        self._parameters = parameters
        self._response, self._digitiser = Response(parameters), Digitiser(parameters)
        self._bias = [term for kind in BIAS if (term := self._active(kind))]
        self._drift = [term for kind in DRIFT_OF_SCALE if (term := self._active(kind))]
        self._turn_on_scale = self._active(TurnOnScale)
        self._white = self._active(WhiteNoise)
        self._increments = self._active(IncrementRounding)
        self.follows_force = any(term.follows_force for term in self._bias)
        """True if a bias depends on the readings and cannot be computed before them."""

    def _active(self, kind: type[_Kind]) -> _Kind | None:
        """Return an effect with the present parameters; None if it changes nothing."""
        effect = self._made.get(kind)
        if effect is not None:
            effect.configure(self._parameters)
        elif is_set(getattr(self._parameters, kind.parameter)):
            effect = kind(self._name, self._imu, self._seed, self._rate, self._parameters)
            self._made[kind] = effect
        return effect if isinstance(effect, kind) and effect.active else None

    def begin(self, units: Units, unit: TriadParameters | None) -> None:
        """Restart some units of a batch from their current seeds.

        :param unit: parameters of new units with their constants; None: the units stay the same.
        """
        if unit is not None:
            for name, value in vars(self._parameters).items():
                if isinstance(value, np.ndarray) and value.flags.writeable:
                    own_value = np.asarray(getattr(unit, name))
                    value[units] = 0.0  # powers of the temperature that these units do not have
                    value[units, : own_value.shape[-1]] = own_value
            self.configure(self._parameters)
        for effect in self._made.values():
            effect.begin(units)
        if self._low_pass is not None:
            self._low_pass.begin(units)

    def additions(self, surroundings: Surroundings, units: Units = ...) -> Additions:
        """Return the additive errors of the next n readings.

        :param units: indices of the units of a batch whose readings these are.
        """
        shape = (*surroundings.temperature_offset.shape, 3)
        scale: Array | None = None
        if self._drift or self._turn_on_scale is not None:
            run = (
                0.0
                if self._turn_on_scale is None
                else self._turn_on_scale.next(surroundings, units)
            )
            drift = sum(term.next(surroundings, units) for term in self._drift)
            scale = np.asarray(drift + (1.0 + run))
            if scale.shape != shape:  # it stands for all times, which its strides then say
                scale = np.broadcast_to(scale, shape)
        bias = np.zeros(shape, order="F")
        for term in self._bias:
            bias += term.next(surroundings, units)
        noise = None if self._white is None else self._white.next(surroundings, units)
        return Additions(scale, bias, noise)

    def read(
        self,
        start: int,
        ideal: Array,
        force: Array,
        additions: Additions,
        faults: FaultSchedule | None = None,
        vibration: Array | None = None,
    ) -> Reading:
        """Return the next n samples, after the sensor's steps in their order.

        These are response, additions, low-pass, decimation, vibration, faults, digitiser, rounding
        of increments. Arrays are (n, ..., 3) for a batch. An oversampled sensor has m = ratio
        readings inside for each sample, any other has m = 1.

        :param start: index of the first sample.
        :param ideal: (n m, 3) ideal reading of this triad, in its unit.
        :param force: (n m, 3) ideal specific force [m/s^2].
        :param additions: result of :meth:`additions` for these n m readings.
        :param faults: faults that hit the triad; None: there never are any.
        :param vibration: (n, 3) vibration of the vehicle, which is added to the filtered readings.
        """
        scale, bias, noise = additions
        started_faults = faults if faults is not None and faults.windows else None
        if started_faults is not None:
            bias = self._with_jumps(start, bias, started_faults)
        inputs = components_of(ideal)
        analogue, error = self._analogue(
            inputs,
            inputs if force is ideal else components_of(force),
            None if scale is None else components_of(scale),
            components_of(bias),
            None if noise is None else components_of(noise),
        )
        response_error = None if error is None else combine(error, ideal.shape)
        low_pass = None
        # Without any of these steps the components go to the digitiser as they are.
        if (
            self._low_pass is not None
            or self._ratio > 1
            or vibration is not None
            or started_faults is not None
        ):
            reading = combine(analogue, ideal.shape)
            if self._low_pass is not None:
                low_pass = self._low_pass.apply(reading)
            if self._ratio > 1:
                reading, bias = self._decimate(reading), self._decimate(bias)
                scale, noise, response_error, low_pass = (
                    None if values is None else self._decimate(values)
                    for values in (scale, noise, response_error, low_pass)
                )
            if vibration is not None:
                reading += vibration
            if started_faults is not None:
                started_faults.saturate(self._name, start, reading)
            analogue = components_of(reading)
        reading = combine(self._digitiser.apply(analogue), bias.shape)
        if self._increments is not None:
            self._increments.apply(reading)
        if started_faults is not None:
            previous = None if self._last is None else np.array(self._last)
            started_faults.hold(self._name, start, reading, previous)
        if faults is not None and len(reading):
            self._last = reading[-1].copy()
        return assemble_reading(
            reading, Additions(scale, bias, noise), response_error, low_pass, vibration
        )

    def _decimate(self, values: Array) -> Array:
        """Return the last of the ``ratio`` readings inside (n m, 3) of each sample (n, 3)."""
        return np.copy(values[self._ratio - 1 :: self._ratio])

    @property
    def remembers(self) -> bool:
        """True if a reading depends on earlier readings beyond its additive errors."""
        return bool(self._low_pass or self._ratio > 1 or self._increments)

    def read_numbers(
        self,
        ideal: components.AnyVector,
        force: components.AnyVector,
        additions: NumberAdditions,
    ) -> tuple[components.AnyVector, components.AnyVector | None]:
        """Return one reading and its response error, the same numbers as :meth:`read`.

        For triads without faults of which :attr:`remembers` is False.

        :param ideal: ideal reading in the triad's unit.
        :param force: specific force at the same time [m/s^2].
        :param additions: errors that are added to it.
        """
        total, error = self._analogue(ideal, force, *additions)
        self._last = reading = self._digitiser.apply(total)
        return reading, error

    def _analogue(
        self,
        ideal: components.AnyVector,
        force: components.AnyVector,
        scale: components.AnyVector | None,
        bias: components.AnyVector,
        noise: components.AnyVector | None,
    ) -> tuple[components.AnyVector, components.AnyVector | None]:
        """Return the input of the low-pass, and the response error; None: it is 0."""
        x, y, z = self._response.apply(ideal, force)
        error = None
        if scale is not None:
            u, v, w = scale
            x, y, z = x * u, y * v, z * w
        if scale is not None or not self._response.is_perfect:
            u, v, w = ideal
            error = x - u, y - v, z - w
        u, v, w = bias
        x, y, z = x + u, y + v, z + w
        if noise is not None:
            u, v, w = noise
            x, y, z = x + u, y + v, z + w
        return (x, y, z), error

    def _with_jumps(self, start: int, bias: Array, faults: FaultSchedule) -> Array:
        """Return a bias (n m, 3) with the jumps of faults."""
        if self._ratio == 1:
            jumped = np.copy(bias)
            faults.add_bias(self._name, start, jumped)
            return jumped
        jumps = np.zeros((len(bias) // self._ratio, 3))
        faults.add_bias(self._name, start, jumps)
        return bias + np.repeat(jumps, self._ratio, axis=0)


def assemble_reading(
    reading: Array,
    additions: Additions,
    response_error: Array | None,
    low_pass: Array | None = None,
    vibration: Array | None = None,
) -> Reading:
    """Return readings (n, ..., 3) with their errors, each of the same shape or None: there is none.

    :param additions: scale factors, biases and white noise.
    :param response_error: response minus ideal reading.
    :param low_pass: change of the reading by the low-pass.
    :param vibration: vibration that was added.
    """
    none = _constant(0.0, reading.shape)
    scale, bias, noise = additions
    return Reading(
        reading=reading,
        bias=bias,
        scale=_constant(1.0, reading.shape) if scale is None else scale,
        noise=none if noise is None else noise,
        response_error=none if response_error is None else response_error,
        low_pass=none if low_pass is None else low_pass,
        vibration=none if vibration is None else vibration,
    )


@lru_cache(maxsize=8)
def _constant(value: float, shape: tuple[int, ...]) -> Array:
    """Return a constant error (n, ..., 3) of a triad, a read-only view of one number."""
    return np.broadcast_to(value, shape)


def noise_gain(cutoff: float, order: int, rate: float) -> float:
    """Return the share of white-noise variance that passes a low-pass, 0 to 1.

    The mean of ``|H|^2 = 1 / (1 + u^(2 n))`` over all frequencies up to half the rate, with
    ``u = tan(pi f / rate) / tan(pi cutoff / rate)``, the bilinear transform's frequency.

    :param cutoff: cut-off below half the rate [Hz]; 0: no low-pass.
    """
    if not cutoff:
        return 1.0
    t = np.tan(np.pi * cutoff / rate)
    # In s = ln u the integrand is smooth and dies out at both ends: the trapezoid rule is exact to
    # rounding.
    s, step = np.linspace(-30.0, 30.0, 1201, retstep=True)
    u = np.exp(s)
    density = 2.0 / np.pi * t * u / ((1.0 + (t * u) ** 2) * (1.0 + u ** (2 * order)))
    return float(density.sum() * step)


def variance_discrete(imu: ImuParameters, name: str, rate: float) -> Vector:
    """Return the variance of one sample of a triad per axis, in its unit squared.

    :param name: name of the triad.
    :param rate: samples per second [Hz].
    """
    triad, internal = imu.triad(name), rate * float(imu.internal_ratio(rate))
    white = [
        d * d * internal * noise_gain(f, imu.bandwidth_order, internal)
        for d, f in zip(triad.noise_density, imu.low_pass(name, rate), strict=True)
    ]
    step, increment = np.asarray(triad.resolution), np.asarray(triad.increment_resolution)
    rounding = step * step / 12.0 + np.square(increment * rate) / 6.0
    x, y, z = (float(w + r) for w, r in zip(white, rounding, strict=True))
    return (x, y, z)
