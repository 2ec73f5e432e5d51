# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator as a real process, and a listener to it, on a ROS domain of their own."""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from fork_server import Forked, ForkServer
from programs import PATIENCE

from imu_sim_ros.nodes.fast_dds import remove_torn_segments

REPOSITORY = Path(__file__).parents[2]
QUEUE = 20000
WAIT = 0.02  # [s]


def until(condition: Callable[[], Any], act: Callable[[], None], what: str) -> None:
    """Repeat an action until a condition is true."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"waited {PATIENCE} s for {what}"
        act()


@pytest.fixture
def no_torn_segments() -> None:
    """Keep what a killed process left half made from hanging the peers of nodes."""
    remove_torn_segments()


@pytest.fixture(scope="session")
def domains() -> Iterator[tuple[int, int]]:
    """Reserve two ROS domains that no other tests on this machine use; a bound port is the lock."""
    held_sockets: list[socket.socket] = []
    free_domains: list[int] = []
    for domain in random.sample(range(1, 61), 60):
        lock = socket.socket()
        try:
            lock.bind(("127.0.0.1", 26000 + domain))
        except OSError:
            lock.close()
            continue
        held_sockets.append(lock)
        free_domains.append(domain)
        if len(free_domains) == 2:
            break
    yield free_domains[0], free_domains[1]
    for lock in held_sockets:
        lock.close()


class NodeProcess:
    """A node in a process of its own."""

    def __init__(self, process: "subprocess.Popen[bytes] | Forked", log: Path) -> None:
        self.process = process
        self._log = log

    @property
    def output(self) -> str:
        return self._log.read_text()

    def send(self, number: int) -> None:
        self.process.send_signal(number)

    def status(self) -> int:
        """Wait for the end and return the exit status."""
        return self.process.wait(PATIENCE)

    def end(self) -> int:
        self.send(signal.SIGINT)
        return self.status()


WHEELS_PREFIX = Path(__file__).with_name("wheels_prefix")


@pytest.fixture
def tf2_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process and nodes find tf2_msgs; next to ROS 2's wheels, a part made of them."""
    module_spec = find_spec("tf2_msgs")
    if module_spec is None or WHEELS_PREFIX in Path(module_spec.origin or "").parents:
        monkeypatch.syspath_prepend(str(WHEELS_PREFIX))
        monkeypatch.setenv("PYTHONPATH", str(WHEELS_PREFIX))


@pytest.fixture(scope="session")
def fork_server() -> Iterator[Callable[[str, dict[str, str]], ForkServer]]:
    """Return a function that gives the process that forks for each start of a node."""
    servers: dict[str, ForkServer] = {}

    def of_node(name: str, environment: dict[str, str]) -> ForkServer:
        if name not in servers:
            servers[name] = ForkServer(name, environment)
        return servers[name]

    yield of_node
    for server in servers.values():
        server.close()


@pytest.fixture
def start(
    domains: tuple[int, int],
    tmp_path: Path,
    no_torn_segments: None,
    fork_server: Callable[[str, dict[str, str]], ForkServer],
) -> Iterator[Callable[..., NodeProcess]]:
    """Start nodes: ``start("simulator", rate=100, ...)``; they end with the test.

    ``installed`` is a folder with packages of other people; ``program``: by the program that the
    build installs, ``as_module``: by ``python -m``. Else a process that has loaded the node forks.
    """
    started: list[NodeProcess] = []

    def run(
        name: str,
        *arguments: str,
        domain: int | None = None,
        installed: Any = "",
        program: bool = False,
        as_module: bool = False,
        **parameters: Any,
    ) -> Any:
        program_arguments = (
            [*arguments, "--ros-args"] if "--ros-args" not in arguments else [*arguments]
        )
        for key, value in parameters.items():
            shown = str(value).lower() if isinstance(value, bool) else str(value)
            program_arguments += ["-p", f"{key.replace('__', '.')}:={shown}"]
        log = tmp_path / f"node{len(started)}.log"
        paths = [str(REPOSITORY), str(installed), os.environ.get("PYTHONPATH")]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            "ROS_DOMAIN_ID": str(domain or domains[0]),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_PYTHON_CHECK_FIELDS": "1",
        }
        if program or as_module or environment["PYTHONPATH"] != str(REPOSITORY):
            executable = Path(sys.executable).with_name(name)
            command = [str(executable)]
            if as_module or not executable.exists():
                command = [sys.executable, "-m", f"imu_sim_ros.nodes.{name}.node"]
            with log.open("w") as output:
                process: subprocess.Popen[bytes] | Forked = subprocess.Popen(
                    [*command, *program_arguments],
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env=environment,
                )
        else:
            server = fork_server(name, environment)
            process = server.start(program_arguments, environment, log, Path.cwd())
        started.append(NodeProcess(process, log))
        return started[-1]

    yield run
    for node in started:
        if node.process.poll() is None:
            node.process.kill()
            node.process.wait()


ONE_AFTER_THE_OTHER = """
import json, sys
from importlib import import_module
_, name, calls = sys.argv
node = import_module(f"imu_sim_ros.nodes.{name}.node")
for words in json.loads(calls):
    sys.argv[1:] = words
    print("status", node.main(), file=sys.stderr)
"""


@pytest.fixture
def refused(domains: tuple[int, int], tmp_path: Path) -> Callable[..., list[list[str]]]:
    """Return a function that gives the lines of errors of a node for each of several calls.

    The node must end with status 2 each time. All are in one process, whose start takes longer
    than what is tested. It warns of seeds that several simulators in one process share.
    """

    def run(name: str, calls: list[list[str]]) -> list[list[str]]:
        environment = {"PYTHONPATH": str(REPOSITORY), "ROS_DOMAIN_ID": str(domains[0])}
        done = subprocess.run(
            [sys.executable, "-c", ONE_AFTER_THE_OTHER, name, json.dumps(calls)],
            env=os.environ | environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        *error_texts, rest = done.stderr.split("status 2\n")
        assert len(error_texts) == len(calls), done.stderr
        assert rest == ""
        shared = "in this process has it, too"
        return [
            [line for line in error_text.splitlines() if shared not in line]
            for error_text in error_texts
        ]

    return run


class Listener:
    """Subscriptions that keep every message's bytes, and clients for services."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("listener", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._types: dict[str, Any] = {}
        self._subscriptions: list[Any] = []
        self._pause = 0.005
        self._clients: dict[str, Any] = {}
        self.raw: dict[str, list[bytes]] = {}

    def host(self, node: Any) -> None:
        """Spin a node of this process, too."""
        self._executor.add_node(node)
        self._pause = 0.0

    def listen(self, topic: str, kind: Any, depth: int = QUEUE, **qos: Any) -> None:
        """Keep what is published from now on."""
        from rclpy.qos import QoSProfile

        self._types[topic] = kind
        payloads = self.raw.setdefault(topic, [])
        profile = QoSProfile(depth=depth, **qos)
        subscription = self.node.create_subscription(
            kind, topic, payloads.append, profile, raw=True
        )
        self._subscriptions.append(subscription)

    def spin(self, seconds: float = 0.05) -> None:
        """Take what has come, for a moment.

        The executor waits, which costs much more than to take a message: it waits once for all
        messages of a few milliseconds. With another timeout each time it would serve the first of
        what is ready and forget the rest.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=WAIT)
            for subscription in self._subscriptions:
                with subscription.handle:
                    while message_and_info := subscription.handle.take_message(
                        subscription.msg_type, True
                    ):
                        subscription.callback(message_and_info[0])
            time.sleep(self._pause)

    def wait_for_publishers(self) -> None:
        """Spin until each topic has a publisher that knows of the subscription."""
        find = self.node.get_publishers_info_by_topic
        names = [subscription.topic_name for subscription in self._subscriptions]
        self.wait_until(lambda: all(find(name) for name in names), f"publishers of {names}")
        self.spin(0.5)  # they may still have to learn of the subscriptions

    def wait_for(self, topic: str, count: int) -> None:
        """Spin until so many messages of a topic have come in all."""
        payloads = self.raw[topic]
        until(
            lambda: len(payloads) >= count, self.spin, f"{count} on {topic}, {len(payloads)} came"
        )

    def wait_until(self, condition: Callable[[], Any], what: str) -> None:
        """Spin until a condition holds."""
        until(condition, self.spin, what)

    def wait_for_end(self, node: NodeProcess) -> int:
        """Spin until a process has ended and what it sent was taken; return its status."""
        until(lambda: node.process.poll() is not None, self.spin, "the end of a node")
        self.settle()
        return node.status()

    def settle(self) -> None:
        """Spin until nothing more comes: on a busy machine much waits to be taken."""
        previous_total = -1
        while previous_total != (total := sum(len(payloads) for payloads in self.raw.values())):
            previous_total = total
            self.spin(0.5)

    def messages(self, topic: str) -> list[Any]:
        """Return a topic's messages, decoded by rclpy."""
        from rclpy.serialization import deserialize_message

        return [deserialize_message(data, self._types[topic]) for data in self.raw[topic]]

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        """Call a service and return its response."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self.node.create_client(kind, service)
            until(client.service_is_ready, self.spin, f"the service {service}")
            self.spin(0.3)  # the server may still have to learn of this client
        future = client.call_async(kind.Request(**fields))
        until(future.done, self.spin, f"the response of {service}")
        return future.result()

    def set(self, node: str, **values: Any) -> Any:
        """Set parameters of a node as one change; returns the result."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        parameters = [
            Parameter(name.replace("__", "."), value=value).to_parameter_msg()
            for name, value in values.items()
        ]
        service = f"{node}/set_parameters_atomically"
        return self.call(service, SetParametersAtomically, parameters=parameters).result

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def listener_on(
    monkeypatch: pytest.MonkeyPatch, no_torn_segments: None
) -> Iterator[Callable[[int], Listener]]:
    """Make a listener on a domain."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    listeners: list[Listener] = []

    def make(domain: int) -> Listener:
        listeners.append(Listener(domain))
        return listeners[-1]

    yield make
    for listener in listeners:
        listener.close()


@pytest.fixture
def listener(listener_on: Callable[[int], Listener], domains: tuple[int, int]) -> Listener:
    return listener_on(domains[0])
