# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about recorded poses: rate, order, axes, and a twist that contradicts them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import blocks
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.recordings.findings.finding import Evidence, check
from imu_sim_ros.recordings.order import usual_step

_FEWEST: Final = 20
"""Poses from which on they are judged."""
_HELD: Final = 0.1
"""Share of poses that stand more than once in a row, from which on poses are held."""
_DIGITS: Final = 3.0
"""Usual step after equal poses over the smallest one, below which rounding makes them equal."""
_LONG: Final = 3.0
"""Step between poses, over the usual one, across which no velocity is computed."""
_SPAN: Final = 0.25
"""Duration of the motion with which a twist is compared [s]."""
_SLOWEST: Final = 0.02
"""Speed or angular rate below which a twist is not compared with the poses [m/s, rad/s]."""
_CLEAR: Final = 5.0
"""Motion from which on a twist is compared, over the motion that noise of the poses makes."""
_COMPARED: Final = 8
"""Poses from which on their interval is judged, and a twist is compared with them."""
_AGREES: Final = 0.3
"""Deviation of a velocity from that of the poses, as a share, up to which they agree."""
_SPARSE: Final = 0.5
"""Interval of poses from which on they leave out motion that an IMU measures [s]."""
_PATH: Final = 5.0
"""Path from which on the direction of travel tells a body's axes [m]."""


class StateMeasures:
    """Poses of a body with their velocities, each computed once."""

    def __init__(self, states: States) -> None:
        """Initialise with poses."""
        self.states = states

    @cached_property
    def interval(self) -> float:
        """Usual time between two poses [s]; 0 if no stamps increase."""
        return usual_step(self.states.t_ns) * 1e-9

    @cached_property
    def changes(self) -> Mask:
        """(n,) True for each pose that differs from the one before."""
        states = self.states
        changes = np.ones(len(states), np.bool_)
        for rows in blocks(len(states) - 1):
            ends = slice(rows.start, rows.stop + 1)
            moves = np.any(np.diff(states.position[ends], axis=0) != 0.0, axis=1)
            moves |= np.any(np.diff(states.q_wb[ends], axis=0) != 0.0, axis=1)
            changes[rows.start + 1 : rows.stop + 1] = moves
        return changes

    @cached_property
    def runs(self) -> tuple[Integers, Integers]:
        """First rows (k,) of runs of equal poses, and their lengths."""
        starts = np.flatnonzero(self.changes)
        return starts, np.diff(np.append(starts, len(self.states)))

    @cached_property
    def regular(self) -> Mask:
        """(n - 1,) True for each step over which a velocity can be computed."""
        steps = np.diff(self.states.t_ns) * 1e-9
        return (steps > 0.0) & (steps < _LONG * self.interval)

    @cached_property
    def velocity(self) -> Array:
        """(m, 3) velocity by the positions over each regular step, in the world [m/s]."""
        steps = np.diff(self.states.t_ns)[self.regular] * 1e-9
        change = np.diff(self.states.position, axis=0)[self.regular]
        return np.asarray(change / steps[:, None])

    @cached_property
    def turns(self) -> Array:
        """(n - 1, 3) rotation from each pose to the next, in the body frame [rad]."""
        q = self.states.q_wb
        return np.asarray(rotation.log(rotation.multiply(rotation.conjugate(q[:-1]), q[1:])))

    @cached_property
    def turning(self) -> float:
        """Angular rate by the attitudes over each regular step, root mean square [rad/s]."""
        steps = np.diff(self.states.t_ns)[self.regular] * 1e-9
        return _rms(self.turns[self.regular] / steps[:, None])

    @cached_property
    def spans(self) -> tuple[Integers, Integers, Array]:
        """First and last rows (m,) of spans of regular steps, and their durations (m, 1) [s].

        Noise of the poses is divided by the duration, which is long at any rate therefore.
        """
        t_ns = self.states.t_ns
        count = max(1, min(round(_SPAN / self.interval), len(t_ns) // 2)) if self.interval else 1
        irregular = np.append(0, np.cumsum(~self.regular))
        begin = np.flatnonzero(irregular[count:] == irregular[:-count]).astype(np.int64)
        end = begin + count
        seconds = np.asarray((t_ns[end] - t_ns[begin])[:, None] * 1e-9)
        return begin, end, seconds

    def rates_over_spans(self, steps: Array) -> Array:
        """Return the rates (m, 3) of change over each span, of changes (n - 1, 3) in each step."""
        begin, end, seconds = self.spans
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        return np.asarray((total[end] - total[begin]) / seconds)

    def integrate_rates(self, column: Array) -> Array:
        """Return the changes (n - 1, 3) by rates (n, 3), taken as linear in each step."""
        steps = np.diff(self.states.t_ns)[:, None] * 1e-9
        return np.asarray(0.5 * (column[1:] + column[:-1]) * steps)

    @cached_property
    def halves(self) -> tuple[TwistHalf, ...]:
        """Linear and angular half of the twist that the body has, each beside its motion."""
        states = self.states
        columns = (
            ("velocities", "move", "m/s", states.velocity, np.diff(states.position, axis=0)),
            ("angular rates", "turn", "rad/s", states.angular_velocity, self.turns),
        )
        return tuple(
            TwistHalf(name, verb, unit, column, self.rates_over_spans(steps), self._noise(steps))
            for name, verb, unit, column, steps in columns
            if column is not None and len(self.spans[0]) >= _COMPARED
        )

    def _noise(self, steps: Array) -> float:
        """Return the rate over a span that noise of the poses with changes (n - 1, 3) makes."""
        # The third difference of white noise has 1 + 9 + 9 + 1 times its variance; the median
        # leaves out jumps, and a vector of three axes is 1.126 times as long as its median.
        thirds = np.linalg.norm(np.diff(steps, n=2, axis=0), axis=1)
        noise = 1.126 * float(np.median(thirds)) / np.sqrt(20.0) if len(thirds) else 0.0
        return float(np.sqrt(2.0) * noise / np.median(self.spans[2]))

    @cached_property
    def moves(self) -> bool:
        """True if the poses move or turn fast enough for a comparison with their twist."""
        return any(half.moves for half in self.halves)


class TwistHalf(NamedTuple):
    """Velocities or angular rates of a twist, and those by the poses over spans of time."""

    name: str
    """Name of the values, for messages."""
    verb: str
    """Kind of motion, for messages."""
    unit: str
    """Unit of the values."""
    values: Array
    """(n, 3) velocities in the world, or angular rates in the body frame."""
    motion: Array
    """(m, 3) the same by the poses, over each span."""
    noise: float
    """Size of the motion that noise of the poses makes."""

    @property
    def size(self) -> float:
        """Size of the motion, root mean square."""
        return _rms(self.motion)

    @property
    def moves(self) -> bool:
        """True if the motion is fast enough for a comparison."""
        return self.size >= max(_SLOWEST, _CLEAR * self.noise)


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(vectors), axis=-1)))) if len(vectors) else 0.0


@check(
    "warning",
    "velocities between such poses are far too large, then zero",
    "{robust true} (trajectory.robust) keeps the first of each; or log at the rate of the "
    "simulation",
)
def poses_held(measures: StateMeasures) -> Iterator[Evidence]:
    """Find poses that stand several times in a row while the body moves."""
    starts, lengths = measures.runs
    if len(starts) < _FEWEST or not measures.interval:
        return
    # A body that stands makes one long run.
    repeated = lengths > 1
    if repeated.mean() <= _HELD:
        return
    steps = np.abs(np.diff(measures.states.position[starts], axis=0))
    usual = np.median(steps[repeated[:-1]].max(axis=1))
    if not steps.any() or usual >= _DIGITS * steps[steps > 0.0].min():
        length = float(np.mean(lengths[lengths <= 10.0 * np.median(lengths)]))
        rate = 1.0 / measures.interval
        text = f"each pose stands {length:.3g} times on average: {rate / length:.4g} Hz"
        row = int(starts[np.flatnonzero(repeated)[0]])
        yield Evidence(f"{text}, not {rate:.4g}", row, int((lengths - 1).sum()))


@check(
    "error",
    "which of them holds is not known",
    "keep one pose of each time",
)
def poses_contradictory(measures: StateMeasures) -> Iterator[Evidence]:
    """Find different poses with the same stamp."""
    rows = np.flatnonzero(np.diff(measures.states.t_ns) == 0) + 1
    if len(rows):
        text = f"{len(rows):,} poses have the stamp of the one before, and differ from it"
        yield Evidence(text, int(rows[0]), len(rows))


@check(
    "warning",
    "motion that is faster than half the rate of the poses is not in them",
    "record poses more often; {max_gap} lets evaluate interpolate over longer steps",
)
def poses_sparse(measures: StateMeasures) -> Iterator[Evidence]:
    """Find poses that are too far apart for the motion of an IMU."""
    if len(measures.states) >= _COMPARED and measures.interval > _SPARSE:
        nyquist = 0.5 / measures.interval
        yield Evidence(
            f"poses are {measures.interval:.3g} s apart: the motion above {nyquist:.3g} Hz is lost"
        )


def _level(q: Array) -> Array:
    """Return the share (n,) of the body's z axis that is upwards: w, x, y, z on the last axis."""
    return np.asarray(1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2))


@check(
    "error",
    "attitudes are wrong by up to half a turn",
    "reorder the columns of the quaternion, or name them in a header (q_w, q_x, q_y, q_z)",
)
def quaternion_order(measures: StateMeasures) -> Iterator[Evidence]:
    """Find quaternions that are level only if their components have another order."""
    q = measures.states.q_wb
    if len(q) < _FEWEST or np.quantile(_level(q), 0.1) > 0.5:
        return
    for order, name in (([3, 0, 1, 2], "x, y, z, w"), ([1, 2, 3, 0], "w, x, y, z")):
        if np.quantile(_level(q[:, order]), 0.02) > 0.8:
            yield Evidence(
                f"the body is level throughout if the columns are {name}, and turns over "
                f"(down to {_level(q).min():.2f} of z upwards) as they are read"
            )
            return


@check(
    "warning",
    "a body with its z axis downwards measures gravity with the other sign",
    "rotate world and body by half a turn about x: they are north-east-down, forward-right-down",
)
def z_down(measures: StateMeasures) -> Iterator[Evidence]:
    """Find poses of a body or in a world whose z axis points downwards."""
    states = measures.states
    names = [
        name
        for name, axes in ((states.frame_id, "ned"), (states.child_frame_id, "frd"))
        if axes in name.lower().replace("/", "_").split("_")
    ]
    if names:
        yield Evidence(f"the frame is called {', '.join(names)}")
    elif any(quaternion_order.find(measures)):
        return
    elif len(states) >= _FEWEST and np.quantile(_level(states.q_wb), 0.95) < -0.9:
        yield Evidence("the body's z axis is downwards throughout")


@check(
    "warning",
    "an IMU with these axes has gravity on y",
    "rotate the poses into forward-left-up: those of a camera are right-down-forward",
)
def axes_camera(measures: StateMeasures) -> Iterator[Evidence]:
    """Find poses in the axes of a camera: y is downwards, or the body travels along its z axis."""
    states = measures.states
    if len(states) < _FEWEST or not len(measures.velocity):
        return
    down = rotation.rotate(states.q_wb, np.array([0.0, 1.0, 0.0]))[:, 2]
    if np.quantile(down, 0.95) < -0.9 and not any(quaternion_order.find(measures)):
        yield Evidence("the body's y axis is downwards throughout")
        return
    steps = np.diff(states.position, axis=0)[measures.regular]
    path = float(np.linalg.norm(steps, axis=1).sum())
    if path < _PATH:
        return
    q = states.q_wb[:-1][measures.regular]
    body = rotation.rotate_inverse(q, steps).sum(axis=0) / path
    # In the world of a visual odometry, which has the axes of the first image, y is downwards.
    turns = rotation.log(rotation.multiply(rotation.conjugate(q[0]), q))
    about_y = np.abs(turns[:, 1]).max() >= 2.0 * np.abs(turns[:, [0, 2]]).max()
    if body[2] > 0.8 and (np.quantile(down, 0.95) < -0.8 or about_y):
        yield Evidence(f"{body[2]:.0%} of the path of {path:.4g} m is along the body's z axis")


_Turn: TypeAlias = Callable[[Array, Array], Array]


def _contradictions(
    measures: StateMeasures, turn: _Turn, frames: tuple[str, str]
) -> Iterator[Evidence]:
    """Yield the halves of a twist that agree with the poses only if they are turned.

    :param turn: rotation by the attitude.
    :param frames: axes as which the twist is read, and those that agree.
    """
    for half in measures.halves:
        if not half.moves:
            continue
        as_stated, turned = (
            _rms(measures.rates_over_spans(measures.integrate_rates(values)) - half.motion)
            / half.size
            for values in (half.values, turn(measures.states.q_wb, half.values))
        )
        if turned < _AGREES and as_stated > 3.0 * turned and as_stated > 0.05:
            yield Evidence(
                f"{half.name} differ from those of the poses by {as_stated:.2g} of their size in "
                f"the {frames[0]}'s axes, by {turned:.2g} in the {frames[1]}'s"
            )


@check(
    "error",
    "accelerations that are computed from it are wrong",
    "{twist_frame world} (add_errors), or parameter input.twist_frame (error_model)",
)
def twist_world(measures: StateMeasures) -> Iterator[Evidence]:
    """Find a twist, or one of its halves, in the axes of the world instead of the body."""
    yield from _contradictions(measures, rotation.rotate_inverse, ("body", "world"))


@check(
    "error",
    "accelerations that are computed from it are wrong",
    "{twist_frame body} (add_errors), or parameter input.twist_frame (error_model); rotate the "
    "velocities of a table into the world",
)
def twist_body(measures: StateMeasures) -> Iterator[Evidence]:
    """Find velocities or angular rates in the axes of the body that are read as the world's."""
    if not any(twist_world.find(measures)):
        yield from _contradictions(measures, rotation.rotate, ("world", "body"))


@check(
    "error",
    "the motion looks like rest",
    "fill in the twist, or use the poses alone",
)
def twist_unfilled(measures: StateMeasures) -> Iterator[Evidence]:
    """Find a twist, or one of its halves, that is zero while the poses move."""
    for half in measures.halves:
        if half.moves and not half.values.any():
            yield Evidence(
                f"all {half.name} are 0, the poses {half.verb} at {half.size:.3g} {half.unit}"
            )


STATES: Final = (
    poses_contradictory,
    twist_world,
    twist_body,
    twist_unfilled,
    quaternion_order,
    poses_held,
    poses_sparse,
    z_down,
    axes_camera,
)
"""Checks of poses."""
TWIST: Final = (twist_world, twist_body, twist_unfilled)
"""Checks of the twist against the poses."""
