# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client of a running simulator, for machines without the ``ros2`` command."""

import re
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger

from imu_sim_ros.core.conventions import FAULTS_TOPIC
from imu_sim_ros.core.errors import InputError, MachineError
from imu_sim_ros.nodes import fast_dds

_NODE: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_TURN: Final = 0.05
"""Longest wait in the middleware: a signal is handled after it [s]."""
_SETTLE: Final = 0.3
"""Time in which a discovered service discovers its new client [s]."""


class Status(NamedTuple):
    """Status of the simulator, once per second."""

    words: str
    values: Mapping[str, str]
    """Rates, lateness, counts, as in /diagnostics."""

    def line(self) -> str:
        """Return the status in one line, for a log."""
        state, *rest = self.lines()
        return f"{state:<8} {'  '.join(rest)}"

    def lines(self) -> list[str]:
        """Return state, rates and delays in short lines, for a terminal."""
        values = self.values
        rates = [
            f"{name.removesuffix(' rate [Hz]')} {value} Hz"
            for name, value in values.items()
            if name.endswith(" rate [Hz]")
        ]
        late = "/".join(values.get(f"lateness {name} [us]", "-") for name in ("p50", "p99", "max"))
        delayed = f"{values['caught up samples']} samples late, {values['skipped samples']} skipped"
        return [values["state"], *rates, f"late p50/p99/max {late} us", delayed]


class InjectedFault(NamedTuple):
    """A fault, as published on ``ground_truth/faults``."""

    t_ns: int
    """Stamp of the first sample that it hits."""
    values: Mapping[str, str]
    """Texts by name: kind, imu, triad, duration, value."""

    def line(self) -> str:
        """Return the fault as a line of text."""
        values = self.values
        triad = " ".join(filter(None, (values["imu"], values["triad"])))
        return (
            f"fault: {values['kind']} {triad} {values['value']} for "
            f"{values['duration [s]']} s from stamp {self.t_ns * 1e-9:.9f} s"
        ).replace("  ", " ")


class Control:
    """Calls the services of one simulator and listens to it; use as a context manager.

    :param name: name of the node, with its namespace if it has one, such as ``/left/simulator``.
    :param patience: how long a response may take [s].
    :raises InputError: for an invalid node name.
    """

    def __init__(self, name: str, patience: float) -> None:
        self._name = "/" + name.strip("/")
        if not _NODE.fullmatch(self._name):
            raise InputError(
                f"--node {name!r}: must be a node's name with its namespace, such as "
                "/left/simulator"
            )
        self._patience = patience
        with tempfile.TemporaryDirectory() as folder:
            fast_dds.set_profile(Path(folder))
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            self._node = rclpy.create_node("control", start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *_: object) -> None:
        self._node.destroy_node()
        self._executor.shutdown(timeout_sec=0.1)
        rclpy.try_shutdown()

    def pause(self, paused: bool) -> str:
        """Stop or resume the simulated time; returns the simulator's response."""
        return self._ask("pause", SetBool, SetBool.Request(data=paused))

    def reset(self) -> str:
        """Return to the first sample; returns the simulator's response."""
        return self._ask("reset", Trigger, Trigger.Request())

    def step(self, samples: int | None = None) -> str:
        """Publish samples while paused; returns the simulator's response.

        :param samples: how many; None: its parameter ``step_samples``.
        """
        if samples is None:
            return self._ask("step", Trigger, Trigger.Request())
        request = GetParameters.Request(names=["step_samples"])
        (usual,) = self._call("get_parameters", GetParameters, request).values
        self.set({"step_samples": samples})
        try:
            return self._ask("step", Trigger, Trigger.Request())
        finally:
            self.set({"step_samples": usual.integer_value})

    def set(self, values: Mapping[str, object]) -> None:
        """Set parameters, all of them or none.

        :raises InputError: if the simulator refuses, with its reason.
        """
        parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = self._call("set_parameters_atomically", SetParametersAtomically, request).result
        if not result.successful:
            raise InputError(result.reason.split("; "))

    def set_each(self, values: Mapping[str, object]) -> dict[str, str]:
        """Set parameters, each on its own; returns the reasons of those that are refused."""
        request = SetParameters.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        results = self._call("set_parameters", SetParameters, request).results
        answers = zip(values, results, strict=True)
        return {name: result.reason for name, result in answers if not result.successful}

    def watch(self) -> Iterator[Status | InjectedFault]:
        """Yield the simulator's reports without end: a status each second, and every fault."""
        self._find("pause", SetBool)
        heard: list[Status | InjectedFault] = []
        namespace, _, name = self._name.rpartition("/")

        def hear_status(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.name == f"{name}: stream":
                    values = {entry.key: entry.value for entry in status.values}
                    heard.append(Status(status.message, values))

        def hear_fault(message: DiagnosticArray) -> None:
            stamp = message.header.stamp
            for status in message.status:
                values = {entry.key: entry.value for entry in status.values}
                heard.append(InjectedFault(stamp.sec * 10**9 + stamp.nanosec, values))

        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        faults = f"{namespace}/{FAULTS_TOPIC}"
        self._node.create_subscription(DiagnosticArray, "/diagnostics", hear_status, 10)
        self._node.create_subscription(DiagnosticArray, faults, hear_fault, latched)
        while True:
            self._executor.spin_once(timeout_sec=_TURN)
            while heard:
                yield heard.pop(0)

    def _ask(self, service: str, kind: type, request: object) -> str:
        """Call a service; returns its message.

        :raises InputError: if it reports that it did not succeed.
        """
        response = self._call(service, kind, request)
        if not response.success:
            raise InputError(f"{self._name}: {response.message}")
        return str(response.message)

    def _call(self, service: str, kind: type, request: object) -> Any:
        """Return the response of a service, of its own type."""
        future = self._find(service, kind).call_async(request)
        # ~/step itself responds after 5 s if the samples have not been published by then.
        self._until(future.done, 2 * self._patience, f"does not answer ~/{service}")
        return future.result()

    def _find(self, service: str, kind: type) -> Client:
        """Return a client of a service of the simulator that is ready.

        :param service: name of the service relative to the node.
        :param kind: type of the service.
        """
        client = self._node.create_client(kind, f"{self._name}/{service}")
        self._until(client.service_is_ready, self._patience, "is not available")
        self._spin(_SETTLE)
        return client

    def _until(self, condition: Callable[[], bool], patience: float, what: str) -> None:
        """Process messages until a condition holds.

        :raises MachineError: after ``patience`` seconds; ``what`` did not happen.
        """
        end = time.monotonic() + patience
        while not condition():
            self._executor.spin_once(timeout_sec=_TURN)
            if time.monotonic() > end:
                raise MachineError(
                    f"{self._name} {what} after {patience:g} s{self._other_simulators()}"
                )

    def _spin(self, seconds: float) -> None:
        """Process messages for some seconds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=_TURN)

    def _other_simulators(self) -> str:
        """Return the end of a message that names the other running simulators; empty: none runs.

        A simulator is a node with a service ``~/step``.
        """
        services = (name for name, _ in self._node.get_service_names_and_types())
        nodes = sorted(name.removesuffix("/step") for name in services if name.endswith("/step"))
        alternatives = [name for name in nodes if name != self._name]
        return f"; available: {', '.join(alternatives)} (--node NAME)" if alternatives else ""
