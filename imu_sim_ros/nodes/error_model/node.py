# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error model node: another simulator's ideal readings in, those of a chosen sensor out."""

import dataclasses
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Final, TypeVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from imu_sim_ros.core import conventions
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState, LiveValue, Readings
from imu_sim_ros.nodes import messages as decode
from imu_sim_ros.nodes import run, sensor_description, signals
from imu_sim_ros.nodes.diagnostics import PERIOD, drawn_constants, fault_message
from imu_sim_ros.nodes.error_model.diagnostics import ErrorModelReport
from imu_sim_ros.nodes.error_model.output import DEPTH, ErrorModelOutputs, topics_to_publish
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.publishing import ACKNOWLEDGEMENT, check_overrides, create
from imu_sim_ros.nodes.subscriptions import MatchedInputs, RawSubscriptions, Taken
from imu_sim_ros.nodes.warnings import Refusals
from imu_sim_ros.recordings.findings.live import StampWatch, TwistWatch
from imu_sim_ros.recordings.live_strays import LiveStrays
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.simulation.error_input import Differentiator, IdealValues
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import (
    NODE,
    ErrorNodeParameters,
    layer_error_model,
    sensor_rotation,
)
from imu_sim_ros.simulation.given_sensor import OTHERS

_Decoded = TypeVar("_Decoded")
_READ_PERIOD: Final = 0.003
"""Longest time for which readings wait for each other [s]. At 1 kHz four come at a time, for a
quarter of the wakes of one by one."""
_FEW: Final = 8
"""Readings that take less time as numbers than as arrays."""
_REMARKS_A_SECOND: Final = 5
"""Lines of remarks in a second, at most."""


def _ideal_topics(sensors: Collection[str]) -> dict[str, tuple[str, str]]:
    """Return quantity and type of the messages of each topic of another sensor's ideal values.

    :param sensors: quantities whose readings are published.
    """
    return {
        sensor.topics[0].name + conventions.IDEAL_SUFFIX: (
            sensor.quantity,
            sensor.topics[0].type,
        )
        for sensor in OTHERS.values()
        if sensor.quantity in sensors
    }


class ErrorModelNode(ConfiguredNode[ErrorNodeParameters]):
    """Topics, services and parameters around an :class:`GivenImu`."""

    def __init__(self, **arguments: object) -> None:
        super().__init__(NODE, ErrorNodeParameters, layer_error_model, **arguments)
        parameters = self.parameters
        self._lock = threading.Lock()
        """Readings are taken in the reader's thread; everything else runs in the executor's."""
        self._received: Counter[str] = Counter()
        """Number of messages received, by topic."""
        self._refusals = Refusals(self.get_logger())
        self._unit_of: tuple[ErrorNodeParameters, int] | None = None
        """Parameters and seed that ``_unit`` belongs to."""
        self._unit: Mapping[str, str] = {}
        """Parameters drawn from the seed."""
        self._remarks: list[str] = []
        """Probable mistakes in the declaration of the input, for the diagnostics."""
        self._said: deque[float] = deque(maxlen=_REMARKS_A_SECOND)
        """Times of the last remarks in the log, on the steady clock [s]."""
        sensors = {offer.name for offer in topics_to_publish(parameters).values()}
        self._values = _ideal_topics(sensors)
        self.model = GivenImu(parameters, sensors, self._remark)
        self._decoder = decode.ReadingDecoder(parameters, self.model.uses_orientation)
        for line in self._decoder.notes():
            self.get_logger().info(line)
        self._main = next(iter(self._inputs()))
        """Topic of the readings, or of odometry."""
        self._create_stamp_checks()
        self._odometry = Differentiator(parameters) if parameters.odometry else None
        self._twist = self._twist_check()
        self._takes_frame = self._has_frame_of_input()
        """True if the frame of the readings is still to be that of the input."""
        self.outputs = ErrorModelOutputs(self, parameters, self.lifetime.fail)
        self._faults = create(
            self,
            DiagnosticArray,
            conventions.FAULTS_TOPIC,
            QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        self._description = sensor_description.create_publisher(self)
        self._diagnostics = create(self, DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        # All topics exist now: an override that names none of them is a mistake.
        check_overrides(self)
        sensor_description.publish(self._description, parameters)
        if parameters.inject.kind != "none":
            self._inject(parameters)
        hardware = f"simulated, {parameters.imu.preset}, seed {parameters.seed}"
        self._report = ErrorModelReport(f"{self.get_name()}: errors", hardware)
        self.create_service(Trigger, "~/reset", self._reset)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(PERIOD, self._diagnose, clock=steady)
        self.get_logger().info(
            f"{parameters.imu.preset} at {parameters.rate:g} Hz, seed {parameters.seed}, "
            f"on {self.resolve_topic_name(self._main)}"
        )
        # Last: messages arrive in the reader's thread from here on.
        self.reader = RawSubscriptions(
            self, self._take, self.lifetime.fail, _READ_PERIOD, self._main, self._release
        )
        self._matched = MatchedInputs(self, self.reader, self._inputs, DEPTH)

    def _create_stamp_checks(self) -> None:
        """Create the checks of the stamps of the readings, odometry and other sensors."""
        self._stamps = StampWatch()
        self._reading_strays = LiveStrays[LiveReading](self._remark_about(self._main))
        self._state_strays = LiveStrays[LiveState](self._remark_about(self._main))
        self._value_strays = {
            name: LiveStrays[LiveValue](self._remark_about(name)) for name in self._values
        }

    def _twist_check(self) -> TwistWatch | None:
        """Return the check of the axes of odometry's velocities; None: they are not checked."""
        parameters = self.parameters
        if not (parameters.odometry and parameters.input.check):
            return None
        topic = self.resolve_topic_name(conventions.INPUT_ODOMETRY_TOPIC)
        return TwistWatch(f"input ({topic})", parameters.input.twist_frame)

    def _has_frame_of_input(self) -> bool:
        """Return True if the readings have the frame of the input's messages.

        They have not if a frame is named, or if they are turned or moved from that of the input.
        """
        parameters = self.parameters
        turned = sensor_rotation(parameters.input) is not None or parameters.input.place == "body"
        has_frame = "imu_frame" in self.overrides or parameters.imu_frame != conventions.IMU_FRAME
        return not (parameters.odometry or turned or has_frame)

    def _inputs(self) -> dict[str, type]:
        """Return the topics that the node reads, with their message classes."""
        classes = {name: decode.message_class(kind) for name, (_, kind) in self._values.items()}
        if self.parameters.odometry:
            return {conventions.INPUT_ODOMETRY_TOPIC: Odometry, **classes}
        return {conventions.INPUT_IMU_TOPIC: Imu, **classes}

    def close(self) -> None:
        """Process what has arrived, wait for the subscribers, and print the counts."""
        self.reader.close()
        self._pass_on(finish=True)
        self.model.finish()
        self.outputs.close()
        for counter in self.outputs.counters:
            counter.publisher.wait_for_all_acked(ACKNOWLEDGEMENT)
        for topic in self._inputs():
            count = self._received[topic]
            print(f"error_model: received {count} messages on {topic}", flush=True)
        for counter in self.outputs.counters:
            print(f"error_model: published {counter.count} messages on {counter.topic}", flush=True)

    # ----------------------------------------------------------------------------- readings
    def _take(self, topic: str, batch: list[Taken]) -> None:
        """Add errors to messages, as they are delivered, and publish them."""
        self._received[topic] += len(batch)
        with self._lock:
            if topic in self._values:
                self._take_values(topic, batch)
                return
            if self._takes_frame:
                self._take_frame(batch)
            if self._odometry is None:
                decoded = self._decode(topic, batch, self._decoder.reading)
                readings = [reading for reading in decoded if reading is not None]
                self._add_readings(self._reading_strays.apply(readings))
            else:
                states = self._decode(topic, batch, decode.truth)
                self._add_states(self._odometry, self._state_strays.apply(states))

    def _release(self) -> None:
        """Add errors to messages that waited for others to tell whether their stamps are stray."""
        with self._lock:
            self._pass_on()

    def _pass_on(self, finish: bool = False) -> None:
        """Add errors to messages in doubt: at the end to all of them, else after a silence."""
        for topic, strays in self._value_strays.items():
            self._add_values(topic, strays.finish() if finish else strays.release())
        readings = self._reading_strays
        self._add_readings(readings.finish() if finish else readings.release())
        if self._odometry is not None:
            states = self._state_strays
            self._add_states(self._odometry, states.finish() if finish else states.release())

    def _take_values(self, topic: str, batch: list[Taken]) -> None:
        """Add errors to ideal values of another sensor, and publish them."""
        decoded = self._decode(topic, batch, partial(decode.value, self._values[topic][1]))
        self._add_values(topic, self._value_strays[topic].apply(decoded))

    def _add_values(self, topic: str, measurements: Sequence[LiveValue]) -> None:
        """Add errors to measurements in order, and publish them."""
        quantity = self._values[topic][0]
        if measurements:
            t_ns = np.array([measurement.t_ns for measurement in measurements], np.int64)
            values = np.array([measurement.components for measurement in measurements])
            values = values if values.shape[1] > 1 else values[:, 0]
            ideal = IdealValues.unchecked(t_ns=t_ns, values=values)
            for block in self.model.other(quantity).read(ideal):
                self.outputs.publish({quantity: block}, self.parameters)

    def _take_frame(self, batch: list[Taken]) -> None:
        """Set the frame of the readings to that of the first message with one."""
        frames = (decode.frame_id(payload) for payload, _ in batch)
        frame = self.parameters.frame or next(filter(None, frames), "")
        if not frame:
            return
        self._takes_frame = False
        if frame != self.parameters.imu_frame:
            self.replace(dataclasses.replace(self.parameters, imu_frame=frame))
            self.model.parameters = self.parameters
            self.outputs.encode_for(self.parameters)

    def _add_readings(self, readings: Sequence[LiveReading]) -> None:
        """Add errors to readings in order, and publish them."""
        if not self._stamps.done:
            readings = self._refusals.keep_timed(self._main, self._stamps, readings)
        if 0 < len(readings) <= _FEW and all(reading.q_wb is None for reading in readings):
            if self.outputs.has_readings_alone:
                numbers = self.model.read_numbers(readings)
                if numbers is not None:
                    self.outputs.publish_readings(numbers, self.parameters)
                    return
            samples = self.model.read_few(readings)
            if samples is not None:
                self.outputs.publish({IMU: samples}, self.parameters)
                return
        try:
            self._read(_record(readings))
        except InputError as error:
            self._refusals.add(self._main, error, len(readings))

    def _read(self, readings: Readings) -> None:
        """Add errors to readings and publish the samples."""
        for block in self.model.read(readings) if len(readings.t_ns) else ():
            self.outputs.publish(block, self.parameters)

    def _decode(
        self, topic: str, batch: list[Taken], fields: Callable[[bytes], _Decoded]
    ) -> list[_Decoded]:
        """Return the contents of messages; unusable ones are refused."""
        decoded = []
        for payload, _ in batch:
            try:
                decoded.append(fields(payload))
            except InputError as error:
                self._refusals.add(topic, error)
        return decoded

    def _add_states(self, odometry: Differentiator, states: Sequence[LiveState]) -> None:
        """Add errors to the readings that odometry in order tells, and publish them."""
        if not self._stamps.done:
            states = self._refusals.keep_timed(self._main, self._stamps, states)
        if not states:
            return
        if self._twist is not None and not self._twist.done:
            for finding in self._twist.add(states):
                self._remark(finding.sentence())
        readings = odometry.apply(
            np.array([state.t_ns for state in states], np.int64),
            np.array([state.q_wb for state in states]).reshape(-1, 4),
            np.array([state.velocity_b for state in states]).reshape(-1, 3),
            np.array([state.angular_velocity_b for state in states]).reshape(-1, 3),
        )
        try:
            self._read(readings)
        except InputError as error:
            self._refusals.add(self._main, error, len(states))

    def _remark_about(self, topic: str) -> Callable[[str], None]:
        """Return a receiver of lines about a topic."""
        return lambda line: self._remark(f"{topic}: {line}")

    def _remark(self, line: str) -> None:
        """Log a probable mistake, at most a few lines a second."""
        time_s = time.monotonic()
        if line.startswith(("input", "rate", "gravity")):  # of the declaration, for good
            self._remarks.append(line)
        if len(self._said) < _REMARKS_A_SECOND or time_s - self._said[0] > 1.0:
            self._said.append(time_s)
            self.get_logger().warning(line)

    # ------------------------------------------------------------------------------ control
    def apply(self, parameters: ErrorNodeParameters) -> None:
        """Apply new errors with the next samples, at the latest 64 later.

        :raises ConfigurationError: for an invalid fault.
        """
        if "inject.kind" in self.changed and parameters.inject.kind != "none":
            self._inject(parameters)
        if any(not name.startswith("inject.") for name in self.changed):
            with self._lock:
                self.model.update(parameters)
            sensor_description.publish(self._description, parameters)

    def _inject(self, parameters: ErrorNodeParameters) -> None:
        """Inject the fault that the parameters describe."""
        fault = parameters.inject.fault()
        with self._lock:
            first_sample = self.model.inject(fault, parameters.inject.delay)
            t_ns = self.model.find_sensor(fault).time_of(first_sample)
        stamp = self.get_clock().now() if t_ns is None else Time(nanoseconds=t_ns)
        name = f"{self.get_name()}: fault"
        self._faults.publish(fault_message(name, fault, "", stamp.to_msg()))

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Restart with the first sample, for the service."""
        with self._lock:
            self.model.reset()
            self._stamps.begin()
            self._reading_strays.begin()
            self._state_strays.begin()
            for strays in self._value_strays.values():
                strays.begin()
            if self._odometry is not None:
                self._odometry.begin()
            if self._twist is not None:
                self._twist.begin()
        response.success, response.message = True, "the errors begin again with the next reading"
        return response

    def _diagnose(self) -> None:
        """Publish counts and rates as diagnostics."""
        stamp = self.get_clock().now().to_msg()
        counts = self.model.counts
        if self._unit_of != (self.parameters, self.model.seed):
            self._unit_of = self.parameters, self.model.seed
            unit = dataclasses.replace(self.parameters, seed=self.model.seed)
            self._unit = drawn_constants({"": unit})
        counters = self.outputs.counters
        strays = self._reading_strays.count + self._state_strays.count
        strays += sum(stray.count for stray in self._value_strays.values())
        self._diagnostics.publish(
            self._report.message(
                stamp, counts, self._refusals.count, strays, self._remarks, counters, self._unit
            )
        )


def _record(readings: Sequence[LiveReading]) -> Readings:
    """Return readings as arrays; their orientations if each has one."""
    q_wb = [reading.q_wb for reading in readings if reading.q_wb is not None]
    return Readings.unchecked(
        t_ns=np.array([reading.t_ns for reading in readings], np.int64),
        gyro=np.array([reading.gyro for reading in readings], order="F"),
        accel=np.array([reading.accel for reading in readings], order="F"),
        q_wb=np.array(q_wb) if q_wb and len(q_wb) == len(readings) else None,
    )


def main() -> int:
    """Run the node."""
    return run.main(NODE, ErrorModelNode)


if __name__ == "__main__":
    signals.watch(is_final=True)
    sys.exit(main())
