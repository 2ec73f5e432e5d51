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
from programs import PATIENCE, program, until

REPOSITORY = Path(__file__).parents[3]
FEED = REPOSITORY / "test" / "data" / "feed.py"


class Process:
    """A program whose output goes into a file."""

    def __init__(self, arguments: list[str], folder: Path, number: int, environment: dict) -> None:
        self.log = folder / f"{number}.log"
        self._out = self.log.open("w")
        preparation = environment.pop("preparation", None)
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdout=self._out,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment,
            preexec_fn=preparation,
        )

    @property
    def output(self) -> str:
        return self.log.read_text()

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
        self._out.close()


@pytest.fixture
def start(
    tmp_path: Path, domains: tuple[int, int], no_torn_segments: None
) -> Iterator[Callable[..., Process]]:
    """Return a function that starts ``python ARGUMENTS``; all are ended with the test."""
    started: list[Process] = []

    def start_one(*arguments: str, **extra: Any) -> Process:
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domains[0]),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_PYTHON_CHECK_FIELDS": "1",
            "PYTHONPATH": str(REPOSITORY),
            "PYTHONUNBUFFERED": "1",
            **extra,
        }
        process = Process(list(arguments), tmp_path, len(started), environment)
        started.append(process)
        return process

    yield start_one
    for process in started:
        process.kill()


@pytest.fixture
def node(start: Callable[..., Process]) -> Callable[..., Process]:
    """Return a function that starts a node by its name."""
    return lambda name, *arguments, **extra: start(*program(name)[1:], *arguments, **extra)


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
