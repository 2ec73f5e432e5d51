# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning of readings, and a trajectory against a truth."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.arguments import array, number, one_of, refuse, switch
from imu_sim_ros.arguments import path as checked_path
from imu_sim_ros.arguments import topic as checked_topic
from imu_sim_ros.conventions import GRAVITY, TRUTH_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs import tracks
from imu_sim_ros.jobs.attitude import AttitudeEvaluation, evaluate_attitude, has_attitude_alone
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.output import saved
from imu_sim_ros.jobs.readings import (
    BAG_OR_FILE,
    HasPoses,
    Odometry,
    Readings,
    checked_poses,
    frame,
    read_odometry,
)
from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.association import (
    ALIGNMENTS,
    common_rows,
    interpolate_poses,
    interpolate_vectors,
)
from imu_sim_ros.navigation.association import align as laid_on
from imu_sim_ros.navigation.covariance import ATTITUDE, POSITION, initial_covariance, propagate
from imu_sim_ros.navigation.dead_reckoning import dead_reckon as integrate
from imu_sim_ros.navigation.evaluation import (
    DELTA_UNITS,
    AbsoluteErrors,
    RelativeErrors,
    absolute_errors,
    distances,
    pairs,
    relative_errors,
    stated_nees,
    why_no_nees,
)
from imu_sim_ros.navigation.noise import noise_of
from imu_sim_ros.navigation.parameters import IntegratorParameters, layer_integrator
from imu_sim_ros.navigation.state import (
    Correction,
    NavigationState,
    NavigationStates,
    correction_of,
)
from imu_sim_ros.parameters.files import build_layered
from imu_sim_ros.poses import PoseSequence, write_tum
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gravity import earth_rate_vector, gravity_vector
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure
from imu_sim_ros.timebase import span

_POSE: Final = np.r_[POSITION, ATTITUDE]


@dataclass(frozen=True, repr=False)
class Track:
    """A dead-reckoned trajectory."""

    t_ns: Times
    """(n,) stamps of the readings [ns]."""
    position: Array
    """(n, 3) p_wb [m]."""
    velocity: Array
    """(n, 3) of the body in the world [m/s]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    method: str
    attitude_update: str
    covariance: Array | None = None
    """(n, 6, 6) of position [m] and attitude [rad], both in the world's axes; see `dead_reckon`."""
    truth: Odometry | None = None
    """The truth that came with the readings."""
    name: str = ""
    """Of the readings' sensor or file, for titles."""

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<Track {self.method}, {self.attitude_update}: {span(self.t_ns)}>"

    def to_frame(self) -> Any:
        """Return a pandas DataFrame: index t_ns, columns position_x, q_w, velocity_x, ...

        :raises MissingDependencyError: without pandas.
        """
        columns = {"position": self.position, "q": self.q_wb, "velocity": self.velocity}
        return frame(self.t_ns, columns)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the poses in TUM format; returns the path.

        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        with saved(path, force) as place:
            write_tum(place, PoseSequence(self.t_ns, self.position, self.q_wb))
        return Path(path)

    def plot(self) -> Figure:
        """Return a matplotlib figure: the path, with the truth if there is one."""
        from imu_sim_ros.plots import navigation as pictures

        name = f"{self.method}, {self.attitude_update}"
        sensor, _, motion = self.name.partition(" on ")
        of = f"IMU {sensor}, trajectory {motion}" if motion else self.name
        title = f"{of}: dead reckoning" if of else "Dead reckoning"
        if self.truth is None:
            return pictures.trajectories({name: self.position}, None, {}, {}, title)
        found = evaluate(self, self.truth)
        t = (found.t_ns - found.t_ns[0]) * 1e-9
        return pictures.trajectories(
            {name: self.position},
            self.truth.position,
            {name: (t, np.linalg.norm(found.position, axis=1))},
            {name: (t, np.linalg.norm(found.attitude, axis=1))},
            f"{title} against the truth",
        )


def dead_reckon(
    readings: Flight | Readings | str | Path,
    *,
    method: str = "midpoint",
    attitude_update: str = "so3",
    initial: str | NavigationState | None = None,
    imu_topic: str | None = None,
    covariance: bool = False,
    **parameters: Any,
) -> Track:
    """Integrate readings to a trajectory.

    :param readings: a flight, readings, or a file that :func:`imu_sim_ros.read_imu` reads.
    :param method: euler, midpoint or rk4.
    :param attitude_update: quaternion, so3 or euler_angles.
    :param initial: the state at the first reading, ``"truth"``, ``"level"`` (roll, pitch and the
        gyroscope's bias from a rest of ``level_time``), or ``"parameters"`` (``initial_position``
        and so on). By default the truth.
    :param imu_topic: of a bag with several.
    :param covariance: of the poses as well, of a flight from an exact start.
    :param parameters: of the node integrator by their ROS names: ``gravity``, ``gyroscope_bias``,
        ``accelerometer_scale_misalignment``, ``level_time``, ``max_gap``, ...
    :returns: a :class:`Track`: the states at the readings' times.
    :raises ConfigurationError: with a line for every parameter that is wrong.
    :raises InputError: for readings that cannot be integrated, or that have no truth to start at.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="perfect", trajectory="lecture", duration=20, rate=200)
    >>> track = ims.dead_reckon(flight, method="midpoint")
    >>> round(ims.evaluate(track, flight.truth).final_position, 5)
    0.00129
    """
    if initial is not None and not isinstance(initial, NavigationState):
        one_of("initial", initial, ("truth", "level", "parameters", "a NavigationState"))
    switch("covariance", covariance)
    track, truth = _source(readings, imu_topic)
    parameters = {**_world(readings), **parameters}
    initial = initial or "truth"
    name = initial if isinstance(initial, str) else "parameters"
    usual = not parameters and isinstance(method, str) and isinstance(attitude_update, str)
    settings = (_usual_settings if usual else _settings)(
        method, attitude_update, name, **_plain(parameters)
    )
    if isinstance(initial, NavigationState):
        start, correction = initial, correction_of(settings)
    else:
        track, start, correction = _start(settings, track, truth)
    words = (settings.method, settings.attitude_update)
    states = _integrated(track, start, correction, settings)
    stated = _covariance(readings, states, track, correction) if covariance else None
    return Track(*states, *words, stated, truth, track.name)


def _integrated(
    track: Readings, start: NavigationState, correction: Correction, p: IntegratorParameters
) -> NavigationStates:
    rows, words = (track.t_ns, track.gyro, track.accel), (p.method, p.attitude_update)
    return integrate(*rows, start, *words, p.gravity, correction, p.max_gap, p.earth_rate)


def _covariance(
    readings: object, states: NavigationStates, track: Readings, correction: Correction
) -> Array:
    """Return the covariance (n, 6, 6) of the poses from an exact start."""
    if not isinstance(readings, Flight):
        raise InputError("covariance: the sensor's errors are known of a flight alone")
    imu = readings.parameters.imu
    initial = initial_covariance(
        gyroscope_bias=imu.gyroscope.turn_on_bias_sigma,
        accelerometer_bias=imu.accelerometer.turn_on_bias_sigma,
    )
    rows = range(len(states.t_ns))
    force = correction.apply(track.gyro, track.accel)[1]
    return propagate(states, force, noise_of(imu), initial, rows)[:, _POSE[:, None], _POSE]


def _world(readings: object) -> dict[str, Any]:
    """Return gravity and the Earth's rate where readings were simulated with other than usual ones.

    Those of a file are found in the realised truth next to it.
    """
    if isinstance(readings, Flight):
        flight: EnvironmentParameters | None = readings.parameters
    elif isinstance(readings, str | PathLike):
        from imu_sim_ros.datasets.truth_files import world_of  # most readings are at hand

        flight = world_of(Path(readings))
    else:
        flight = None
    if flight is None:
        return {}
    if flight.curved_earth:
        warnings.warn(CURVED_EARTH, stacklevel=3)
    return world_parameters(flight)


CURVED_EARTH: Final = (
    "simulated over a curved Earth, which is integrated as a plane: the errors include what the "
    "local level turns and gravity changes along the way"
)


def world_parameters(world: EnvironmentParameters) -> dict[str, Any]:
    """Return what dead reckoning has to know of a world, where it is not the usual one."""
    gravity, rate = gravity_vector(world).tolist(), earth_rate_vector(world).tolist()
    found = {"gravity": gravity} if tuple(gravity) != GRAVITY else {}
    return {**found, "earth_rate": rate} if any(rate) else found


def _settings(
    method: str, attitude_update: str, initial: str, **parameters: object
) -> IntegratorParameters:
    given = {"method": method, "attitude_update": attitude_update, "initial_state": initial}
    return build_layered(IntegratorParameters, layer_integrator, {**parameters, **given})


_usual_settings = cache(_settings)
"""Without parameters: many short records are integrated alike."""


def _source(
    readings: Flight | Readings | str | Path, topic: str | None
) -> tuple[Readings, Odometry | None]:
    found = readings_of("readings", readings, topic, "imu_topic")
    if isinstance(readings, Flight):
        return found, readings.truth
    if isinstance(readings, Readings):
        return found, None
    try:
        return found, read_odometry(readings, TRUTH_TOPIC)
    except InputError:  # no truth besides the readings
        return found, None


def _start(
    settings: IntegratorParameters, readings: Readings, truth: Odometry | None
) -> tuple[Readings, NavigationState, Correction]:
    """Return the readings from the start on, the state there and the readings' correction."""
    if settings.initial_state == "parameters":
        state = initialisation.given_state(settings)
        return readings, state, correction_of(settings)
    if settings.initial_state == "truth":
        if truth is None:
            raise initialisation.without_truth(
                readings.name, "initial='level', initial='parameters' or a NavigationState"
            )
        rows = readings.t_ns >= truth.t_ns[0]
        if not rows.all():
            readings = _rows(readings, rows)
        return readings, _state(truth, readings.t_ns[:1]), correction_of(settings)
    rest = initialisation.rest_rows(settings, readings.t_ns)
    found = initialisation.from_rest(settings, readings.gyro[rest], readings.accel[rest])
    return _rows(readings, slice(rest.stop - 1, None)), found.state, found.correction


def _state(truth: Odometry, at_ns: Times) -> NavigationState:
    poses = interpolate_poses(checked_poses("truth", truth), at_ns)
    velocity = interpolate_vectors(truth.t_ns, truth.velocity, at_ns)
    return NavigationState(poses.position[0], velocity[0], poses.q_wb[0])


def _rows(readings: Readings, rows: NDArray[np.bool_] | slice) -> Readings:
    return Readings(readings.t_ns[rows], readings.gyro[rows], readings.accel[rows], readings.name)


def _plain(values: Mapping[str, Any]) -> dict[str, object]:
    return {n: v.tolist() if hasattr(v, "tolist") else v for n, v in values.items()}


@dataclass(frozen=True, repr=False)
class Evaluation:
    """The errors of an estimate, truth minus estimate, at the m times that both have."""

    t_ns: Times
    """(m,) [ns]."""
    position: Array
    """(m, 3) in the world [m]."""
    attitude: Array
    """(m, 3) rotation vectors about the world's axes [rad]."""
    velocity: Array | None
    """(m, 3) in the world [m/s]; None where either has no velocity."""
    distance: float
    """Length of the true path [m]."""
    estimate: PoseSequence
    """The aligned estimate."""
    truth: PoseSequence
    """The truth at the same times."""
    nees: dict[str, Any] | None = None
    """``position`` and ``attitude``, each with ``mean``, ``final`` and ``inside_band``, as the
    command has them; None where the estimate states no covariance that allows it, see `no_nees`."""
    no_nees: str | None = None
    """Why there is no NEES."""

    def __repr__(self) -> str:
        return (
            f"<Evaluation of {len(self.t_ns)} poses, {self.distance:.4g} m: "
            f"position {self.rms_position:.4g} m rms, attitude {self.rms_attitude:.4g} rad rms>"
        )

    @property
    def rms_position(self) -> float:
        """Root mean square of the position errors [m]: the absolute trajectory error, ATE."""
        return _rms(self.position)

    @property
    def rms_attitude(self) -> float:
        """Root mean square of the attitude errors [rad]."""
        return _rms(self.attitude)

    @property
    def rms_velocity(self) -> float | None:
        """Root mean square of the velocity errors [m/s]."""
        return None if self.velocity is None else _rms(self.velocity)

    @property
    def final_position(self) -> float:
        """Length of the last position error [m]."""
        return float(np.linalg.norm(self.position[-1]))

    @property
    def final_attitude(self) -> float:
        """Length of the last attitude error [rad]."""
        return float(np.linalg.norm(self.attitude[-1]))

    def relative(self, delta: float, unit: str = "s") -> RelativeErrors:
        """Return the relative pose errors (RPE).

        :param delta: > 0.
        :param unit: s, m (along the truth's path) or frames.
        :raises InputError: where the trajectory is shorter than delta.
        """
        number("delta", delta, f"above 0 {unit}", 0.0, above=True)
        one_of("unit", unit, DELTA_UNITS)
        return relative_errors(self.estimate, self.truth, *pairs(self.truth, delta, unit))

    def plot(self) -> Figure:
        """Return a matplotlib figure: both paths, and the errors per axis over time."""
        from imu_sim_ros.plots import navigation as pictures

        t = (self.t_ns - self.t_ns[0]) * 1e-9
        title = f"Estimate against the truth: {self.distance:.4g} m, ATE {self.rms_position:.4g} m"
        positions = (self.estimate.position, self.truth.position, self.position)
        return pictures.evaluation(t, *positions, self.attitude, title)


class HasAttitude(Protocol):
    """Anything with attitudes in time: orientations of a board, or an object with ``q_wb``."""

    @property
    def t_ns(self) -> Times:
        """(n,) [ns]."""


@overload
def evaluate(  # type: ignore[overload-overlap]  # what has positions is compared as a path
    estimate: HasPoses | str | Path,
    truth: HasPoses | str | Path,
    *,
    align: str = ...,
    max_gap: float = ...,
    estimate_topic: str | None = ...,
    truth_topic: str | None = ...,
) -> Evaluation: ...


@overload
def evaluate(
    estimate: HasAttitude,
    truth: HasPoses | str | Path,
    *,
    align: str = ...,
    max_gap: float = ...,
    estimate_topic: str | None = ...,
    truth_topic: str | None = ...,
) -> AttitudeEvaluation: ...


def evaluate(
    estimate: Any,
    truth: HasPoses | str | Path,
    *,
    align: str = "none",
    max_gap: float = 0.5,
    estimate_topic: str | None = None,
    truth_topic: str | None = None,
) -> Evaluation | AttitudeEvaluation:
    """Compare a trajectory, or attitudes alone, with the truth at the estimate's times.

    :param estimate: a track, odometry, or anything with ``t_ns``, ``position`` and ``q_wb``; a
        ``covariance`` (n, 6, 6) of position and attitude in the world's axes gives the NEES. Or the
        path of a TUM or EuRoC file or of a bag. Without positions (``q_wb``, ``q_wi`` or ``values``
        (n, 4), in the frame of the truth's body) attitudes are compared.
    :param truth: a path, or an object with ``t_ns``, ``position`` and ``q_wb``.
    :param align: align the estimate with the truth first: none, yaw, se3 or sim3.
    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param estimate_topic: of a bag with several trajectories.
    :param truth_topic: likewise; None: ``ground_truth/odom`` if the bag has it.
    :returns: an :class:`Evaluation`, for attitudes alone an :class:`AttitudeEvaluation`.
    :raises InputError: if they do not overlap in time, or a path cannot be read.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="navigation", trajectory="circle", duration=30, seed=1)
    >>> ims.evaluate(ims.dead_reckon(flight), flight.truth)
    <Evaluation of 6000 poses, 74.99 m: position 0.1208 m rms, attitude 3.995e-05 rad rms>
    >>> board = ims.simulate(imu="mti3", duration=10, sensors=["orientation"], seed=1)
    >>> ims.evaluate(board.orientation, board.truth)
    <AttitudeEvaluation of 2000 attitudes: tilt 0.02025 rad rms, heading 0.03832 rad rms>
    """
    number("max_gap", max_gap, "a number of seconds above 0", 0.0, above=True)
    one_of("align", align, ALIGNMENTS)
    truth = _recorded("truth", truth, truth_topic)
    if has_attitude_alone(estimate):
        if align != "none":
            refuse("align", align, "none: attitudes alone are not aligned")
        return evaluate_attitude(estimate, checked_poses("truth", truth), max_gap)
    return _compared(_recorded("estimate", estimate, estimate_topic), truth, align, max_gap)


def _compared(estimate: HasPoses, truth: HasPoses, align: str, max_gap: float) -> Evaluation:
    own, known = checked_poses("estimate", estimate), checked_poses("truth", truth)
    rows = common_rows(own.t_ns, known.t_ns, max_gap)
    t_ns = own.t_ns[rows]
    true = interpolate_poses(known, t_ns)
    given = PoseSequence(t_ns, own.position[rows], own.q_wb[rows])
    alignment = laid_on(given.position, true.position, align)
    poses = alignment.apply(given)
    errors: AbsoluteErrors = absolute_errors(poses, true)
    velocity, own_speed, true_speed = None, _speed("estimate", estimate), _speed("truth", truth)
    if own_speed is not None and true_speed is not None:
        aligned = alignment.scale * own_speed[rows] @ alignment.r.T
        velocity = interpolate_vectors(known.t_ns, true_speed, t_ns) - aligned
    length = float(distances(true.position)[-1])
    stated = getattr(estimate, "covariance", None)
    if stated is not None:
        stated = array("estimate.covariance", stated, (len(own.t_ns), 6, 6))[rows]
    found, why = None, why_no_nees(align, stated)
    if why is None and stated is not None:
        found = stated_nees(stated, given, true, align)
        why = "the estimate's covariances are singular" if found is None else None
    both = (errors.position, errors.attitude)
    return Evaluation(t_ns, *both, velocity, length, poses, true, found, why)


class _Recorded(NamedTuple):
    """A trajectory of a file, as :func:`evaluate` takes objects."""

    t_ns: Times
    position: Array
    q_wb: Array
    velocity: Array | None
    covariance: Array | None


def _recorded(name: str, given: Any, topic: str | None) -> HasPoses:
    """Return what a path leads to, or what is no path as it is."""
    of_a_file = isinstance(given, str | Path)
    topic = checked_topic(f"{name}_topic", topic, of_a_file)
    if not of_a_file:
        return given  # checked_poses looks at it
    place = checked_path(name, given, BAG_OR_FILE)
    chosen = tracks.truth_topic(place, topic) if name == "truth" else topic
    track = tracks.read_track(place, chosen, covariance=name == "estimate")
    poses = track.poses
    stated = track.pose_covariance
    return _Recorded(poses.t_ns, poses.position, poses.q_wb, track.velocity, stated)


def _speed(name: str, given: HasPoses) -> Array | None:
    speed = getattr(given, "velocity", None)
    return None if speed is None else array(f"{name}.velocity", speed, (len(given.t_ns), 3))


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
