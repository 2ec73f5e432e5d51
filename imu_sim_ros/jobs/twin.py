# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin of a sensor on its vehicle: values with their uncertainty, and a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.calibration.twin import model, spectrum
from imu_sim_ros.calibration.twin.analysis import (
    Analysis,
    analyse,
    constant_errors,
    cross_validate,
    fast_part,
    noise_residuals,
)
from imu_sim_ros.calibration.twin.fit import PRIOR, Fit, Recording
from imu_sim_ros.calibration.twin.intensity import vibration_mask
from imu_sim_ros.calibration.twin.model import perfect
from imu_sim_ros.calibration.twin.parameters import (
    MOTION_FLOOR,
    MOTION_TIME,
    clock_offset,
    clock_skew,
    simulator_parameters,
)
from imu_sim_ros.calibration.twin.pose_noise import PoseNoise
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import integer, number, suggest_keywords
from imu_sim_ros.core.conventions import GRAVITY
from imu_sim_ros.core.errors import InputError, Problems, system_error
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.rotation import from_matrix, log
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, JsonObject, Mask
from imu_sim_ros.jobs.calibrate import Calibrated
from imu_sim_ros.jobs.calibration_text import twin_lines
from imu_sim_ros.jobs.flight import Flight
from imu_sim_ros.jobs.readings import HasPoses
from imu_sim_ros.jobs.selection import (
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    input_lines,
)
from imu_sim_ros.jobs.twin_check import Check, check, real_and_twin_residuals, simulation
from imu_sim_ros.jobs.twin_recording import TwinRecording, rows_in_motion, spline_recording
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.sensors.imu.vibration import MotionSize
from imu_sim_ros.terminal.json_text import plain_types
from imu_sim_ros.terminal.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure


MATRIX: Final = tuple(row + column for row in "xyz" for column in "xyz")
_OF: Final = (
    ("stamp_offset", ("",)),
    ("clock_skew_ppm", ("",)),
    ("mounting", tuple("xyz")),
    ("gyroscope_scale_misalignment", MATRIX),
    ("accelerometer_scale_misalignment", ("xx", "xy", "xz", "yy", "yz", "zz")),
    ("gyroscope_g_sensitivity", MATRIX),
    ("lever_arm", tuple("xyz")),
    ("gyroscope_bias", tuple("xyz")),
    ("accelerometer_bias", tuple("xyz")),
    ("truth_curvature", ("",)),
    ("truth_turn", tuple("xyz")),
)
NAMES: Final = tuple(f"{name} {part}".strip() for name, parts in _OF for part in parts)
"""Names of the 42 parameters, in their order."""
_UNDETERMINED: Final = 0.7
"""Standard error over the prior's above which a motion says nothing of a parameter."""
_NOT_GIVEN: Final = 5.0
"""Standard errors by which the poses' noise may move a number that is given."""
_SAID: Final = 2.0
"""Beyond it, a number is not given if the noise is rounding: that is no white noise, follows the
motion, and what it does is known less well (of poses rounded to a millimetre, figure_eight, numbers
that it moves by 2 to 5 standard errors are off by 2.2, RMS; others by 1.3)."""
_DISAGREE: Final = 3.0
"""Standard errors by which quarters of the recording disagree, RMS of the four: by chance once in a
million numbers, as the chi-square of four degrees of freedom is 36."""
_SURE: Final = 5.0
"""Standard errors beyond which a scale or bias contradicts any sensor."""
_TILT: Final = 0.02
"""Largest tilt of a truth that counts as levelled [rad]."""
_SCALE: Final = 0.05
"""Error of scale, and misalignment, that no calibrated sensor and few others have."""
_BIAS: Final = (0.35, 0.5)
"""Biases that few sensors have: 20 deg/s and 50 mg [rad/s], [m/s^2]."""


class Trust(NamedTuple):
    """Fit and how far it can be trusted."""

    fit: Fit
    """Fit with standard errors no smaller than the recording itself shows."""
    given: Mask
    """(42,) True where a number is given."""
    undetermined: tuple[str, ...]
    """Numbers that this motion does not determine."""
    warnings: tuple[str, ...]


def judge_fit(fit: Fit, disagreement: Array, noise: PoseNoise) -> Trust:
    """Return a fit with enlarged standard errors, and which of its 42 numbers can be trusted.

    Standard errors grow to the disagreement of the quarters, and by the shifts that rounded poses
    cause. A number that the noise of the poses shifts too far is not reported.

    :param disagreement: (42,) RMS between the quarters of the recording [standard errors].
    """
    disagree = disagreement > _DISAGREE
    factors = np.where(disagree, disagreement, 1.0)
    error_factors = np.sqrt(factors**2 + fit.noise_shift**2) if noise.is_rounding else factors
    covariance = fit.covariance * np.outer(error_factors, error_factors)
    enlarged = fit._replace(covariance=covariance)
    reported = fit.noise_shift <= (_SAID if noise.is_rounding else _NOT_GIVEN)
    weak = fit.sigma > _UNDETERMINED * PRIOR  # the data hardly narrow the prior
    undetermined = tuple(
        NAMES[k] for k in range(model.GYROSCOPE.start, model.BIAS.start) if weak[k]
    )
    warnings = [*_noise_lines(fit, reported, noise), *_quarter_lines(disagree, factors)]
    warnings += _contradictions(enlarged)
    return Trust(enlarged, reported, undetermined, tuple(warnings))


def _noise_lines(fit: Fit, reported: Mask, noise: PoseNoise) -> Iterator[str]:
    """Yield lines about errors that the noise of the poses hides, or has shifted."""
    angle, distance = 1e3 * noise.deviation
    poses = f"noise of the poses, {distance:.2g} mm and {angle:.2g} mrad"
    hidden = [NAMES[k] for k in np.flatnonzero(~reported)]
    if hidden:
        yield f"not given, since they hang on the {poses}: {', '.join(hidden)}"
    moved = reported & (fit.noise_shift > _SAID)
    if moved.any():
        sizes = [f"{NAMES[k]} by {fit.noise_shift[k]:.1f}" for k in np.flatnonzero(moved)]
        yield f"corrected for the {poses}, in standard errors: {', '.join(sizes)}"


def _quarter_lines(disagree: Mask, larger: Array) -> Iterator[str]:
    """Yield a line about errors that differ between quarters of the recording."""
    if disagree.any():
        sizes = [f"{NAMES[k]} ({larger[k]:.0f} times)" for k in np.flatnonzero(disagree)]
        yield (
            "quarters of the recording contradict each other, so the sensor or its truth changes; "
            f"standard errors are enlarged to these differences: {', '.join(sizes)}"
        )


def _contradictions(fit: Fit) -> Iterator[str]:
    """Yield lines about fitted errors that no sensor has."""
    errors, sigma = fit.errors, fit.sigma
    tilt, unsure = errors.world[:2], sigma[model.WORLD][:2]
    angle = float(np.linalg.norm(tilt))
    if angle > _TILT and np.any(np.abs(tilt) > _SURE * unsure):
        yield (
            f"the truth's attitudes are turned by {np.degrees(angle):.2g} degrees against gravity: "
            "accelerometer biases and scales with another truth would be others"
        )
    deviation = errors.deviation()
    for part, limit in (
        (model.GYROSCOPE, _SCALE),
        (model.ACCELEROMETER, _SCALE),
        (slice(model.BIAS.start, model.BIAS.start + 3), _BIAS[0]),
        (slice(model.BIAS.start + 3, model.BIAS.stop), _BIAS[1]),
    ):
        for k in range(part.start, part.stop):
            fast_part = abs(deviation[k]) - limit
            if fast_part > 0.0 and abs(deviation[k]) > _SURE * sigma[k]:
                yield (
                    f"{NAMES[k]} is {deviation[k]:+.3g} from a perfect sensor's, more than a "
                    f"sensor has ({limit:g}): the truth, its frame or the gravity contradicts the "
                    "readings"
                )


_LEAST_FIT: Final = 8.0
"""Shortest part of a recording that is fitted or compared [s]."""
_LEAST_FREEDOM: Final = 2.0
"""Degrees of freedom of a density below which it is mostly noise of the poses, and not given."""
_SECONDS: Final = 0.25
"""Time over which readings are averaged to be compared with the truth [s]."""
_LEFT: Final = 0.5
"""Share of the gyroscope's variance that no truth may leave."""


@dataclass(frozen=True, repr=False)
class Twin:
    """Result of :func:`imu_sim_ros.twin`."""

    errors: dict[str, Calibrated]
    """Constant errors by parameter, with standard errors; ``mounting`` is the rotation vector of
    R_ib [rad], which takes vectors from the truth's body to the IMU, ``stamp_offset`` that at the
    truth's first pose. Two belong to the truth: ``truth_curvature`` [s^2] is ``-s^2 / 2`` if its
    attitudes are smoothed over s, and ``truth_turn`` [rad] the rotation vector from their world to
    that of positions and gravity.
    NaN: not given, since it hangs on the noise of the poses."""
    undetermined: tuple[str, ...]
    """Numbers that this motion does not determine; they are a perfect IMU's but for their prior."""
    given: Mask
    """(42,) which numbers are given, in the order of ``calibration.twin.model``."""
    warnings: tuple[str, ...]
    """Numbers that hang on the poses' noise, contradictions, and readings without a truth: a line
    each."""
    parameters: dict[str, Value]
    """Parameters of the simulator, by name."""
    analysis: Analysis
    """Bias over time, lines, bands, white floor and intensities."""
    check: Check | None
    """The comparison with the part that was not used, if there is one."""
    source: TwinRecording

    def __repr__(self) -> str:
        return (
            f"<Twin of {Path(self.source.name).name}, {self.source.seconds:.3g} s: "
            f"{len(self.analysis.lines.frequency)} lines, {len(self.analysis.vibration.low)} bands>"
        )

    def lines(self) -> Iterator[str | TextTable]:
        """Yield the text of the twin, as ``twin`` prints it."""
        yield from input_lines(self.source.notes)
        yield from twin_lines(
            self.errors,
            self.undetermined,
            self.source,
            self.clock_wander,
            self.analysis,
            self.check,
        )

    def to_dict(self) -> JsonObject:
        """Return all numbers by name, in plain types; None for those that are not finite."""
        analysis, noise = self.analysis, self.source.noise
        white, bands, lines = analysis.white, analysis.bands, analysis.lines
        density = np.where(bands.freedom < _LEAST_FREEDOM, np.nan, bands.density)
        result: dict[str, object] = plain_types(
            {
                "rate_hz": self.source.recording.rate,
                "seconds": self.source.seconds,
                "readings_s": self.source.given_s,
                "errors": {
                    name: {"value": v.value, "sigma": v.sigma} for name, v in self.errors.items()
                },
                "warnings": list(self.warnings),
                "notes": list(self.source.notes),
                "pose_noise": {**noise.to_dict(), "cutoff_hz": self.source.cutoff},
                "undetermined": list(self.undetermined),
                "clock_wander_s": self.clock_wander,
                "white_floor": {
                    "value": white.density,
                    "low": white.low,
                    "high": white.high,
                },
                "lines": lines._asdict(),
                "bands": {
                    "low_hz": bands.low,
                    "high_hz": bands.high,
                    "density": density,
                    "density_low": density * bands.interval[0],
                    "density_high": density * bands.interval[1],
                },
                "ranges_hz": analysis.range_edges,
                "exponents": {
                    "value": analysis.exponents.value,
                    "sigma": analysis.exponents.sigma,
                },
                "bias_over_time": {
                    "t_s": analysis.bias_t,
                    "value": analysis.bias,
                    "sigma": analysis.bias_sigma,
                },
                "check": None if self.check is None else self.check.to_dict(),
            }
        )
        return result

    @property
    def clock_wander(self) -> float:
        """RMS wander of the truth's clock around offset and skew [s]; 0 for a steady clock."""
        return float(np.std(self.analysis.fit.wander))

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the parameter file for ``simulator`` and ``generate``; returns its path.

        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        with save_output(path, force) as staged:
            self.write(staged)
        return Path(path)

    def write(self, path: Path) -> None:
        """Write the parameter file.

        :raises ConfigurationError: for an argument that is not a path.
        """
        path = arguments.path("path", path, "the path of an output")
        name = Path(self.source.name).name
        try:
            files.write(self.parameters, path, comment=f"Digital twin of {name}.")
        except OSError as error:
            raise system_error(path, error) from None

    def plot(self) -> Figure:
        """Return a matplotlib figure: spectra and time series, real next to simulated."""
        from imu_sim_ros.plots import calibration as pictures

        real, simulated = self.flown()
        name = Path(self.source.name).name
        return pictures.draw_spectra(real, simulated, self.source.recording.rate, name)

    def flown(self, seed: int = 0) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return times (n,) and residuals (n, 6) of the real sensor, and those of the twin.

        :raises ConfigurationError: for an invalid seed.
        """
        _check_seed(seed)
        if self.check is not None and seed == 0:
            real, simulated = self.check.flown
            return (real.t, real.residuals), (simulated.t, simulated.residuals)
        return real_and_twin_residuals(self.source, self.analysis.fit, self.parameters, seed)

    def simulate(self, seed: int = 0) -> Flight:
        """Return the twin's flight along the truth, at the truth's times.

        :raises ConfigurationError: for an invalid seed.
        """
        _check_seed(seed)
        engine = simulation(self.source, self.parameters, seed)
        return Flight(engine, list(engine.windows()), f"twin of {self.source.name}")


@suggest_keywords
def twin(
    recording: Annotated[Flight | Readings | str | Path, "RECORDING"],
    truth: HasPoses | str | Path,
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    fit: Annotated[float | None, "TIME"] = None,
    gravity: Annotated[float, "GRAVITY"] = -GRAVITY[2],
    cutoff: Annotated[float, "HZ"] = 12.0,
    max_offset: Annotated[float, "TIME"] = 0.5,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Twin:
    """Return the digital twin of a sensor on its vehicle, from a recording in motion and its truth.

    The recording is compared with what a perfect IMU reads along a spline through the truth. Time
    offset and skew, mounting, lever arm, biases, scale and misalignment and g-sensitivity are found
    by one weighted least-squares fit, together with the smoothing and alignment of the truth. The
    residual is described by lines, bands and a white floor on six axes, and by the dependence of
    their intensity on the motion. The recording may also be a flight or :class:`Readings`.

    :param recording: bag, EuRoC folder or CSV file
    :param truth: true poses of the body, for instance from motion capture: arrays or a file.
    :param topic: sensor_msgs/Imu topic, if the bag has several
    :param truth_topic: topic of the poses, if the bag has several
    :param fit: use this much of the recording, and compare the twin with the rest [s]
    :param gravity: magnitude of local gravity [m/s^2]
    :param cutoff: count motion at higher frequencies as vibration [Hz]
    :param max_offset: largest offset between the two clocks to search for [s]
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Twin`: errors with standard errors, spectra, parameters.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: with a line for each reason why there is no twin.

    >>> import imu_sim_ros as ims
    >>> sensor = {"preset": "adis16448", "lever_arm": [0.1, 0.0, 0.0]}
    >>> flight = ims.simulate(imu=sensor, trajectory="figure_eight", duration=15, rate=100)
    >>> arm = ims.twin(flight, flight.truth).errors["lever_arm"]
    >>> bool(abs(arm.value[0] - 0.1) < 4.0 * arm.sigma[0])
    True
    """
    _check_numbers(fit, gravity, cutoff, max_offset)
    arguments.boolean("skip_bad_rows", skip_bad_rows)
    source = spline_recording(
        recording,
        truth,
        gravity=gravity,
        cutoff=cutoff,
        max_offset=max_offset,
        topic=topic,
        truth_topic=truth_topic,
        skip_bad_rows=skip_bad_rows,
        selection=(frame, gyro_topic, accel_topic, gyro_unit, accel_unit),
    )
    return _build_twin(source, fit)


def _build_twin(source: TwinRecording, fit: float | None) -> Twin:
    """Return the twin of a recording.

    :param fit: length of the part that is fitted [s]; the remainder is compared. None: all.
    """
    recording = source.recording
    fitting_part, held_out = recording, None
    if fit is not None:
        fitting_part, held_out = _split_at(recording, fit, source.name)
    fitted = constant_errors(fitting_part, source.sharp_truth, perfect(source.r_ib, source.offset))
    _check_likeness(source, fitting_part, fitted)
    check_settled(source, fitted)
    validation = cross_validate(fitting_part, source.sharp_truth, fitted)
    trust = judge_fit(fitted, validation.disagreement, source.noise)
    # Above the cut-off, motion counts as vibration.
    fast = fast_part(fitting_part, source.sharp_truth, source.truth, fitted)
    vibration_fit = trust.fit._replace(residuals=fitted.residuals + fast)
    analysis = _analyse_residuals(source, fitting_part, vibration_fit, validation.residuals + fast)
    step = _steps(recording.readings)
    white = spectrum.remove_rounding(analysis.white, step, recording.rate)
    analysis = analysis._replace(white=white)
    parameters = simulator_parameters(analysis, recording.rate, step)
    if source.gravity != -GRAVITY[2]:
        parameters["gravity"] = (0.0, 0.0, -source.gravity)
    checked = None if held_out is None else check(source, held_out, analysis, parameters)
    errors = _errors(trust.fit, trust.given)
    return Twin(
        errors,
        trust.undetermined,
        trust.given,
        (*source.coverage_lines(), *trust.warnings),
        parameters,
        analysis,
        checked,
        source,
    )


def _check_likeness(source: TwinRecording, recording: Recording, fit: Fit) -> None:
    """Refuse readings that are not those of the truth's motion.

    Angular rates and their residuals by the fit are compared as means over windows, in which noise
    counts little.

    :param recording: readings (n, 6) of the fit, gyroscope first.
    :raises InputError: if the truth explains too little of the angular rates.
    """
    window = max(round(_SECONDS * recording.rate), 1)
    rows = len(recording.stamps) // window * window
    rates, residuals = (
        columns[:rows, :3].reshape(-1, window, 3).mean(axis=1)
        for columns in (recording.readings - fit.errors.bias, fit.residuals)
    )
    variance, remainder = float(np.sum(rates**2)), float(np.sum(residuals**2))
    if remainder > _LEFT * variance:
        share = 100.0 * max(1.0 - remainder / variance, 0.0)
        raise InputError(
            f"{source.name}: the truth explains {share:.0f} % of what the gyroscope reads: they "
            "are not of one flight, or farther apart in time than max_offset"
        )


def check_settled(source: TwinRecording, fit: Fit) -> None:
    """Refuse a recording whose least squares has no minimum.

    :raises InputError: if the noise of the poses hides what the motion shows.
    """
    if not fit.settled:
        angle, distance = 1e3 * source.noise.deviation
        raise InputError(
            f"{source.name}: the least squares does not settle: the noise of the poses, "
            f"{distance:.2g} mm and {angle:.2g} mrad, hides too much of this motion; a truth with "
            "less noise or more decimals, or a longer or livelier recording, is needed"
        )


def _check_seed(seed: int) -> None:
    integer("seed", seed, "an integer of at least 0", 0, 2**63 - 1)


def _check_numbers(fit: float | None, gravity: float, cutoff: float, max_offset: float) -> None:
    """Refuse numbers outside of their limits, all of them together."""
    limits = [
        ("gravity", gravity, 1.0, 30.0, "m/s^2"),
        ("cutoff", cutoff, 0.5, 1000.0, "Hz"),
        ("max_offset", max_offset, 0.0, 60.0, "s"),
    ]
    if fit is not None:
        limits.append(("fit", fit, _LEAST_FIT, 1e7, "s"))
    problems = Problems()
    for name, value, low, high, unit in limits:
        with problems.collect():
            number(name, value, f"between {low:g} and {high:g} {unit}", low, high)
    problems.tell()


def _split_at(whole: Recording, seconds: float, name: str) -> tuple[Recording, Recording]:
    """Return the first seconds of a recording, and the remainder."""
    begin, end = float(whole.stamps[0]), float(whole.stamps[-1])
    if end - begin - seconds < _LEAST_FIT:
        raise InputError(
            f"{argument_prefix('fit', f'{seconds:g}')}: must leave {_LEAST_FIT:g} s of the "
            f"{end - begin:.4g} s of {name} to compare the twin with"
        )
    return whole.part(begin, begin + seconds), whole.part(begin + seconds, np.inf)


def _analyse_residuals(source: TwinRecording, used: Recording, fit: Fit, unseen: Array) -> Analysis:
    """Return the analysis of the residuals, of a recording after the fit."""
    t = model.true_times(fit.errors, used.stamps, fit.reference, fit.wander)
    motion = source.motion(t)
    norms = tuple(
        np.linalg.norm(v, axis=1)
        for v in (motion.angular_velocity, motion.acceleration, motion.velocity)
    )

    def sizes(reference: Array) -> Array:
        x, y, z = (float(value) for value in reference)
        return MotionSize(used.rate, (x, y, z), MOTION_FLOOR, MOTION_TIME).logs(motion)

    noises = noise_residuals(used, source.truth, fit)
    size = (norms[0], norms[1], norms[2])
    rows = rows_in_motion(motion) & vibration_mask(used.readings, used.pieces, used.rate)
    return analyse(used, fit, unseen, noises, sizes, size, rows)


_LEAST_CODES: Final = 10
"""Smallest number of different readings from which a digital step is estimated."""
_FINEST: Final = 1e-8
"""Step over range: far above the rounding of floats."""
_MOST_PARTS: Final = 4
"""Two codes that both occur twice may be so many steps apart."""
_NEAR_WHOLE: Final = 0.05
"""Largest distance of a difference from a whole number of digital steps."""
_MOSTLY: Final = 0.9
"""Share of whole numbers of steps; by chance, one of ten numbers is so near to a whole one."""


def _steps(readings: Array) -> Array:
    """Return the digital steps (6,) of the readings (n, 6) in motion; 0 if there are none.

    Values that occur twice are codes, whole numbers of steps apart; others may be interpolated.
    """
    result = np.zeros(6)
    for k, column in enumerate(readings.T):
        values, counts = np.unique(column, return_counts=True)
        codes = values[counts > 1]
        if len(codes) < _LEAST_CODES:
            continue
        smallest = float(np.diff(codes).min())
        if smallest < _FINEST * np.ptp(values):  # of an exact motion that repeats itself
            continue
        for part in range(1, _MOST_PARTS + 1):
            steps = np.diff(codes) * part / smallest
            whole = np.abs(steps - np.round(steps)) < _NEAR_WHOLE
            if whole.mean() > _MOSTLY:
                result[k] = smallest / part
                break
    return result


def _errors(fit: Fit, reported: Mask) -> dict[str, Calibrated]:
    """Return the constant errors by name; NaN for those that are not given."""
    errors, covariance = fit.errors, fit.covariance
    span = np.array([1.0, -fit.reference])
    sigma = np.where(reported, fit.sigma, np.nan)
    offset_sigma = np.sqrt(span @ covariance[:2, :2] @ span) if reported[:2].all() else np.nan

    def of(value: ArrayLike, sigmas: ArrayLike) -> Calibrated:
        flat = np.ravel(sigmas).astype(np.float64)
        return Calibrated(np.where(np.isnan(flat), np.nan, np.ravel(value)), flat)

    upper = np.zeros((3, 3))
    upper[model.UPPER] = sigma[model.ACCELEROMETER]
    return {
        "stamp_offset": of(clock_offset(fit), offset_sigma),
        "clock_skew_ppm": of(1e6 * clock_skew(fit), 1e6 * sigma[1]),
        "mounting": of(log(from_matrix(errors.r_ib)), sigma[model.MOUNTING]),
        "lever_arm": of(errors.lever_arm, sigma[model.LEVER_ARM]),
        "gyroscope_bias": of(errors.bias[:3], sigma[model.BIAS][:3]),
        "gyroscope_scale_misalignment": of(errors.response[:3, :3], sigma[model.GYROSCOPE]),
        "gyroscope_g_sensitivity": of(errors.response[:3, 3:], sigma[model.G_SENSITIVITY]),
        "accelerometer_bias": of(errors.bias[3:], sigma[model.BIAS][3:]),
        "accelerometer_scale_misalignment": of(errors.response[3:, 3:], upper),
        "truth_curvature": of(errors.curvature, sigma[model.CURVATURE]),
        "truth_turn": of(errors.world, sigma[model.WORLD]),
    }
