# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real processes for the tests of integrator and recorder, on a ROS domain of their own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fork_server import Forked, ForkServer
from programs import PATIENCE, program, until

REPOSITORY = Path(__file__).parents[3]
FEED = REPOSITORY / "test" / "data" / "feed.py"


class Process:
    """A program whose output goes into a file."""

    def __init__(self, process: "subprocess.Popen[bytes] | Forked", log: Path) -> None:
        self.process, self._log = process, log

    @property
    def output(self) -> str:
        return self._log.read_text()

    def wait_for(self, text: str, count: int = 1) -> None:
        """Wait until the program has printed something so many times."""
        until(lambda: self.output.count(text) >= count or self.process.poll() is not None)
        assert text in self.output, self.output

    def wait_until(self, condition: Callable[[], bool]) -> None:
        """Wait until a condition holds while the program runs."""
        until(lambda: condition() or self.process.poll() is not None)

    def wait_until_it_catches(self, number: int) -> None:
        """Wait until the process has a handler of its own for a signal (proc(5), SigCgt)."""

        def catches() -> bool:
            text = Path(f"/proc/{self.process.pid}/status").read_text()
            mask = int(text.partition("SigCgt:")[2].split(maxsplit=1)[0], 16)
            return bool(mask >> (number - 1) & 1)

        until(lambda: self.process.poll() is not None or catches())

    def send(self, number: int) -> None:
        self.process.send_signal(number)

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal and return the exit status."""
        self.send(number)
        return self.status()

    def status(self) -> int:
        return self.process.wait(PATIENCE)

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def processes(no_torn_segments: None) -> Iterator[list[Process]]:
    """Return a list of processes, which are ended with the test."""
    started: list[Process] = []
    yield started
    for process in started:
        process.kill()


def environment_on(domain: int) -> dict[str, str]:
    """Return the environment of a process on a ROS domain."""
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
        "PYTHONPATH": str(REPOSITORY),
        "PYTHONUNBUFFERED": "1",
    }


@pytest.fixture
def start(
    tmp_path: Path, domains: tuple[int, int], processes: list[Process]
) -> Callable[..., Process]:
    """Return a function that starts ``python ARGUMENTS``."""

    def start_python(
        *arguments: str, preparation: Callable[[], None] | None = None, **variables: str
    ) -> Process:
        log = tmp_path / f"{len(processes)}.log"
        with log.open("w") as output:
            process = subprocess.Popen(
                [sys.executable, *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=tmp_path,
                env=environment_on(domains[0]) | variables,
                preexec_fn=preparation,
            )
        processes.append(Process(process, log))
        return processes[-1]

    return start_python


@pytest.fixture
def node(
    tmp_path: Path,
    domains: tuple[int, int],
    processes: list[Process],
    start: Callable[..., Process],
    fork_server: Callable[[str, dict[str, str]], ForkServer],
) -> Callable[..., Process]:
    """Return a function that starts a node by its name.

    A process that has loaded the node forks, unless the process is to have variables of its own
    or a preparation: then the program starts.
    """

    def start_node(name: str, *arguments: str, **extra: Any) -> Process:
        if extra:
            return start(*program(name)[1:], *arguments, **extra)
        log, environment = tmp_path / f"{len(processes)}.log", environment_on(domains[0])
        server = fork_server(name, environment)
        processes.append(Process(server.start([*arguments], environment, log, tmp_path), log))
        return processes[-1]

    return start_node


@pytest.fixture
def feed(domains: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Return a function that starts the driver of feed.py in this process."""
    from feed import Driver  # needs rclpy

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    started: list[Any] = []

    def feed_with(**options: Any) -> Any:
        started.append(Driver({**options, "patience": PATIENCE}, domains[0]))
        return started[-1]

    yield feed_with
    for driver in started:
        driver.close()


@pytest.fixture
def feed_apart(start: Callable[..., Process]) -> Callable[..., Process]:
    """Return a function that starts the driver of feed.py in a process, which can be killed."""
    return lambda **options: start(str(FEED), json.dumps({**options, "patience": PATIENCE}))


@pytest.fixture
def without_shared_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use sockets, which vanish with a killed process; its shared memory would stay."""
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
