# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process that has loaded a node's modules and forks for each start of the node.

Nine tenths of a node's start are imports. What it forks is a process like any other, with a PID,
signals, streams and an exit status of its own; rclpy is initialised in it, after the fork.

As a program, with the descriptor of a socket and the node's name: a line of JSON in, one out.
"""

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any


class ForkServer:
    """The process of one node, as the tests see it."""

    def __init__(self, name: str, environment: dict[str, str]) -> None:
        mine, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, __file__, str(theirs.fileno()), name],
                pass_fds=[theirs.fileno()],
                env=environment,
            )
        self._socket, self._stream = mine, mine.makefile("rw")

    def ask(self, **request: Any) -> Any:
        """Send a request; return the answer."""
        print(json.dumps(request), file=self._stream, flush=True)
        return json.loads(self._stream.readline())

    def start(self, arguments: list[str], environment: dict[str, str], log: Path) -> "Forked":
        """Start the node, with its output in a file, in the working folder of this process."""
        log.touch()
        request = {"arguments": arguments, "environment": environment, "folder": os.getcwd()}
        return Forked(self, self.ask(**request, log=str(log)))

    def close(self) -> None:
        self._stream.close()
        self._socket.close()
        self._process.wait()


class Forked:
    """The part of ``subprocess.Popen`` that the tests use, for a process that a server forked."""

    def __init__(self, server: ForkServer, pid: int) -> None:
        self._server = server
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._server.ask(pid=self.pid)
        return self.returncode

    def wait(self, timeout: float = 60.0) -> int:
        end = time.monotonic() + timeout
        while (status := self.poll()) is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
            time.sleep(0.01)
        return status

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def serve(descriptor: int, name: str) -> int:
    """Answer requests to their end; in a fork, run the node and return its status."""
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
    # Destructors of C++ libraries that were loaded before the fork crash behind it; they are
    # tested where tests start the program itself.
    os._exit(status)
