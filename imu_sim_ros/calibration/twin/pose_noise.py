# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The noise of poses: how large it is, other draws of it, and how far motion stands above it.

Differences of eighth order contain no motion any more, only what poses scatter by. If a truth
jumps now and then, its usual noise is that of most seconds. Poses of text
are rounded, which is no white noise: if a coordinate moves by less than a step from pose to
pose, its error is constant for a while. So a step is looked for in the digits, and rounding is
drawn by rounding a smooth path that is shifted by a part of a step.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.types import Array

_POSES: Final = 9
"""Number of poses in a difference of eighth order."""
_SLOWER: Final = 2
"""Number of poses less in the lower order, to tell noise from fast motion."""
_NOISY: Final = 0.5
"""Share of the lower order's noise that the higher one must find: white noise has 1, motion 0."""
_WINDOW: Final = 1.0
"""Time over which the noise is averaged [s]."""
_NONE: Final = 1e-9
"""Scatter below which it is rounding in float64 [m], [rad]."""
_MAX_DIGITS: Final = 7
"""Number of decimal digits from which on no rounding is looked for."""
_WHOLE: Final = 1e-3
"""Largest distance of a scaled value from a whole number."""
_AS_A_RULE: Final = 0.9
"""Share of the quaternions that must be whole multiples of a step for it to be taken as theirs."""
_EXCEEDS: Final = 4.0
"""Spectral density over that of the noise from which on there is motion."""
_SEGMENTS: Final = 4
"""Number of parts of a record whose spectra are averaged."""
_NARROWEST, _WIDTH = 5, 0.3
"""Frequencies, absolute and relative, over which spectra are averaged."""


def scatter(poses: States) -> tuple[Array, Array]:
    """Return times (m,) and the scatter (m, 6) of poses at their highest frequencies.

    Divided differences of eighth order, over the factor by which they enlarge white noise: attitude
    [rad] and position [m], both in the body's axes. 0 if these differences are mostly motion.
    """
    if len(poses) < _POSES:
        return np.zeros(0), np.zeros((0, 6))
    half = _POSES // 2
    high, low = (_differences(poses, count) for count in (_POSES, _POSES - _SLOWER))
    middle = slice(half, half + len(high))
    high[:, 3:] = rotation.rotate_inverse(poses.q_wb[middle], high[:, 3:])
    for triad in (slice(0, 3), slice(3, 6)):
        if np.mean(high[:, triad] ** 2) <= _NOISY**2 * np.mean(low[:, triad] ** 2):
            high[:, triad] = 0.0
    return poses.t[middle], high


def _differences(poses: States, count: int) -> Array:
    """Return divided differences (n + 1 - count, 6) with weights whose squares sum to 1."""
    t, position, q_wb = poses.t, poses.position, poses.q_wb
    times = np.lib.stride_tricks.sliding_window_view(t, count)
    apart = (times[:, :, None] - times[:, None, :]) / (times[:, -1:, None] - times[:, :1, None])
    apart[:, np.arange(count), np.arange(count)] = 0.25
    weights = 1.0 / np.prod(4.0 * apart, axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    rows, half = len(weights), count // 2
    result = np.zeros((rows, 6))
    middle = rotation.conjugate(q_wb[half : half + rows])
    for k in range(count):
        turn = rotation.log(rotation.multiply(middle, q_wb[k : k + rows]))
        shift = position[k : k + rows] - position[half : half + rows]
        result += weights[:, k, None] * np.concatenate([turn, shift], axis=1)
    return result


class PoseNoise(NamedTuple):
    """White noise and rounding of poses."""

    white: Array
    """(6,) standard deviations of attitude [rad] and position [m] in the body's axes."""
    quaternion_step: float
    """Step of the digits of the quaternions; 0: none."""
    position_step: float
    """Step of the positions' digits [m]; 0: none."""

    @property
    def is_present(self) -> bool:
        """True if there is any noise."""
        return bool(self.white.any() or self.quaternion_step or self.position_step)

    @property
    def is_rounding(self) -> bool:
        """True if the noise is mostly rounding, of attitudes or of positions."""
        turn, shift = np.mean(self.white.reshape(2, 3) ** 2, axis=1)
        steps = (2.0 * self.quaternion_step) ** 2, self.position_step**2
        return bool(steps[0] / 12.0 > turn or steps[1] / 12.0 > shift)

    @property
    def deviation(self) -> Array:
        """(2,) standard deviations of attitude [rad] and position [m], rounding included."""
        steps = np.array([2.0 * self.quaternion_step, self.position_step])
        white = np.mean(self.white.reshape(2, 3) ** 2, axis=1)
        return np.sqrt(white + steps**2 / 12.0)

    def to_dict(self) -> dict[str, float]:
        """Return the numbers by name."""
        angle, distance = self.deviation.tolist()
        steps = {"quaternion_step": self.quaternion_step, "position_step_m": self.position_step}
        return {"attitude_rad": angle, "position_m": distance, **steps}

    def draw(self, smooth: States, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return another draw of the noise: turns (n, 3) in the body [rad], shifts (n, 3) [m].

        :param smooth: the path without its noise.
        """
        path, noise = smooth, self.white * rng.standard_normal((len(smooth), 6))
        if self.position_step or self.quaternion_step:
            offsets = rng.uniform(-0.5, 0.5, 7)
            path = replace_fields(
                smooth,
                position=smooth.position + self.position_step * offsets[:3],
                q_wb=rotation.normalise(smooth.q_wb + self.quaternion_step * offsets[3:]),
            )
        noisy = add_pose_noise(path, noise[:, :3], rotation.rotate(path.q_wb, noise[:, 3:]))
        q_wb = rotation.normalise(_round_to_step(noisy.q_wb, self.quaternion_step))
        turn = rotation.log(rotation.multiply(rotation.conjugate(path.q_wb), q_wb))
        return turn, _round_to_step(noisy.position, self.position_step) - path.position


def _round_to_step(values: Array, step: float) -> Array:
    """Return values rounded to multiples of a step; unchanged for a step of 0."""
    return step * np.rint(values / step) if step else values


def noise_of(poses: States, smooth: States) -> PoseNoise:
    """Return the noise of poses.

    :param smooth: the same poses without most of their noise.
    """
    steps = PoseNoise(np.zeros(6), _quaternion_step(poses.q_wb), _decimal_step(poses.position))
    variance = _variance(poses)
    if steps.quaternion_step or steps.position_step:
        turn, shift = steps.draw(smooth, np.random.default_rng(0))
        variance -= _variance(add_pose_noise(smooth, turn, shift))
    # What is left after rounding is known to some per cent of the whole.
    variance = np.where(variance > 0.1 * _variance(poses), variance, 0.0)
    white = np.sqrt(variance)
    return steps._replace(white=np.where(white > _NONE, white, 0.0))


def _variance(poses: States) -> Array:
    """Return the variance (6,) of the scatter: the median over seconds, which no jump raises."""
    t, high = scatter(poses)
    if not len(high):
        return np.zeros(6)
    edges = np.searchsorted(t, np.arange(t[0], t[-1], _WINDOW))
    starts = np.unique(edges)
    squares = np.add.reduceat(high**2, starts, axis=0)
    counts = np.diff(np.append(starts, len(high)))
    whole = counts > 0.5 * np.median(counts)
    return np.asarray(np.median(squares[whole] / counts[whole, None], axis=0))


def add_pose_noise(poses: States, turn: Array, shift: Array) -> States:
    """Return poses with a noise: turns (n, 3) in the body [rad], shifts (n, 3) in the world [m]."""
    q_wb = rotation.multiply(poses.q_wb, rotation.exp(turn))
    return replace_fields(poses, position=poses.position + shift, q_wb=q_wb)


def _decimal_step(values: Array) -> float:
    """Return the power of ten of which all values are multiples; 0: none down to 1e-6."""
    for digits in range(1, _MAX_DIGITS):
        scaled = values * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < _WHOLE):
            return float(10.0**-digits)
    return 0.0


def _quaternion_step(q_wb: Array) -> float:
    """Return the decimal step of quaternions (n, 4), rounded and then normalised; 0: none."""
    rows = np.arange(len(q_wb))
    largest = np.abs(q_wb[rows, np.argmax(np.abs(q_wb), axis=1)])
    for digits in range(1, _MAX_DIGITS):
        deviation = np.full(len(q_wb), np.inf)
        for step_offset in (-1.0, 0.0, 1.0):
            # Before it was normalised, the largest component was a whole number of steps.
            whole = np.rint(largest * 10.0**digits) + step_offset
            scaled = q_wb * (whole / largest)[:, None]
            deviation = np.minimum(deviation, np.abs(scaled - np.rint(scaled)).max(axis=1))
        if np.mean(deviation < _WHOLE) > _AS_A_RULE:
            return float(10.0**-digits)
    return 0.0


def highest_motion(signal: Array, noisy: Sequence[Array], rate: float) -> float:
    """Return the highest frequency [Hz] at which motion stands above the noise.

    :param signal: (n, 3 c) vectors, evenly sampled.
    :param noisy: the same signal with further draws of its noise added.
    :param rate: rate of the samples [Hz].
    """
    power = _power(signal)
    noise = np.mean([_power(noisy_signal - signal) for noisy_signal in noisy], axis=0)
    edges = [1]
    while edges[-1] < len(power):
        edges.append(edges[-1] + max(_NARROWEST, round(_WIDTH * edges[-1])))
    sums, noises = (np.add.reduceat(p, edges[:-1], axis=0) for p in (power, noise))
    sums, noises = (p.reshape(len(p), -1, 3).sum(axis=2) for p in (sums, noises))
    exceeds_noise = (sums > _EXCEEDS * noises).any(axis=1)
    if not exceeds_noise.any():
        return 0.0
    return min(edges[int(np.flatnonzero(exceeds_noise)[-1]) + 1], len(power)) * rate / _size(signal)


def _size(values: Array) -> int:
    """Return the number of samples in a part of the record that is transformed at once."""
    return len(values) // _SEGMENTS


def _power(values: Array) -> Array:
    """Return mean power spectra (m, c) of half-overlapping parts, each without its linear trend."""
    size = _size(values)
    window, total = np.hanning(size)[:, None], np.zeros((size // 2 + 1, values.shape[1]))
    line = np.column_stack([np.ones(size), np.linspace(-1.0, 1.0, size)])
    for start in range(0, len(values) - size + 1, size // 2):
        part = values[start : start + size]
        part = part - line @ np.linalg.lstsq(line, part, rcond=None)[0]
        total += np.abs(np.fft.rfft(window * part, axis=0)) ** 2
    return total


def noise_over(t: Array, noise: Array, reference: tuple[float, float], times: Array) -> Array:
    """Return the local RMS (n, 6) of a noise over its RMS in a reference interval.

    1 if the interval has fewer than two samples, or no noise.

    :param t: (m,) times [s] of the samples of the noise.
    :param noise: (m, 6) samples.
    :param reference: first and last time [s].
    :param times: (n,) times [s].
    """
    in_reference = (t >= reference[0]) & (t <= reference[1])
    if np.count_nonzero(in_reference) < 2 or len(t) < 2:
        return np.ones((len(times), noise.shape[1]))
    usual = np.mean(noise[in_reference] ** 2, axis=0)
    sums = np.concatenate([np.zeros((1, noise.shape[1])), np.cumsum(noise**2, axis=0)])
    begin = np.minimum(np.searchsorted(t, times - 0.5 * _WINDOW), len(t) - 1)
    end = np.maximum(np.searchsorted(t, times + 0.5 * _WINDOW), begin + 1)
    local = (sums[end] - sums[begin]) / (end - begin)[:, None]
    ratio = np.divide(local, usual, out=np.ones_like(local), where=usual > 0.0)
    return np.sqrt(np.where(usual > 0.0, ratio, 1.0))
