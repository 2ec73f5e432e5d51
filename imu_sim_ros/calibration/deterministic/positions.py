# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of an accelerometer at rest: in six exact positions (lecture eq. 6, 7), or in any.

An exact fixture turns each axis up and down: the force is known, and eq. 7 has twelve parameters. A
fixture that is off by a degree puts g sin(1 deg) = 0.17 m/s^2 across each axis, which eq. 7 takes
for misalignment. The norm of gravity does not see it (:mod:`.gravity_norm`).
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.gravity_norm import (
    PARAMETERS,
    NormFit,
    fit_norm,
    is_determined,
)
from imu_sim_ros.calibration.deterministic.response import (
    AxisResponse,
    Observations,
    fit_axis,
    rounding_error,
)
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers, Mask

AUTO: Final = "auto"
EXACT: Final = "exact"
NORM: Final = "norm"
FIXTURES: Final = (AUTO, EXACT, NORM)
FACES: Final = ("+x", "-x", "+y", "-y", "+z", "-z")
_ALIGNED: Final = float(np.cos(np.radians(20.0)))
"""Cosine of the largest angle between a face's axis and the measured force."""
_AT_REST: Final = 0.05
"""Largest difference from the usual gyroscope reading [rad/s]."""


_CHANCE: Final = 1e-4
"""Probability of taking an exact fixture for a tilted one."""
_TILTED: Final = 10.0
"""Variance of the rests' residuals, over that of the readings, above which it is a tilt."""
_UNTESTED: Final = "fewer than ten directions cannot show whether the fixture is tilted"
_NO_RESIDUALS: Final = "eq. 7 leaves nothing but rounding"


class SixPosition(NamedTuple):
    """The accelerometer's deterministic errors, and the gyroscope's bias at rest."""

    scale_misalignment: Array
    """(3, 3) S of ``reading = S a + b``."""
    scale_misalignment_sigma: Array
    """(3, 3) standard errors; 0 if the simple variant assumes the entry."""
    bias: Array
    """(3,) bias at the start of the record [m/s^2]."""
    bias_sigma: Array
    """(3,) standard errors [m/s^2]."""
    gyroscope_bias: Array
    """(3,) [rad/s] reading at rest, at the start (the Earth's rate is in it)."""
    gyroscope_bias_sigma: Array
    """(3,) standard errors [rad/s]."""
    positions: Steady
    """m stretches that were used."""
    faces: Integers
    """(m,) index into :data:`FACES` of the axis that points up."""
    residuals: Array
    """(m, 3) reading minus model, in standard errors of the readings."""
    """(m, 3) reading minus model, and minus the walk of the bias [m/s^2]."""
    misfit: Array
    """(m, 3) reading minus model, including the walk of the bias [m/s^2]."""
    fixture: str
    """Model of the fixture: exact or norm."""
    reason: str
    """Reason for the choice of this model, as text."""
    left_out: int
    """Number of pieces that are not at rest, or not near any face."""


def calibrate_six_position(
    steady: Steady, gravity: float, *, simple: bool = False, fixture: str = AUTO
) -> SixPosition:
    """Return bias, scale and misalignment from rests.

    :param steady: stretches of the record, in six positions or more.
    :param gravity: magnitude of gravity [m/s^2].
    :param simple: eq. 6, ``b = (up + down) / 2`` and ``S = (up - down) / 2g`` per axis, without
        misalignment; else the twelve parameters of eq. 7 by weighted least squares.
    :param fixture: ``exact``, each axis rests pointing up and down; ``norm``, rests in ten
        directions or more, whichever; ``auto``, exact unless the residuals of eq. 7 are larger than
        those of the norm by more than chance (an F-test), or a face is missing.
    :raises InputError: if a face is missing, or fewer than ten directions are given.
    """
    fitted = _select_model(steady.rows(_rest_mask(steady)), gravity, simple, fixture)
    return fitted._replace(left_out=len(steady.stretch) - len(fitted.positions.stretch))


def _select_model(steady: Steady, gravity: float, simple: bool, fixture: str) -> SixPosition:
    """Return the result of the requested model, or of the one that fits."""
    if fixture == EXACT or simple:
        return _solve_exactly(steady, gravity, "as asked for", simple=simple)
    if fixture == NORM:
        return _norm_result(fit_norm(steady, gravity), steady, "as asked for")
    if not is_determined(steady.accel):
        return _solve_exactly(steady, gravity, _UNTESTED)
    try:
        exact = _solve_exactly(steady, gravity, _NO_RESIDUALS)
    except InputError:
        norm = fit_norm(steady, gravity)
        return _norm_result(norm, steady, "not every axis rests pointing up and down")
    if not exact.scale_misalignment_sigma.any():  # a ratio of rounding to rounding says nothing
        return exact
    norm = fit_norm(steady, gravity)
    ratio, limit = _variance_ratio(exact, norm, len(steady.accel))
    text = f"eq. 7 leaves {ratio:.3g} times the variance that the norm leaves"
    if ratio <= limit:
        return exact._replace(reason=f"{text}; up to {limit:.3g} is chance")
    return _norm_result(
        norm, steady, f"{text}; more than {limit:.3g} is not chance: the fixture is tilted"
    )


def _rest_mask(steady: Steady) -> Mask:
    """Return a mask (m,), True for stretches that do not turn."""
    offset = steady.gyro - np.median(steady.gyro, axis=0)
    limit = _AT_REST + 6.0 * np.linalg.norm(steady.gyro_sigma, axis=1)
    return np.linalg.norm(offset, axis=1) < limit


def _variance_ratio(exact: SixPosition, norm: NormFit, rests: int) -> tuple[float, float]:
    """Return the ratio of the residual variances of both models, and its largest by chance.

    In standard errors of the readings; the walk of the bias is in both.
    """
    from scipy.special import fdtri  # scipy.stats has f.ppf, but takes long to import

    freedom = 3 * len(exact.faces) - 12, rests - PARAMETERS
    sigma = np.maximum(exact.positions.accel_sigma, rounding_error(exact.positions.accel))
    misfit = float(np.sum(np.square(exact.misfit / sigma)))
    ratio = (misfit / freedom[0]) / max(norm.misfit / freedom[1], 1e-12)
    return ratio, float(fdtri(*freedom, 1.0 - _CHANCE))


def _norm_result(norm: NormFit, steady: Steady, reason: str) -> SixPosition:
    """Return the result of a fit of the norm."""
    gyro = [
        fit_axis(observations(steady, norm.force, steady.gyro, steady.gyro_sigma, k))
        for k in range(3)
    ]
    residuals = steady.accel - (norm.force @ norm.scale_misalignment.T + norm.bias)
    return SixPosition(
        scale_misalignment=norm.scale_misalignment,
        scale_misalignment_sigma=norm.scale_misalignment_sigma,
        bias=norm.bias,
        bias_sigma=norm.bias_sigma,
        gyroscope_bias=np.array([axis.bias[0] for axis in gyro]),
        gyroscope_bias_sigma=np.array([axis.bias_sigma[0] for axis in gyro]),
        positions=steady,
        faces=nearest_faces(steady.accel)[0],
        residuals=residuals,
        misfit=residuals,
        fixture=NORM,
        reason=reason,
        left_out=0,
    )


def _solve_exactly(
    steady: Steady, gravity: float, reason: str, *, simple: bool = False
) -> SixPosition:
    """Return the calibration by rests in which each axis points exactly up or down.

    By eq. 7 of the lecture, twelve parameters; by eq. 6, bias and scale per axis, if ``simple``.

    :param reason: reason for this model, as the result states it.
    :raises InputError: if an axis never points up, or down.
    """
    faces, used = nearest_faces(steady.accel)
    positions, faces = steady.rows(used), faces[used]
    missing = [name for k, name in enumerate(FACES) if k not in faces]
    if missing:
        raise InputError(
            f"{6 - len(missing)} of 6 positions found; never up: {', '.join(missing)}. Each axis "
            f"must rest pointing up and down, level to 20 degrees, {steady.shortest:.3g} s or "
            "longer"
        )
    force = gravity * face_vectors(faces)
    axes = [_axis(positions, force, k, simple) for k in range(3)]
    tilt = 0.0 if simple else _tilt(positions, force, axes, gravity)
    if tilt:  # residuals are larger than the noise: the rests are not level
        uncertain = positions._replace(accel_sigma=_tilted_sigma(positions, force, gravity, tilt))
        axes = [_axis(uncertain, force, k, simple) for k in range(3)]
        reason += f"; the residuals are those of rests tilted by {np.degrees(tilt):.2g} deg RMS"
    gyro = [  # with the force as input, because a sensitivity to it is not a bias
        fit_axis(observations(positions, force, positions.gyro, positions.gyro_sigma, k))
        for k in range(3)
    ]
    return SixPosition(
        scale_misalignment=np.array([_row(axis.gain, k, simple) for k, axis in enumerate(axes)]),
        scale_misalignment_sigma=np.array(
            [_row(axis.gain_sigma, k, simple) for k, axis in enumerate(axes)]
        ),
        bias=np.array([axis.bias[0] for axis in axes]),
        bias_sigma=np.array([axis.bias_sigma[0] for axis in axes]),
        gyroscope_bias=np.array([axis.bias[0] for axis in gyro]),
        gyroscope_bias_sigma=np.array([axis.bias_sigma[0] for axis in gyro]),
        positions=positions,
        faces=faces,
        residuals=_residuals(axes, faces, simple),
        misfit=_misfit(axes, force, positions, simple),
        fixture=EXACT,
        reason=reason,
        left_out=int(np.count_nonzero(~used)),
    )


def nearest_faces(accel: Array) -> tuple[Integers, Mask]:
    """Return the index (m,) of the face that points up, and whether it does so to 20 degrees."""
    direction = accel / np.maximum(np.linalg.norm(accel, axis=1, keepdims=True), 1e-12)
    axis = np.argmax(np.abs(direction), axis=1)
    along = np.take_along_axis(direction, axis[:, None], axis=1)[:, 0]
    return 2 * axis + (along < 0.0), np.abs(along) > _ALIGNED


def face_vectors(faces: Integers) -> Array:
    """Return (m, 3) unit vectors of the faces."""
    vectors = np.zeros((len(faces), 3))
    vectors[np.arange(len(faces)), faces // 2] = 1.0 - 2.0 * (faces % 2)
    return vectors


def _axis(positions: Steady, force: Array, k: int, simple: bool) -> AxisResponse:
    """Fit one axis; the simple variant uses the two faces of the axis alone."""
    if not simple:
        return fit_axis(observations(positions, force, positions.accel, positions.accel_sigma, k))
    on_axis = np.abs(force[:, k]) > 0.0
    used, along = positions.rows(on_axis), force[on_axis, k : k + 1]
    return fit_axis(observations(used, along, used.accel, used.accel_sigma, k))


def observations(
    steady: Steady,
    inputs: Array,
    readings: Array,
    sigma: Array,
    axis: int,
    temperature: Array | None = None,
) -> Observations:
    """Return the mean readings of one axis of a triad with their known input.

    :param steady: m pieces of stretches.
    :param inputs: (m, p) known inputs.
    :param readings: (m, 3) mean readings of the triad.
    :param sigma: (m, 3) standard errors of the readings.
    :param temperature: (m,) differences from the reference temperature [K]; None: 0.
    """
    t = np.zeros(len(inputs)) if temperature is None else temperature
    return Observations(
        inputs=inputs,
        readings=readings[:, axis],
        sigma=sigma[:, axis],
        time=steady.time,
        temperature=t,
    )


def _row(values: Array, k: int, simple: bool) -> Array:
    """Return the row of axis k in a matrix; the simple variant has its diagonal alone."""
    if not simple:
        return values
    row = np.zeros(3)
    row[k] = values[0]
    return row


def _tilt(positions: Steady, force: Array, axes: list[AxisResponse], gravity: float) -> float:
    """Return the RMS tilt of the rests about each axis according to the residuals [rad]; 0: none.

    Across an axis a tilt of theta reads g theta. Each axis has four numbers; the residuals of the
    rests' means are tilt if they are far above the readings' own errors. Rounding, which
    alone remains of an exact fit of readings without noise, is no tilt.

    :param force: (m, 3) nominal specific forces in the pieces [m/s^2].
    :param axes: fitted responses of the accelerometer's axes.
    :param gravity: magnitude of gravity [m/s^2].
    """
    if all(axis.is_exact for axis in axes):
        return 0.0
    numbers, first_piece = np.unique(positions.stretch, return_index=True)
    freedom = 3 * (len(numbers) - 4)
    misfit = _misfit(axes, force, positions, simple=False)
    means = np.array([misfit[positions.stretch == number].mean(axis=0) for number in numbers])
    reading_variance = np.square(positions.accel_sigma[first_piece]).mean()
    variance = float(np.sum(means**2)) / max(freedom, 1)
    return (
        np.sqrt(variance) / gravity
        if freedom > 0 and variance > _TILTED * reading_variance
        else 0.0
    )


def _tilted_sigma(positions: Steady, force: Array, gravity: float, tilt: float) -> Array:
    """Return (m, 3) standard errors of readings at rests that are tilted.

    ``g theta`` across an axis; along it ``g theta^2``, the mean square of what the cosines of two
    tilts take away. All pieces of a rest have one tilt: each counts as if there were no others.
    """
    _, rest_index, count = np.unique(positions.stretch, return_inverse=True, return_counts=True)
    pieces = count[rest_index.ravel()][:, None]
    along = force != 0.0
    extra = np.where(along, 2.0 * (gravity * tilt**2) ** 2, (gravity * tilt) ** 2)
    return np.sqrt(np.square(positions.accel_sigma) + pieces * extra)


def _misfit(axes: list[AxisResponse], force: Array, positions: Steady, simple: bool) -> Array:
    """Return (m, 3) reading minus model; the simple variant has none across an axis."""
    gains = np.array([_row(axis.gain, k, simple) for k, axis in enumerate(axes)])
    model = force @ gains.T + np.array([axis.bias[0] for axis in axes])
    across = (force == 0.0) & simple
    return np.where(across, 0.0, positions.accel - model)


def _residuals(axes: list[AxisResponse], faces: Integers, simple: bool) -> Array:
    """Return (m, 3) the residuals; the simple variant has none across an axis."""
    residuals = np.zeros((len(faces), 3))
    for k, axis in enumerate(axes):
        residuals[faces // 2 == k if simple else slice(None), k] = axis.residuals
    return residuals
