# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator node: IMU readings into odometry by dead reckoning."""

import sys
import threading
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry, Path
from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from imu_sim_ros.bags.messages.encode import OdometryEncoder, Vector3StampedEncoder
from imu_sim_ros.core.conventions import (
    ATTITUDE_ERROR_TOPIC,
    DEAD_RECKONED_TOPIC,
    IMU_TOPIC,
    PATH_TOPIC,
    POSITION_ERROR_TOPIC,
    ROLL_PITCH_YAW_TOPIC,
    TRUTH_TOPIC,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState
from imu_sim_ros.core.rotation import to_euler
from imu_sim_ros.navigation.mount import ALIGNED, mount_of
from imu_sim_ros.navigation.parameters import (
    IntegratorImuParameters,
    IntegratorParameters,
    layer_integrator,
    load_integrator,
    outside_covariance,
    sensor_description_layer,
)
from imu_sim_ros.nodes import messages as decode
from imu_sim_ros.nodes import run, signals
from imu_sim_ros.nodes.diagnostics import PERIOD
from imu_sim_ros.nodes.integrator.diagnostics import (
    IntegratorReport,
    PoseError,
    TruthComparison,
)
from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator, PathPublisher
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.publishing import ACKNOWLEDGEMENT, Counter
from imu_sim_ros.nodes.sensor_description import SensorDescription
from imu_sim_ros.nodes.subscriptions import DEPTH, MatchedInputs, RawSubscriptions, Taken
from imu_sim_ros.nodes.warnings import Refusals, Warnings
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX
from imu_sim_ros.recordings.findings.live import StampWatch, UnitWatch
from imu_sim_ros.recordings.findings.policy import INTEGRATOR
from imu_sim_ros.recordings.live_strays import LiveStrays

_READ_PERIOD: Final = 0.002
"""Longest time for which readings wait for each other [s]."""
_COMPLAINT_PERIOD: Final = 1.0
"""Time after which a line about an irregular reading is told again [s]."""


class Integrator(ConfiguredNode[IntegratorParameters]):
    """Topics, services and parameters around a :class:`LiveIntegrator`."""

    def __init__(self, **arguments: object) -> None:
        super().__init__("integrator", IntegratorParameters, layer_integrator, **arguments)
        parameters = self.parameters
        self._sources: frozenset[bytes] = frozenset()
        complain = Warnings(self.get_logger(), _COMPLAINT_PERIOD).add
        self.odometer = LiveIntegrator(parameters, complain, self._is_new_source)
        self.comparison = TruthComparison() if parameters.error else None
        self._refusals = Refusals(self.get_logger())
        self._lock = threading.Lock()
        """Integrate readings in the reader's thread; everything else runs in the executor's."""
        self._received = {IMU_TOPIC: 0, TRUTH_TOPIC: 0}
        self._add_publishers(parameters)
        source = self.resolve_topic_name(IMU_TOPIC)
        self._units, self._stamps = UnitWatch(source), StampWatch()
        tell = self.get_logger().warning
        self._reading_strays = LiveStrays[LiveReading](lambda line: tell(f"{IMU_TOPIC}: {line}"))
        self._truth_strays = LiveStrays[LiveState](lambda line: tell(f"{TRUTH_TOPIC}: {line}"))
        self._decoder = decode.ReadingDecoder(parameters)
        for line in self._decoder.notes():
            self.get_logger().info(line)
        self.sensor = SensorDescription(self, self._adopt, self._integrate, self._lock)
        for line in parameters.warnings():
            self.get_logger().warning(line)
        if self.sensor.noise_known:
            self._tell_what_is_left_out()
        self.create_service(Trigger, "~/reset", self._reset)
        self.reader = RawSubscriptions(
            self, self._take, self.lifetime.fail, _READ_PERIOD, IMU_TOPIC, self._release
        )
        self._matched = MatchedInputs(self, self.reader, self._inputs, DEPTH)

    def apply(self, parameters: IntegratorParameters) -> None:
        """Apply new biases."""
        with self._lock:
            self.odometer.correct_with(parameters)

    def close(self) -> None:
        """Process the messages so far, wait for the subscribers, and print the counts."""
        self.reader.close()
        self.sensor.settle()
        self._add(self._reading_strays.finish(), self._truth_strays.finish())
        self._odometry_out.publisher.wait_for_all_acked(ACKNOWLEDGEMENT)
        for topic, count in self._received.items():
            print(f"integrator: received {count} messages on {topic}", flush=True)
        sent = self._odometry_out.count
        print(f"integrator: published {sent} messages on {DEAD_RECKONED_TOPIC}", flush=True)

    def _add_publishers(self, parameters: IntegratorParameters) -> None:
        """Create the publishers of the topics that the parameters ask for."""
        odometry_out = self._publisher(Odometry, DEAD_RECKONED_TOPIC)
        self._odometry_out = Counter(DEAD_RECKONED_TOPIC, odometry_out)
        self._angles_out: Publisher | None = None
        self._path: PathPublisher | None = None
        if parameters.roll_pitch_yaw:
            self._angles_out = self._publisher(Vector3Stamped, ROLL_PITCH_YAW_TOPIC)
        if parameters.error:
            self._position_error_out = self._publisher(Vector3Stamped, POSITION_ERROR_TOPIC)
            self._attitude_error_out = self._publisher(Vector3Stamped, ATTITUDE_ERROR_TOPIC)
        if parameters.path_rate:
            publisher = self.create_publisher(Path, PATH_TOPIC, 1)
            self._path = PathPublisher(publisher, parameters.world_frame, parameters)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(1.0 / parameters.path_rate, self._publish_path, clock=steady)
        if parameters.diagnostics:
            self._report = IntegratorReport(f"{self.get_name()}: dead reckoning")
            self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 1)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(PERIOD, self._diagnose, clock=steady)
        self._use_frames((parameters.world_frame, parameters.body_frame))

    def _use_frames(self, frames: tuple[str, str]) -> None:
        """Set the frames of the published pose and of the body."""
        self._frames = world, body = frames
        self._odometry = OdometryEncoder(world, body)
        self._angles = self._position_error = Vector3StampedEncoder(world)
        self._attitude_error = Vector3StampedEncoder(body)
        if self._path is not None:
            self._path.use_frame(world)
        for name, frame in (("world_frame", world), ("body_frame", body)):
            configured = self.overrides.get(name, frame)
            if configured != frame:
                self.get_logger().warning(
                    f"{name} = {configured}: {TRUTH_TOPIC}, which it starts from, is in {frame}, "
                    "and so is the pose"
                )

    def _publisher(self, message: type, topic: str) -> Publisher:
        """Return a publisher whose quality of service parameters may override."""
        options = QoSOverridingOptions.with_default_policies()
        return self.create_publisher(message, topic, DEPTH, qos_overriding_options=options)

    # ----------------------------------------------------------------------------- messages
    def _inputs(self) -> dict[str, type]:
        """Return the topics that the node reads, with their message classes."""
        needs_truth = self.parameters.error or self.parameters.initial_state == "truth"
        return {IMU_TOPIC: Imu, TRUTH_TOPIC: Odometry} if needs_truth else {IMU_TOPIC: Imu}

    def _take(self, topic: str, batch: list[Taken]) -> None:
        """Process messages of one topic as they arrive."""
        self._received[topic] += len(batch)
        with self._lock:
            if self.sensor.settled:
                self._integrate(topic, batch)
            else:
                self.sensor.hold(topic, batch)

    def _integrate(self, topic: str, batch: list[Taken]) -> None:
        """Integrate messages of one topic and publish the results; the lock is held."""
        readings: list[LiveReading] = []
        truths: list[LiveState] = []
        for payload, _ in batch:
            try:
                if topic == IMU_TOPIC:
                    reading = self._decoder.reading(payload)
                    if reading is not None:
                        readings.append(reading)
                else:
                    truths.append(decode.truth(payload))
            except InputError as error:
                self._refusals.add(topic, error)
        if topic == IMU_TOPIC:
            self._add(self._reading_strays.apply(readings), ())
        else:
            self._add((), self._truth_strays.apply(truths))

    def _add(self, readings: Sequence[LiveReading], truths: Sequence[LiveState]) -> None:
        """Integrate readings in order, compare truths, and publish the results."""
        rows: list[LiveState] = []
        errors: list[PoseError] = []
        if not self._stamps.done:
            readings = self._refusals.keep_timed(IMU_TOPIC, self._stamps, readings)
        for reading in readings:
            if not self._units.done and (findings := self._units.add(reading)):
                INTEGRATOR.judge(findings, self.get_logger().warning)
            rows += self.odometer.add_reading(reading)
        for truth in truths:
            rows += self.odometer.add_truth(truth)
            if self.comparison is not None:
                errors += self.comparison.add_truth(truth)
        if rows:
            self._publish(rows)
        if errors:
            self._publish_errors(errors)

    def _release(self) -> None:
        """Integrate readings that waited for others to tell whether their stamps are stray."""
        with self._lock:
            self._add(self._reading_strays.release(), self._truth_strays.release())

    def _adopt(self, sensor: Mapping[str, object]) -> None:
        """Adopt the noise parameters of the sensor that publishes the readings.

        :raises ConfigurationError: for invalid values.
        """
        sensor = sensor_description_layer(self.overrides, sensor)
        parameters = load_integrator(self.overrides, sensor)
        with self._lock:
            later = not self.odometer.waiting and parameters.imu != self.odometer.parameters.imu
            self.replace(parameters)
            self.odometer.correct_with(parameters)
        when = "; it takes effect at the next start" if later else ""
        self.get_logger().info(
            f"the sensor is {_sensor_text(parameters.imu)}, according to {self.sensor.topic}{when}"
        )
        if not self.sensor.noise_known:
            self._tell_what_is_left_out(sensor)

    def _tell_what_is_left_out(self, sensor: Mapping[str, object] | None = None) -> None:
        """Name the sensor's errors that the covariance does not include."""
        if not self.parameters.covariance:
            return
        left_out = outside_covariance(self.parameters, self.overrides, sensor)
        if left_out:
            self.get_logger().info(f"the covariance does not include {', '.join(left_out)}")

    # ----------------------------------------------------------------------------- results
    def _publish(self, rows: list[LiveState]) -> None:
        """Publish states as Odometry, and as transforms and a path if wanted."""
        if self.odometer.frames != self._frames:
            self._use_frames(self.odometer.frames)
        for row in rows:
            self._odometry_out.send(self._odometry.message(*row[:7]))
        if self._angles_out is not None:
            t_ns = np.array([row.t_ns for row in rows])
            angles = np.degrees(to_euler([row.q_wb for row in rows]))
            _send(self._angles_out, self._angles.encode(t_ns, angles))
        if self._path is not None:
            for row in rows:
                self._path.add(row)
        if self.comparison is not None:
            errors = [error for row in rows for error in self.comparison.add_estimate(row)]
            if errors:
                self._publish_errors(errors)

    def _publish_errors(self, errors: Sequence[PoseError]) -> None:
        """Publish the errors of position and attitude."""
        stamps, positions, attitudes = zip(*errors, strict=True)
        t_ns = np.array(stamps)
        _send(self._position_error_out, self._position_error.encode(t_ns, positions))
        _send(self._attitude_error_out, self._attitude_error.encode(t_ns, attitudes))

    def _publish_path(self) -> None:
        """Publish the path so far, for the timer; readings wait only until it is copied."""
        path = self._path
        if path is not None:
            with self._lock:
                message = path.message()
            if message is not None:
                path.publish(message)

    # ----------------------------------------------------------------------------- events
    def _diagnose(self) -> None:
        """Publish the state of the integration as diagnostics."""
        stamp = self.get_clock().now().to_msg()
        counts = self._refusals.count, self._reading_strays.count
        self._diagnostics.publish(
            self._report.message(stamp, self.odometer, self.comparison, *counts)
        )

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Restart with the next reading, for the service."""
        with self._lock:
            self.odometer.reset()
            self._stamps.begin()
            self._reading_strays.begin()
            self._truth_strays.begin()
            if self._path is not None:
                self._path.clear()
            if self.comparison is not None:
                self.comparison = TruthComparison()
        response.success = True
        response.message = f"starting again, initial_state = {self.parameters.initial_state}"
        return response

    def _is_new_source(self) -> bool:
        """Return whether a publisher of readings has appeared since the last call."""
        sources = frozenset(
            bytes(publisher.endpoint_gid)
            for publisher in self.get_publishers_info_by_topic(IMU_TOPIC)
        )
        is_new = bool(sources - self._sources)
        self._sources |= sources
        return is_new


def _sensor_text(imu: IntegratorImuParameters) -> str:
    """Return the sensor's name, and its mount if it is not aligned with the body."""
    if mount_of(imu) == ALIGNED:
        return imu.preset
    x, y, z = imu.lever_arm
    turned = "" if imu.mounting == IDENTITY_MATRIX else ", with the axes of imu.mounting"
    return f"{imu.preset} at [{x:g}, {y:g}, {z:g}] m{turned}"


def _send(publisher: Publisher, messages: np.ndarray) -> None:
    """Publish encoded messages (n, size)."""
    for message in messages:
        publisher.publish(message.tobytes())


def main() -> int:
    """Run the node."""
    return run.main("integrator", Integrator)


if __name__ == "__main__":
    signals.watch(is_final=True)
    sys.exit(main())
