# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publication of the error model's samples, at once or after the sensor's latency."""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile

from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.core.conventions import IMU_TOPIC
from imu_sim_ros.core.records import LiveReading
from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.publishing import Counter, create
from imu_sim_ros.sensors.imu.declaration import reading_encoder
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import (
    Encode,
    Offered,
    published_topics,
)

DEPTH: Final = 4000
"""Messages kept for a reliable subscriber that has not acknowledged them: 4 s at 1 kHz."""


def topics_to_publish(parameters: ErrorNodeParameters) -> dict[str, Offered]:
    """Return the topics that are published."""
    return published_topics(mount_sensors(parameters), parameters.publish)


class _Output(NamedTuple):
    """A topic that is published: its encoder and its counter."""

    offered: Offered
    encode: Encode
    counter: Counter


class ErrorModelOutputs:
    """Publishers of the node error_model, one for each topic of its parameter ``publish``."""

    def __init__(self, node: Node, parameters: ErrorNodeParameters, fail: Fail) -> None:
        self.counters = [
            Counter(topic, create(node, offer.topic.type, topic, QoSProfile(depth=DEPTH)))
            for topic, offer in topics_to_publish(parameters).items()
        ]
        self._delayed = Delayed(fail)
        self.encode_for(parameters)
        (output, *further_outputs) = self._outputs
        self.has_readings_alone = not further_outputs and output.offered.topic.name == IMU_TOPIC
        """True if the readings are all that is published."""

    def encode_for(self, parameters: ErrorNodeParameters) -> None:
        """Encode messages in the frame of parameters from now on."""
        offers = topics_to_publish(parameters)
        self._outputs = [
            _Output(offers[counter.topic], offers[counter.topic].encoder(), counter)
            for counter in self.counters
        ]
        self._valid: ErrorNodeParameters | None = None
        """Parameters of the encoder of single readings."""

    def publish_readings(
        self, readings: Sequence[LiveReading], parameters: ErrorNodeParameters
    ) -> None:
        """Publish readings that leave the driver at once, the messages of :meth:`publish`."""
        offer, _, counter = self._outputs[0]
        if parameters is not self._valid:
            self._valid = parameters
            self._encoder = reading_encoder(offer.mounted.frame, parameters)
        message = self._encoder.message
        payloads = [message(t_ns, gyro, accel) for t_ns, gyro, accel, _ in readings]
        self._delayed.send(counter.send, payloads, ())

    def publish(self, samples: Mapping[str, Samples], parameters: ErrorNodeParameters) -> None:
        """Publish the messages of samples by sensor; readings with the delay that they have.

        A window has the IMU's, or those of another sensor.
        """
        for offer, encode, counter in self._outputs:
            if offer.name not in samples:
                continue
            samples_of_sensor = samples[offer.name]
            messages = encode(samples_of_sensor, parameters)
            payloads = as_list(messages.made())
            if offer.topic.truth:  # only what the sensor's driver releases has a latency
                for payload in payloads:
                    counter.send(payload)
                continue
            release_t_ns, true_t_ns = samples_of_sensor.release_t_ns, samples_of_sensor.true_t_ns
            delays: Sequence[int] = ()
            if release_t_ns is not true_t_ns:
                delays = (release_t_ns - true_t_ns)[samples_of_sensor.delivered].tolist()
            self._delayed.send(counter.send, payloads, delays)

    def close(self) -> None:
        """Publish the waiting messages, and end the thread."""
        self._delayed.close()


class Delayed:
    """Sends messages after their delays, in order; at once if there is none."""

    def __init__(self, fail: Fail) -> None:
        self._fail = fail
        self._waiting: deque[tuple[int, Callable[[bytes], None], bytes]] = deque()
        self._new = threading.Condition()
        self._ended = False
        self._thread: SupervisedThread | None = None

    def send(
        self, send: Callable[[bytes], None], payloads: Sequence[bytes], delays: Sequence[int]
    ) -> None:
        """Send messages.

        :param delays: delay of each, from now on [ns]; empty: none has any.
        """
        if self._thread is None and not any(delays):
            for payload in payloads:
                send(payload)
            return
        if self._thread is None:  # from now on all go this way, so that they stay in order
            self._thread = SupervisedThread("latency", self._run, self._fail)
            self._thread.start()
        now_ns = time.monotonic_ns()
        with self._new:
            for payload, delay in zip(payloads, delays or [0] * len(payloads), strict=True):
                self._waiting.append((now_ns + delay, send, payload))
            self._new.notify()

    def close(self) -> None:
        """Send the rest without waiting, and end."""
        with self._new:
            self._ended = True
            self._new.notify()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        """Publish each message when it is due; runs in a thread."""
        while True:
            with self._new:
                while not self._waiting and not self._ended:
                    self._new.wait()
                if not self._waiting:
                    return
                due, send, payload = self._waiting[0]
                remaining = (due - time.monotonic_ns()) * 1e-9
                if remaining > 0.0 and not self._ended:
                    self._new.wait(remaining)
                    continue
                self._waiting.popleft()
            send(payload)
