# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Implausible poses: found before a spline is fitted, and repaired on request."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.recordings.arrival import even_times
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.findings.states import StateMeasures, poses_held
from imu_sim_ros.recordings.residuals import REACH, residuals, smallest_distance

_LEAST_POSES: Final = 30
"""Smallest number of poses that are repaired."""
_OFF: Final = 10.0
"""Typical deviations; normal noise does not reach it in 10^20 poses."""
_WINDOW: Final = 8
"""Poses on each side of a disturbance that are used to classify it."""
_SINGLE: Final = 3
"""Most poses that are left out of a disturbance before it is taken for a jump."""
_BENT: Final = 0.05
"""Fraction of a jump that its turn may leave uncorrected, since it bends all that follows."""
_DEGREES: Final = np.arange(6)
_ROUNDS: Final = 50
"""Largest number of rounds in which outliers and jumps are removed."""
_JOINS: Final = 3
"""Number of refinements of a jump's shift and turn."""


class Jump(NamedTuple):
    """A motion that continues elsewhere from one pose on."""

    row: int
    shift: Array
    """(3,) shift in the world [m]."""
    turn: Array
    """(3,) rotation vector in the world [rad]."""


class Disturbances(NamedTuple):
    """Recorded poses that no body moves through, by rows."""

    single: Integers
    """Outlying poses."""
    distance: Array
    """(k,) distance of each of them from the motion of its neighbours [m]."""
    angle: Array
    """(k,) angle between their attitudes and those of the neighbours [rad]."""
    jumps: list[Jump]
    scatter: float
    """Scatter of stamps that are times of arrival [s]; 0: they are not."""
    interval: float
    """Interval of the grid that they scatter about [s]."""
    repeated: Integers
    """Poses that repeat the one before while the body moves."""

    def __bool__(self) -> bool:
        """Return whether there are any disturbances."""
        return bool(len(self.single) or self.jumps or self.scatter or len(self.repeated))


class Mended(NamedTuple):
    """Repaired poses, and their disturbances."""

    t: Array
    """(n,) times at which they were taken, after the first stamp of the record [s]."""
    poses: States
    """(n,) poses without the outlying rows, as stamped; quaternions without jumps of sign."""
    disturbances: Disturbances


def repair_poses(poses: States) -> Mended:
    """Return the poses as a body may have moved through them.

    :param poses: (n,) recorded poses; stamps increase, quaternions have any sign.
    """
    poses = replace_fields(poses, q_wb=rotation.unwrap_signs(poses.q_wb))
    t, repeats = poses.t, _held_rows(poses)
    if not len(repeats):
        return _mend_moving(t, poses)
    rows = np.setdiff1d(np.arange(len(t)), repeats)
    # Steps of stamps in whole milliseconds are none of them the interval of the log.
    log_step = estimate_clock(poses.t_ns).interval_ns * 1e-9
    rest = _mend_moving(t[rows], poses.rows(rows), log_step)
    jumps = [jump._replace(row=int(rows[jump.row])) for jump in rest.disturbances.jumps]
    single = rows[rest.disturbances.single]
    return rest._replace(
        disturbances=rest.disturbances._replace(single=single, jumps=jumps, repeated=repeats)
    )


def _mend_moving(t: Array, poses: States, log_step: float = 0.0) -> Mended:
    """Return poses (n,), of which none is held, mended.

    :param t: (n,) times at which they were stamped [s].
    :param log_step: as in :func:`even_times`.
    """
    nothing = np.zeros(0, dtype=np.int64)
    if len(t) < _LEAST_POSES:
        none = Disturbances(nothing, np.zeros(0), np.zeros(0), [], 0.0, 0.0, nothing)
        return Mended(t, poses, none)
    times, scatter, interval = even_times(t, poses.position, poses.q_wb, log_step)
    return _remove_disturbances(times, poses, scatter, interval)


def _remove_disturbances(t: Array, poses: States, scatter: float, interval: float) -> Mended:
    """Return poses (n,) without outliers and jumps.

    :param t: (n,) times at which they were taken [s].
    :param scatter, interval: as in :class:`Disturbances`.
    """
    nothing = np.zeros(0, dtype=np.int64)
    rows = np.arange(len(t))
    single: list[int] = []
    jumps: list[Jump] = []
    smallest = smallest_distance(t, poses.position)
    for _ in range(_ROUNDS):
        times, rest = t[rows], poses.rows(rows)
        deviations = residuals(times, rest.position, rest.q_wb, smallest)
        off = deviations.largest
        if np.max(off) <= _OFF:
            break
        for first, last in reversed(_clusters(np.flatnonzero(off > _OFF))):
            dropped, jump = _explain_disturbance(times, rest, deviations.usual, first, last)
            if jump is not None:  # all that follows is moved as a whole, so the last comes first
                jumps.append(jump._replace(row=int(rows[jump.row])))
                poses = _join_all(poses, rows, times, deviations.usual, jump)
                rest = poses.rows(rows)
                continue
            if not len(dropped):
                dropped = np.array([first + int(np.argmax(off[first : last + 1]))])
            single += rows[dropped].tolist()
        rows = np.setdiff1d(rows, single)
    outliers = np.array(sorted(single), dtype=np.int64)
    distance, angle = _distances_from_neighbours(t, poses, rows, outliers)
    disturbances = Disturbances(
        outliers, distance, angle, sorted(jumps, key=_row), scatter, interval, nothing
    )
    return Mended(t[rows], poses.rows(rows), disturbances)


def _held_rows(poses: States) -> Integers:
    """Return the rows that repeat the pose before while the body moves.

    A body that stands is one long run, which stays.
    """
    measures = StateMeasures(poses)
    if not any(poses_held.find(measures)):
        return np.zeros(0, dtype=np.int64)
    starts, lengths = measures.runs
    short = lengths <= 10.0 * np.median(lengths)
    repeats = np.repeat(short, lengths)
    repeats[starts] = False
    return np.flatnonzero(repeats)


def _row(jump: Jump) -> int:
    """Return the row of a jump, to sort by."""
    return jump.row


def _clusters(rows: Integers) -> list[tuple[int, int]]:
    """Return the first and last row of each group of rows close enough to affect each other."""
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 2 * REACH) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]


def _explain_disturbance(
    t: Array, poses: States, usual: Array, begin: int, end: int
) -> tuple[Integers, Jump | None]:
    """Return rows to leave out, or a jump, that explain a disturbance; nothing if neither does.

    What is left must follow a polynomial of degree 5. A jump has as many unknowns as one pose left
    out, so the better of the two holds; then come more poses in a row.
    """
    window = np.arange(max(begin - _WINDOW, 0), min(end + _WINDOW + 1, len(t)))
    values, columns = _scale(t, poses, usual, window)

    def best(length: int) -> tuple[float, int, float]:
        """Return the residual without ``length`` poses (0: with a jump), their row, the jump.

        The jump's size is in usual deviations, too.
        """
        explanation = (np.inf, begin, 0.0)
        # A jump may also be behind the last, if there is a pose.
        for start in range(begin, min(end + 2 - length, len(t))):
            out = (window >= start) & (window < start + length)
            step = [] if length else [window >= start]
            remainder, solution = _fit_distance(np.column_stack([columns, *step]), values, ~out)
            explanation = min(explanation, (remainder, start, float(np.linalg.norm(solution[-1]))))
        return explanation

    nothing = np.zeros(0, dtype=np.int64)
    jumped, row, size = best(0)
    is_jump = jumped <= max(_OFF, _BENT * size)
    for length in range(1, end - begin + 2):
        if length == _SINGLE + 1 and is_jump:
            break
        remainder, start, _ = best(length)
        if remainder <= min(_OFF, jumped):
            return np.arange(start, start + length), None
    return nothing, _step(t, poses, usual, window, row) if is_jump else None


def _step(t: Array, poses: States, usual: Array, window: Integers, row: int) -> Jump:
    """Return the jump ahead of a row: the step of a polynomial with a step there.

    :param usual: (n, 2) usual deviations of position [m] and attitude [rad].
    :param window: (k,) rows around the jump.
    """
    values, powers = _scale(t, poses, usual, window)
    columns = np.column_stack([powers, window >= row])
    _, coefficients = _fit_distance(columns, values, window >= 0)
    change = coefficients[-1] * np.repeat(np.median(usual[window], axis=0), 3)
    return Jump(row, change[:3], rotation.rotate(poses.q_wb[window[0]], change[3:]))


def _scale(t: Array, poses: States, usual: Array, window: Integers) -> tuple[Array, Array]:
    """Return the motion (k, 6) since the window's start in usual deviations, and powers of time.

    :param usual: (n, 2) usual deviations of position [m] and attitude [rad].
    :param window: (k,) rows.
    :returns: positions and rotation vectors (k, 6), and the columns (k, m) of a polynomial in the
        time, which goes from -1 to 1.
    """
    times = t[window]
    scaled_times = 2.0 * (times - times[0]) / (times[-1] - times[0]) - 1.0
    start = rotation.conjugate(poses.q_wb[window[0]])
    turns = rotation.log(rotation.multiply(start, poses.q_wb[window]))
    scale = np.repeat(np.median(usual[window], axis=0), 3)
    shifts = poses.position[window] - poses.position[window[0]]
    return np.column_stack([shifts, turns]) / scale, scaled_times[:, None] ** _DEGREES


def _fit_distance(columns: Array, values: Array, keep: Mask) -> tuple[float, Array]:
    """Return the largest residual of a least-squares fit, and its coefficients (m, 6).

    :param columns: (k, m) functions of time that are fitted.
    :param values: (k, 6) positions and rotation vectors in usual deviations.
    :param keep: (k,) True for the rows that take part.
    """
    rows = columns[keep]
    coefficients = np.asarray(np.linalg.lstsq(rows, values[keep], rcond=None)[0], dtype=np.float64)
    residual = rows @ coefficients - values[keep]
    # Positions and rotation vectors apart: the lengths of two vectors for each row.
    lengths = np.linalg.norm(residual.reshape(-1, 2, 3), axis=-1)
    return float(np.max(lengths)), coefficients


def _join_all(poses: States, rows: Integers, t: Array, usual: Array, jump: Jump) -> States:
    """Return all poses, joined at a jump; repeatedly, as large rotations are nonlinear.

    :param rows: (m,) rows that are no outliers; the jump's row is one of these.
    :param t: (m,) times of these rows [s].
    """
    window = np.arange(max(jump.row - _WINDOW, 0), min(jump.row + _WINDOW + 1, len(rows)))
    for _ in range(_JOINS):
        poses = _join_at_jump(poses, jump._replace(row=int(rows[jump.row])))
        jump = _step(t, poses.rows(rows), usual, window, jump.row)
    return poses


def _join_at_jump(poses: States, jump: Jump) -> States:
    """Return the poses, moved from the jump on so that the motion continues."""
    rows = slice(jump.row, None)
    position, q_wb = poses.position.copy(), poses.q_wb.copy()
    back = rotation.exp(-jump.turn)
    joint = position[jump.row] - jump.shift
    position[rows] = joint + rotation.rotate(back, position[rows] - jump.shift - joint)
    q_wb[rows] = rotation.unwrap_signs(rotation.multiply(back, q_wb[rows]))
    return replace_fields(poses, position=position, q_wb=q_wb)


def _distances_from_neighbours(
    t: Array, poses: States, rows: Integers, outliers: Integers
) -> tuple[Array, Array]:
    """Return how far poses (k,) lie from the straight line between their neighbours that stay."""
    if not len(outliers):
        return np.zeros(0), np.zeros(0)
    single, rest = poses.rows(outliers), poses.rows(rows)
    position, q_wb = (
        np.column_stack([np.interp(t[outliers], t[rows], axis) for axis in values.T])
        for values in (rest.position, rest.q_wb)
    )
    between = rotation.multiply(rotation.conjugate(rotation.normalise(q_wb)), single.q_wb)
    return (
        np.linalg.norm(single.position - position, axis=1),
        np.linalg.norm(rotation.log(between), axis=1),
    )


_LARGEST_ACCELERATION: Final = 160.0
"""[m/s^2] 16 g, the widest range of consumer sensors; vehicles and people stay below."""
_LARGEST_RATE: Final = 35.0
"""[rad/s] 2000 deg/s, the widest range of consumer sensors."""


def impossible_motion_lines(
    file: str, acceleration: float, acceleration_at: float, rate: float, rate_at: float
) -> list[str]:
    """Return a line for each peak of a spline that no body carrying an IMU could reach.

    :param acceleration: largest acceleration [m/s^2], at the time ``acceleration_at`` [s].
    :param rate: largest angular rate [rad/s], at the time ``rate_at`` [s].
    """
    return [
        f"{file}: {value:.4g} {unit} at {time_s:.3f} s is more than a body carrying an IMU reaches "
        f"({limit:g} {unit}): the poses are not a plausible motion there"
        for value, time_s, limit, unit in (
            (acceleration, acceleration_at, _LARGEST_ACCELERATION, "m/s^2"),
            (rate, rate_at, _LARGEST_RATE, "rad/s"),
        )
        if value > limit
    ]
