# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process that has loaded a node's modules and forks for each start of the node.

Nine tenths of a node's start are imports. A forked process has a PID, signals, streams and an exit
status of its own; rclpy is initialised in it, after the fork.

Run as a program with the descriptor of a socket and the node's name, this file answers each line
of JSON with one.
"""

import atexit
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from programs import PATIENCE


class ForkServer:
    """Process of a node's modules, which forks for the tests."""

    def __init__(self, name: str, environment: dict[str, str]) -> None:
        self._socket, remote = socket.socketpair()
        with remote:
            self._process = subprocess.Popen(
                [sys.executable, __file__, str(remote.fileno()), name],
                pass_fds=[remote.fileno()],
                env=environment,
            )
        self._stream = self._socket.makefile("rw")

    def ask(self, **request: Any) -> Any:
        """Send a request; return the answer."""
        print(json.dumps(request), file=self._stream, flush=True)
        return json.loads(self._stream.readline())

    def start(
        self, arguments: list[str], environment: dict[str, str], log: Path, folder: Path
    ) -> "Forked":
        """Start the node in a working folder, with its output in a file."""
        log.touch()
        request = {"arguments": arguments, "environment": environment, "folder": str(folder)}
        return Forked(self, self.ask(**request, log=str(log)))

    def close(self) -> None:
        """End the process and wait for it."""
        self._stream.close()
        self._socket.close()
        self._process.wait()


class Forked:
    """Process that a server forked, with the part of ``subprocess.Popen`` that the tests use."""

    def __init__(self, server: ForkServer, pid: int) -> None:
        self._server = server
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit status; None while the process runs."""
        if self.returncode is None:
            self.returncode = self._server.ask(pid=self.pid)
        return self.returncode

    def wait(self, timeout: float = PATIENCE) -> int:
        """Return the exit status once the process has ended.

        :param timeout: longest wait [s].
        :raises subprocess.TimeoutExpired: if the process still runs then.
        """
        if (status := self.poll()) is None:
            descriptor = os.pidfd_open(self.pid)  # of a child of the server, which collects it
            try:
                select.select([descriptor], [], [], timeout)
            finally:
                os.close(descriptor)
            if (status := self.poll()) is None:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal to the process if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill the process."""
        self.send_signal(signal.SIGKILL)


def serve(descriptor: int, name: str) -> int:
    """Answer requests until the socket closes; in a forked process, return the node's status."""
    from imu_sim_ros.nodes import start
    from imu_sim_ros.terminal import startup

    for module in ("help", f"{name}.node"):
        startup.load(f"imu_sim_ros.nodes.{module}")
    with socket.socket(fileno=descriptor) as connection, connection.makefile("rw") as stream:
        for line in stream:
            request = json.loads(line)
            if "pid" in request:
                pid, status = os.waitpid(request["pid"], os.WNOHANG)
                answer = os.waitstatus_to_exitcode(status) if pid else None
            elif not (answer := os.fork()):
                break
            print(json.dumps(answer), file=stream, flush=True)
        else:
            return 0
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    with open(request["log"], "w") as log:
        for stream_descriptor in (1, 2):
            os.dup2(log.fileno(), stream_descriptor)
    if "PYTHONUNBUFFERED" in os.environ:
        sys.stdout.reconfigure(write_through=True)
    sys.argv = [name, *request["arguments"]]
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # as in the program that the build writes
    return int(getattr(start, name)())


if __name__ == "__main__":
    status = serve(int(sys.argv[1]), sys.argv[2])
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and not thread.daemon:
            thread.join()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    # Threads and exit functions end as those of any program. Destructors of C++ libraries do not
    # run: in a forked process, those of libraries loaded before the fork crash. Tests that start
    # the program itself run them.
    os._exit(status)
