# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning of readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, wraps
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np

from imu_sim_ros.core.arguments import BAG_OR_FILE, boolean, choice, name_of, number
from imu_sim_ros.core.arguments import path as checked_path
from imu_sim_ros.core.arguments import topic as checked_topic
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.errors import InputError, Problems, Remark, warn
from imu_sim_ros.core.memory import release_memory
from imu_sim_ros.core.records import Readings, States, replace_fields
from imu_sim_ros.core.rotation import to_euler
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.core.timebase import describe_span
from imu_sim_ros.core.types import Array, JsonObject, Mask, Times
from imu_sim_ros.datasets import world as worlds
from imu_sim_ros.datasets.world import KnownWorld, world_of_simulation
from imu_sim_ros.formats.door import has_topics, read_states, truth_file
from imu_sim_ros.jobs import tracks
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.readings import judge_readings
from imu_sim_ros.jobs.selection import (
    NOTHING,
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    Selection,
    input_lines,
)
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.navigation import angles, initialisation
from imu_sim_ros.navigation.association import interpolate_vectors
from imu_sim_ros.navigation.comparison import Comparison, compare
from imu_sim_ros.navigation.covariance import (
    ATTITUDE,
    POSITION,
    Covariance,
    initial_covariance,
    propagate,
)
from imu_sim_ros.navigation.coverage import time_with_truth, truth_line
from imu_sim_ros.navigation.dead_reckoning import dead_reckon as integrate
from imu_sim_ros.navigation.evaluation import distances, state_at
from imu_sim_ros.navigation.mount import ImuMount, mount_of
from imu_sim_ros.navigation.parameters import (
    ATTITUDE_UPDATES,
    INITIAL_STATES,
    METHODS,
    IntegratorParameters,
    load_integrator,
)
from imu_sim_ros.navigation.state import (
    Correction,
    NavigationState,
    correction_of,
)
from imu_sim_ros.recordings.findings.catalogue import pose_findings
from imu_sim_ros.recordings.findings.policy import DEAD_RECKON
from imu_sim_ros.recordings.order import READINGS_GAP, gap_length
from imu_sim_ros.sensors.imu.triads import TriadsParameters
from imu_sim_ros.terminal.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure

_POSE: Final = np.r_[POSITION, ATTITUDE]
_LONGEST_SKIP: Final = 2.0**31
"""Longest start that can be left out [s]."""


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Track(States):
    """A dead-reckoned trajectory: states at the stamps of the readings.

    The covariance is that of position [m] and attitude [rad], both in the world's axes; see
    :func:`dead_reckon`. The source is the sensor or file of the readings.
    """

    role = "estimate"

    method: str
    """Integration method."""
    attitude_update: str
    """Representation in which the attitude is integrated."""
    truth: States | None = None
    """Truth that came with the readings."""
    initial_state: str = "truth"
    """``truth``, ``level`` or ``parameters``, as in :func:`dead_reckon`."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    def __repr__(self) -> str:
        return f"<Track {self.method}, {self.attitude_update}: {describe_span(self.t_ns)}>"

    def to_dict(self) -> JsonObject:
        """Return length and errors, as ``--json`` prints them; None for errors without a truth.

        ``truth_coverage`` is the share of the readings' time for which there is a truth, which
        ends ``truth_until_s`` after the first reading; length and errors are those of this part.
        """
        drift = self.drift()
        length = float(distances(self.position)[-1]) if drift is None else drift.distance
        duration = self._seconds(self.t_ns[-1])
        compared = coverage = None
        if self.truth is not None:
            compared = time_with_truth(self.t_ns, self.truth.t_ns)
            coverage = compared / duration if duration else 1.0
        result: JsonObject = {
            "method": self.method,
            "attitude_update": self.attitude_update,
            "initial_state": self.initial_state,
            "samples": len(self),
            "duration_s": duration,
            "distance_m": length,
            "truth_coverage": coverage,
            "compared_s": compared,
            "truth_until_s": drift and self._seconds(drift.t_ns[-1]),
            "notes": list(self.notes),
        }
        errors: dict[str, tuple[float | None, float | None]] = dict.fromkeys(
            ("position_error_m", "velocity_error_m_s", "attitude_error_rad"), (None, None)
        )
        if drift is not None:
            errors = {
                "position_error_m": (drift.final_position, drift.rms_position),
                "velocity_error_m_s": (drift.final_velocity, drift.rms_velocity),
                "attitude_error_rad": (drift.final_attitude, drift.rms_attitude),
            }
        for name, (final, rms) in errors.items():
            result |= {f"final_{name}": final, f"rms_{name}": rms}
        for kind in ("final", "rms"):
            error = result[f"{kind}_position_error_m"]
            has_path = error is not None and length > 0.0
            result[f"{kind}_position_error_percent"] = 100.0 * error / length if has_path else None
        return result

    def _seconds(self, t_ns: int) -> float:
        """Return a time after the first stamp [s]."""
        return float(t_ns - self.t_ns[0]) * 1e-9

    def drift(self) -> Comparison | None:
        """Return the errors, estimate minus truth, at the common times; None without a truth.

        :raises InputError: if they do not overlap in time.
        """
        if self.truth is None:
            return None
        return compare(self, self.truth.in_order(), allowance=0.0)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the trajectory; returns the path.

        :param path: ``.csv``: with velocity; anything else: poses in TUM format.
        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        with save_output(path, force) as staged:
            tracks.write_states(staged, self)
        return Path(path)

    def plot(self) -> Figure:
        """Return a matplotlib figure: the path, with the truth if there is one."""
        return plot_tracks([self])


def plot_tracks(shown: Sequence[Track]) -> Figure:
    """Return a matplotlib figure of several ways to integrate the same readings."""
    first_track = shown[0]
    sensor, _, motion = first_track.source.partition(" on ")
    source = f"IMU {sensor}, trajectory {motion}" if motion else first_track.source
    title = f"{source}: dead reckoning" if source else "Dead reckoning"
    title += "" if first_track.truth is None else " against the truth"
    return plot_named_tracks(
        {f"{track.method}, {track.attitude_update}": track for track in shown}, title
    )


def plot_named_tracks(shown: Mapping[str, Track], title: str) -> Figure:
    """Return a matplotlib figure of tracks with the truth of the first."""
    from imu_sim_ros.plots import navigation as pictures

    drifts = {name: track.drift() for name, track in shown.items()}
    kinds: dict[str, Callable[[Comparison], Array]] = {
        "position": lambda drift: drift.position,
        "attitude": lambda drift: drift.attitude,
    }
    errors = {
        kind: {
            name: ((d.t_ns - d.t_ns[0]) * 1e-9, np.linalg.norm(error_vectors(d), axis=1))
            for name, d in drifts.items()
            if d is not None
        }
        for kind, error_vectors in kinds.items()
    }
    truth = next(iter(shown.values())).truth
    return pictures.trajectories(
        {name: track.position for name, track in shown.items()},
        None if truth is None else truth.position,
        errors["position"],
        errors["attitude"],
        title,
    )


def dead_reckon(
    readings: Annotated[Flight | Readings | str | Path, "BAG"],
    *,
    imu_topic: Annotated[str | None, "TOPIC"] = None,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    method: Annotated[str, METHODS] = "midpoint",
    attitude_update: Annotated[str, ATTITUDE_UPDATES] = "so3",
    initial: Annotated[str | NavigationState, "--initial-state", INITIAL_STATES] = "truth",
    calibration: Annotated[str | Path | None, "--correction FILE"] = None,
    skip: Annotated[float, "TIME"] = 0.0,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
    covariance: bool = False,
    **parameters: object,
) -> Track:
    """Integrate readings into a trajectory.

    The readings may also be a flight or :class:`Readings`, and ``initial`` a state.

    :param readings: a bag of any format, or a EuRoC folder
    :param imu_topic: topic of the readings, if the bag has several
    :param truth_topic: topic of the truth; by default ``ground_truth/odom``
    :param method: integration of position and velocity
    :param attitude_update: integration of the attitude
    :param initial: the state at the first reading. parameters: initial_position and so on; level:
        roll, pitch and gyroscope bias from level_time at rest, position and yaw from the truth if
        there is one
    :param calibration: parameter file with known biases, scales and misalignments, as written by
        calibrate
    :param skip: skip the readings in this time after the first one [s]
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :param covariance: also propagate the covariance of the poses; for a flight that starts at an
        exact state, or level.
    :param parameters: parameters of the integrator node by their ROS names: ``gravity``,
        ``gyroscope_bias``, ``accelerometer_scale_misalignment``, ``level_time``, ``max_gap``, ...
    :returns: a :class:`Track`: the states at the readings' times.
    :raises ConfigurationError: with a line for each invalid parameter.
    :raises InputError: for readings that cannot be integrated, or have no truth to start at.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="perfect", trajectory="lecture", duration=20, rate=200)
    >>> track = ims.dead_reckon(flight, method="midpoint")
    >>> round(ims.evaluate(track, flight.truth).final_position, 5)
    0.00129
    """
    start, settings = _prepare(
        readings,
        {**parameters, "method": method, "attitude_update": attitude_update},
        initial,
        calibration,
        (imu_topic, truth_topic),
        skip,
        skip_bad_rows,
        (frame, gyro_topic, accel_topic, gyro_unit, accel_unit),
    )
    boolean("covariance", covariance)
    track = integrate_from(start, settings)
    if not covariance:
        return track
    return replace(track, covariance=_covariance(readings, track, start, mount_of(settings.imu)))


@wraps(dead_reckon, assigned=())
def dead_reckon_all(
    readings: Flight | Readings | str | Path,
    *,
    initial: str = "truth",
    calibration: str | Path | None = None,
    imu_topic: str | None = None,
    truth_topic: str | None = None,
    skip: float = 0.0,
    skip_bad_rows: bool = False,
    frame: str | None = None,
    gyro_topic: str | None = None,
    accel_topic: str | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    **parameters: object,
) -> list[Track]:
    """Integrate readings by all methods with all attitude updates; arguments as `dead_reckon`."""
    topics = (imu_topic, truth_topic)
    selection = (frame, gyro_topic, accel_topic, gyro_unit, accel_unit)
    start, settings = _prepare(
        readings, parameters, initial, calibration, topics, skip, skip_bad_rows, selection
    )
    return [
        integrate_from(start, replace(settings, method=method, attitude_update=attitude))
        for method in METHODS
        for attitude in ATTITUDE_UPDATES
        if attitude != "euler_angles" or method in angles.METHODS
    ]


def _prepare(
    readings: Flight | Readings | str | Path,
    parameters: Mapping[str, object],
    initial: str | NavigationState,
    calibration: str | Path | None,
    topics: tuple[str | None, str | None],
    skip: float,
    skip_bad_rows: bool,
    selection: Selection = NOTHING,
) -> tuple[InitialCondition, IntegratorParameters]:
    """Return where integration begins, and its settings; arguments as for :func:`dead_reckon`."""
    if initial is None or not isinstance(initial, NavigationState):
        choice("initial", initial, (*INITIAL_STATES, "a NavigationState"))
    number("skip", skip, "seconds, from 0 to 2^31", 0.0, _LONGEST_SKIP)
    boolean("skip_bad_rows", skip_bad_rows)
    name = initial if isinstance(initial, str) else "parameters"
    overrides = {"initial_state": name, **_plain(parameters)}
    if calibration is not None:
        allowed = "a name or the path of a file"
        overrides["calibration"] = str(checked_path("calibration", calibration, allowed))
    if isinstance(readings, str | PathLike):
        problems = Problems()
        with problems.collect():
            _settings(**overrides)  # wrong ones are refused before readings are read
        if problems:
            with problems.collect():
                tracks.has_truth(checked_path("readings", readings, BAG_OR_FILE))
        problems.tell()
    recording = _recording(readings, *topics, skip_bad_rows, selection)
    world = _world(readings, selection[1] or topics[0], topics[1])
    layers = {**world.parameters, **overrides}
    usual = all(isinstance(value, str) for value in layers.values())
    settings = (_usual_settings if usual else _settings)(**layers)
    if not (isinstance(readings, Flight) and (np.diff(recording.readings.t_ns) > 0).all()):
        gravity = float(np.linalg.norm(settings.gravity))
        recording = recording._replace(
            readings=judge_readings(recording.readings, DEAD_RECKON, gravity)
        )
    if not isinstance(readings, Flight):
        if recording.truth is not None:
            DEAD_RECKON.judge(pose_findings(recording.truth), warn)
        release_memory()  # that of the findings
    recording = recording.after(skip)
    prefix = f"{readings}: " if isinstance(readings, str | PathLike) else ""
    for note in (*world.notes, *settings.warnings()):
        warn(f"{prefix}{note}", Remark)
    if isinstance(initial, NavigationState):
        return InitialCondition(recording, initial, correction_of(settings)), settings
    noise = readings.parameters.imu if isinstance(readings, Flight) else None
    return initial_condition(settings, recording, noise), settings


class ReadingsAndTruth(NamedTuple):
    """Readings with their truth."""

    readings: Readings
    truth: States | None

    def after(self, skip: float) -> ReadingsAndTruth:
        """Return the recording without its first seconds."""
        t_ns = self.readings.t_ns
        if not skip or not len(t_ns):
            return self
        return self.rows(t_ns >= t_ns[0] + round(skip * 1e9))

    def rows(self, rows: Mask | slice) -> ReadingsAndTruth:
        """Return the recording with some of its readings."""
        return self._replace(readings=self.readings.rows(rows))


class InitialCondition(NamedTuple):
    """Initial state of the integration, and the recording from there on."""

    recording: ReadingsAndTruth
    """Readings and truth from the start on."""
    state: NavigationState
    """State of the body."""
    correction: Correction
    rate: Array | None = None
    """(3,) rate of the body relative to the world [rad/s]; None: that of the readings."""
    covariance: Covariance | None = None
    """Covariance of the error of the IMU's state after a rest; None: the state is exact."""


def _recording(
    readings: Flight | Readings | str | Path,
    imu_topic: str | None,
    truth_topic: str | None,
    skip_bad_rows: bool,
    selection: Selection = NOTHING,
) -> ReadingsAndTruth:
    """Return readings and truth of a flight, of arrays or of a file."""
    if isinstance(readings, str | PathLike):
        path = checked_path("readings", readings, BAG_OR_FILE)
        truth_topic = checked_topic("truth_topic", truth_topic)
        return read_recording(path, imu_topic, truth_topic, skip_bad_rows, selection)
    checked_topic("truth_topic", truth_topic, of_a_file=False)
    imu_readings = readings_of("readings", readings, imu_topic, "imu_topic", selection=selection)
    return ReadingsAndTruth(imu_readings, readings.truth if isinstance(readings, Flight) else None)


def read_recording(
    path: Path,
    imu_topic: str | None = None,
    truth_topic: str | None = None,
    skip_bad_rows: bool = False,
    selection: Selection = NOTHING,
) -> ReadingsAndTruth:
    """Return the readings of a file, and its truth if it has one.

    :raises InputError: for what cannot be read.
    """
    readings = readings_of("readings", path, imu_topic, "imu_topic", skip_bad_rows, selection)
    truth = None
    if truth_topic is not None or tracks.has_truth(path):
        topic = tracks.assume_truth_topic(path, truth_topic)
        states = read_states(truth_file(path) or path, topic, skip_bad_rows)
        truth = replace_fields(states, source=name_of(path))
        if truth.skipped:
            tell_skipped(f"the truth of {path}")(truth.skipped)
    return ReadingsAndTruth(readings, truth)


def _world(readings: object, imu_topic: str | None, truth_topic: str | None) -> KnownWorld:
    """Return the known gravity and rotation of the world."""
    if isinstance(readings, Flight):
        return world_of_simulation(readings.parameters)
    if isinstance(readings, str | PathLike):
        return read_world(Path(readings), imu_topic, truth_topic)
    return KnownWorld({})


def read_world(path: Path, imu_topic: str | None, truth_topic: str | None) -> KnownWorld:
    """Return the world of a file; the topics are those of :func:`read_recording`."""
    has_truth = truth_topic is not None or tracks.has_truth(path)
    topic = tracks.truth_topic(path, truth_topic) if has_truth else None
    return worlds.read_world(path, imu_topic, topic, has_truth, has_topics(path))


def _settings(**parameters: object) -> IntegratorParameters:
    """Return checked parameters of the integrator."""
    return load_integrator(parameters)


_usual_settings = cache(_settings)
"""Cached settings by their texts and choices alone, for many short records."""


def initial_condition(
    settings: IntegratorParameters,
    recording: ReadingsAndTruth,
    noise: TriadsParameters | None = None,
) -> InitialCondition:
    """Return where integration begins, by ``initial_state``.

    :param noise: errors of the sensor, for a rest; None: those of the settings.
    :raises InputError: without the truth at which to start, and for a rest that is none.
    """
    readings, truth = recording.readings, recording.truth
    if not len(readings):
        raise InputError("0 readings: integration needs at least two")
    if settings.initial_state == "parameters":
        return InitialCondition(
            recording, initialisation.parameter_state(settings), correction_of(settings)
        )
    if settings.initial_state == "truth":
        if truth is None:
            raise _no_truth(readings.source)
        late = readings.t_ns < _first_common_stamp(
            readings.t_ns, truth.t_ns, _max_gap(settings, readings)
        )
        if late.any():
            recording = recording.rows(~late)
        first_ns = recording.readings.t_ns[0]
        state, correction = state_at(truth.in_order(), int(first_ns)), correction_of(settings)
        return InitialCondition(recording, state, correction, _true_rate(truth, int(first_ns)))
    rest = initialisation.rest_rows(settings, readings.t_ns)
    start_ns = int(readings.t_ns[rest.stop - 1])
    position = yaw = None
    if truth is not None:
        begin_ns = int(readings.t_ns[rest.start])
        resting = truth.rows((truth.t_ns >= begin_ns) & (truth.t_ns <= start_ns))
        if len(resting):
            initialisation.check_true_rest(resting.position, resting.q_wb)
    if truth is not None and truth.t_ns[0] <= start_ns <= truth.t_ns[-1]:
        state = state_at(truth.in_order(), start_ns)
        position, yaw = state.position, float(to_euler(state.q_wb)[2])
    gyro, accel = readings.rows(rest).triads()
    initial = initialisation.from_rest(
        settings, gyro, accel, position=position, yaw=yaw, noise=noise
    )
    after_rest = recording.rows(slice(rest.stop - 1, None))
    return InitialCondition(
        after_rest, initial.state, initial.correction, initial.rate, initial.covariance
    )


def _max_gap(settings: IntegratorParameters, readings: Readings) -> float:
    """Return the longest interval that is integrated [s]."""
    return gap_length(settings.max_gap, READINGS_GAP, readings.t_ns)


def _true_rate(truth: States, t_ns: int) -> Array | None:
    """Return the rate of the body (3,) at one time; None for a truth without rates, as EuRoC's."""
    if truth.angular_velocity is None:
        return None
    return interpolate_vectors(truth.t_ns, truth.angular_velocity, np.array([t_ns]))[0]


def _no_truth(source: str) -> InputError:
    """Return the error of a start at the truth without one.

    Levelling is never chosen silently: a body that moves would be levelled by its acceleration.
    """
    return InputError(
        f"{source}: no truth to start from or to compare with; a body that rests at first can "
        f"start level ({argument('initial', 'level')}), any other at given "
        "parameters"
    )


def _first_common_stamp(t_ns: Times, truth_ns: Times, tolerance: float) -> int:
    """Return the stamp from which readings have a truth.

    :param tolerance: seconds of readings that may come before it.
    :raises InputError: for more readings before it, and for a truth of another time.
    """
    begin_ns, end_ns = int(truth_ns[0]), int(truth_ns[-1])
    late = (begin_ns - int(t_ns[0])) * 1e-9
    if begin_ns > t_ns[-1] or end_ns < t_ns[0]:
        raise InputError(
            "readings and truth do not overlap in time: the readings span "
            f"{t_ns[0] / 1e9:.3f} to {t_ns[-1] / 1e9:.3f} s, the truth from "
            f"{begin_ns / 1e9:.3f} to {end_ns / 1e9:.3f} s"
        )
    if late > tolerance:
        skip = argument("skip", math.ceil(late * 1e3) / 1e3, "s")
        raise InputError(
            f"the truth starts {late:.6g} s after the readings: leave these out ({skip}), or "
            "start level"
        )
    return begin_ns


def integrate_from(start: InitialCondition, settings: IntegratorParameters) -> Track:
    """Return the states integrated from an initial condition."""
    readings, truth = start.recording
    states = integrate(
        readings.t_ns,
        *readings.triads(),
        start.state,
        settings.method,
        settings.attitude_update,
        settings.gravity,
        start.correction,
        _max_gap(settings, readings),
        settings.earth_rate,
        mount_of(settings.imu),
        start.rate,
    )
    return track_of(
        replace_fields(states, source=readings.source),
        settings.method,
        settings.attitude_update,
        truth,
        settings.initial_state,
        readings.notes,
    )


def track_of(
    states: States,
    method: str,
    attitude_update: str,
    truth: States | None,
    initial_state: str = "truth",
    notes: tuple[str, ...] = (),
) -> Track:
    """Return integrated states with how they were integrated; arguments as in :class:`Track`."""
    return Track.unchecked(
        t_ns=states.t_ns,
        position=states.position,
        q_wb=states.q_wb,
        velocity=states.velocity,
        source=states.source,
        method=method,
        attitude_update=attitude_update,
        truth=truth,
        initial_state=initial_state,
        notes=notes,
    )


def _covariance(source: object, track: Track, start: InitialCondition, mount: ImuMount) -> Array:
    """Return the covariance (n, 6, 6) of the poses from an exact start, or from a rest."""
    if not isinstance(source, Flight):
        raise InputError(
            f"{argument_prefix('covariance')}: the sensor's errors are known of a flight alone"
        )
    imu = source.parameters.imu
    initial: Array | Covariance = initial_covariance(
        gyroscope_bias=imu.gyroscope.turn_on_bias_sigma,
        accelerometer_bias=imu.accelerometer.turn_on_bias_sigma,
    )
    if start.covariance is not None:
        initial = start.covariance
    readings = start.recording.readings
    force = start.correction.apply(*readings.triads())[1]
    rows = range(len(track))
    covariance = propagate(track, force, imu, initial, rows, mount)
    return covariance[:, _POSE[:, None], _POSE]


def _plain(values: Mapping[str, object]) -> dict[str, object]:
    """Return values with lists in place of arrays, for JSON."""
    return {n: v.tolist() if hasattr(v, "tolist") else v for n, v in values.items()}


def lines(summaries: Sequence[JsonObject]) -> Iterator[str | TextTable]:
    """Yield the text of tracks of one recording: their dictionaries in a line and a table."""
    first_summary = summaries[0]
    yield from input_lines(first_summary["notes"])
    yield (
        f"{first_summary['samples']} readings, {first_summary['duration_s']:.6g} s, "
        f"{first_summary['distance_m']:.6g} m travelled, "
        f"initial state: {first_summary['initial_state']}"
    )
    partial = truth_line(first_summary)
    if partial is not None:
        yield partial
    columns = {
        "pos. [m]": "final_position_error_m",
        "% of path": "final_position_error_percent",
        "rms [m]": "rms_position_error_m",
        "v [m/s]": "final_velocity_error_m_s",
        "att. [rad]": "final_attitude_error_rad",
    }
    rows = [
        [summary["method"], summary["attitude_update"]]
        + ["-" if summary[key] is None else f"{summary[key]:.4g}" for key in columns.values()]
        for summary in summaries
    ]
    title = "Final errors against the truth; rms: position over the run"
    yield TextTable(["method", "attitude", *columns], rows, title)
