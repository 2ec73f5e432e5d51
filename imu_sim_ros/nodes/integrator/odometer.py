# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings in, states out: the integrator without its topics."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from rclpy.publisher import Publisher

from imu_sim_ros.bags.messages.transforms import PathEncoder
from imu_sim_ros.core import components, gate, rotation
from imu_sim_ros.core.records import LiveReading, LiveState
from imu_sim_ros.navigation.covariance import ATTITUDE, Covariance
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA
from imu_sim_ros.navigation.mount import ALIGNED, mount_of
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.navigation.state import NavigationState, correction_of
from imu_sim_ros.navigation.stepper import Stepper, StepperCounts
from imu_sim_ros.nodes.integrator.initialiser import Start, initialiser
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX
from imu_sim_ros.recordings.live_batches import BatchSpreader
from imu_sim_ros.recordings.order import READINGS_GAP, RESTART_NS, LiveGap

_SMOOTHING = 0.02
"""Weight of the newest interval in the usual one."""


@dataclass
class Totals:
    """Counts since the start of the node."""

    readings: int = 0
    starts: int = 0
    steps: StepperCounts = field(default_factory=StepperCounts)


class LiveIntegrator:
    """Starts as configured, integrates, and starts again when the source does.

    :param complain: receives a line for every irregular reading.
    :param is_new_source: returns whether a publisher has appeared since the last call.
    """

    def __init__(
        self,
        parameters: IntegratorParameters,
        complain: Callable[[str], None],
        is_new_source: Callable[[], bool],
    ) -> None:
        self.totals = Totals()
        self.parameters = parameters
        self.frames = (parameters.world_frame, parameters.body_frame)
        """Frames of the pose and of the body: those of the odometry that it started from."""
        self._complain, self._is_new_source = complain, is_new_source
        self.reset()

    def reset(self) -> None:
        """Forget all readings, and start again with the next ones."""
        self._batches = BatchSpreader(self._complain)
        self.begin()

    def begin(self) -> None:
        """Restart with the next readings."""
        self._gap = LiveGap(self.parameters.max_gap, READINGS_GAP)
        self._waiting: list[LiveReading] = []
        """Readings that are not integrated yet: the first ones, until their gaps are known."""
        self._initialiser = initialiser(self.parameters, self._gap, self._complain)
        self._stepper: Stepper | None = None
        self._covariance: Covariance | None = None
        self._mount = ALIGNED
        self._r_wi = IDENTITY_MATRIX
        """Attitude of the IMU at the last reading."""
        self._interval = 0.0
        self._uncertain = False

    @property
    def waiting(self) -> bool:
        """Return whether integration has not begun yet."""
        return self._stepper is None

    @property
    def rate(self) -> float:
        """Readings per second, smoothed [Hz]; 0 before there are two."""
        return 1.0 / self._interval if self._interval else 0.0

    def correct_with(self, parameters: IntegratorParameters) -> None:
        """Apply new biases from the next reading on."""
        self.parameters = parameters
        if self._stepper is None:
            self._initialiser = initialiser(parameters, self._gap, self._complain)
        else:
            self._stepper.correction = correction_of(parameters)

    def add_truth(self, truth: LiveState) -> list[LiveState]:
        """Add a true state; return the rows of readings that waited for it."""
        if self._stepper is None:
            return self._begin_at(self._initialiser.add_truth(truth))
        return []

    def add_reading(self, reading: LiveReading) -> list[LiveState]:
        """Add a reading; return one row, none while waiting, or many after the wait."""
        self.totals.readings += 1
        rows: list[LiveState] = []
        for timed_reading in self._batches.add(reading):
            self._gap.add(timed_reading.t_ns)
            self._waiting.append(timed_reading)
            if self._gap.is_known:
                readings, self._waiting = self._waiting, []
                for next_reading in readings:
                    rows += self._integrate(next_reading)
        return rows

    def _integrate(self, reading: LiveReading) -> list[LiveState]:
        """Integrate a reading, with the gaps of the stream known."""
        stepper = self._stepper
        if stepper is not None and stepper.t_ns is not None:
            step_ns = reading.t_ns - stepper.t_ns
            if step_ns < -RESTART_NS or (
                step_ns > self._gap.longest_step_ns and self._is_new_source()
            ):
                self._complain("the source restarted; integration restarts too")
                self.begin()
                self._gap.add(reading.t_ns)
                stepper = None
        if stepper is None:
            return self._begin_at(self._initialiser.add_reading(reading))
        row = self._step(stepper, reading)
        return [] if row is None else [row]

    def _begin_at(self, start: Start | None) -> list[LiveState]:
        """Begin to integrate at a start; return the states of its readings."""
        if start is None:
            return []
        parameters = self.parameters
        self.totals.starts += 1
        self._is_new_source()
        self._mount = mount_of(parameters.imu)
        world, body = start.frames
        self.frames = (world or parameters.world_frame, body or parameters.body_frame)
        self._stepper = stepper = Stepper(
            self._imu_state(start),
            parameters.method,
            parameters.attitude_update,
            parameters.gravity,
            start.initial.correction,
            earth_rate=parameters.earth_rate,
        )
        stepper.counts = self.totals.steps
        if parameters.covariance:
            self._covariance = start.initial.covariance
        rows = (self._step(stepper, reading) for reading in start.readings)
        return [row for row in rows if row is not None]

    def _imu_state(self, start: Start) -> NavigationState:
        """Return the state of the IMU of that of the body, by the mount."""
        initial, mount = start.initial, self._mount
        if mount == ALIGNED:
            return initial.state
        rate = initial.rate
        if rate is None:
            reading = start.readings[0]
            rate_i = initial.correction.correct(reading.gyro, reading.accel)[0]
            earth_rate_b = rotation.rotate_inverse(initial.state.q_wb, self.parameters.earth_rate)
            rate = rotation.rotate(mount.q_bi, rate_i) - earth_rate_b
        return mount.imu_state(initial.state, rate)

    def _step(self, stepper: Stepper, reading: LiveReading) -> LiveState | None:
        """Return the state after one more reading; None if the reading is not integrated."""
        previous_ns = stepper.t_ns
        force, rate = stepper.specific_force, stepper.angular_velocity
        stepper.longest_step_ns = self._gap.longest_step_ns
        if stepper.add(reading.t_ns, reading.gyro, reading.accel):
            assert previous_ns is not None
            h = (reading.t_ns - previous_ns) * 1e-9
            self._interval += (h - self._interval) * (_SMOOTHING if self._interval else 1.0)
            if self._covariance is not None:
                self._covariance.advance(h, self._r_wi, force, rate)
        elif previous_ns is not None and not self._is_usable(previous_ns, reading):
            return None
        variances = [] if self._covariance is None else self._covariance.variances()
        # The state may leave if it is finite, and of possible size.
        if not (
            gate.is_pose(reading.t_ns, stepper.position, stepper.q_wb)
            and gate.is_within(stepper.velocity, gate.VELOCITY)
            and math.isfinite(sum(variances))
        ):
            self._complain("the state has grown beyond any possible one; integration restarts")
            self.begin()
            return None
        largest = max(variances[ATTITUDE], default=0.0)
        if largest > LARGEST_SIGMA**2 and not self._uncertain:
            self._complain_about_attitude(math.sqrt(largest))
        return self._body_state(stepper, reading.t_ns)

    def _is_usable(self, previous_ns: int, reading: LiveReading) -> bool:
        """Report a reading that made no step; return whether its stamp is new."""
        counts, step = self.totals.steps, (reading.t_ns - previous_ns) * 1e-9
        if step == 0:
            self._complain(f"reading with the same stamp as the previous one ({counts.repeated})")
            return False
        if step < 0:
            self._complain(f"a stamp {-step:.6f} s before the previous one ({counts.backward})")
        else:
            self._complain(f"a gap of {step:.6f} s, not integrated across ({counts.gaps})")
        return True

    def _complain_about_attitude(self, sigma: float) -> None:
        """Warn once that the attitude is too uncertain for the covariance to be valid.

        :param sigma: largest standard deviation about an axis of the world [rad].
        """
        self._uncertain = True
        self._complain(
            f"the attitude uncertainty is {sigma:.2g} rad: above {LARGEST_SIGMA:g} rad the "
            "covariance, a small-angle approximation, is no longer valid"
        )

    def _body_state(self, stepper: Stepper, t_ns: int) -> LiveState:
        """Return the state of the body, with its covariance if that is propagated.

        :param stepper: state of the IMU, whose rate includes that of the Earth.
        """
        imu_state = stepper.position, stepper.velocity, stepper.q_wb
        rate = stepper.angular_velocity
        if any(self.parameters.earth_rate):
            earth = components.rotate_inverse(stepper.q_wb, self.parameters.earth_rate)
            rate = (rate[0] - earth[0], rate[1] - earth[1], rate[2] - earth[2])
        body = self._mount.body_state(imu_state, rate)
        if self._covariance is None:
            return LiveState(t_ns, *body)
        self._r_wi = components.to_matrix(stepper.q_wb)
        pose, twist = self._covariance.message(self._r_wi, stepper.velocity, self.rate)
        if self._mount is not ALIGNED:
            _, q_wb, *_ = body
            pose = self._mount.pose_covariance(pose, q_wb)
            twist = self._mount.twist_covariance(twist)
        return LiveState(t_ns, *body, pose, twist)


class PathPublisher:
    """Keeps a pose for each interval of the path's rate, as far back as ``path_length``."""

    def __init__(
        self, publisher: Publisher, frame_id: str, parameters: IntegratorParameters
    ) -> None:
        self._publisher, self._frame_id = publisher, frame_id
        self._encoder = PathEncoder(frame_id)
        self._interval_ns = 1e9 / parameters.path_rate
        capacity = int(parameters.path_length * parameters.path_rate) + 1
        self._poses: deque[bytes] = deque(maxlen=capacity)
        self._due_ns = 0.0
        """Stamp from which the next pose is kept [ns]."""

    def add(self, row: LiveState) -> None:
        """Add a state to the path if its pose is due; most are skipped."""
        # Earlier than the interval before: time has gone back, and poses are due again.
        if self._due_ns - self._interval_ns <= row.t_ns < self._due_ns:
            return
        self._due_ns = row.t_ns + self._interval_ns
        self._poses.append(self._encoder.pose(row.t_ns, row.position, row.q_wb))

    def use_frame(self, frame_id: str) -> None:
        """Set the frame of the poses; poses in another one are dropped."""
        if frame_id != self._frame_id:
            self._frame_id, self._encoder = frame_id, PathEncoder(frame_id)
            self.clear()

    def clear(self) -> None:
        """Forget the path."""
        self._poses.clear()
        self._due_ns = 0.0

    def message(self) -> bytes | None:
        """Return the path so far; None if there is none, or nobody subscribes."""
        if self._poses and self._publisher.get_subscription_count():
            return self._encoder.message(self._poses)
        return None

    def publish(self, message: bytes) -> None:
        """Publish what :meth:`message` has returned."""
        self._publisher.publish(message)
