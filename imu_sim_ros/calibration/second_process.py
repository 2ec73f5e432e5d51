# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An object in a process of its own: another core works on it while this one goes on.

Threads would not do: between short NumPy calls they wait for each other's interpreter lock.
"""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import IO, Any, Final

from imu_sim_ros.errors import MachineError

_CALLS_AHEAD: Final = 12
"""Calls that may wait for the process; the next one waits for a place."""
_PIPE: Final = 1 << 20
"""[bytes] As much as Linux allows: the process finds its next call there."""
_CODE: Final = """
import sys
sys.path[:] = {path!r}
from imu_sim_ros.calibration.second_process import serve
serve()
"""


class SecondProcess:
    """An object whose methods are called in another process, one after the other.

    Use as a context manager: its end ends the process. That process has a session of its own, so
    Ctrl-C reaches this one alone, and it ends by itself where this one is killed.
    """

    def __init__(self) -> None:
        """Start the process; does not wait for it.

        :raises OSError: where no process can be started.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-c", _CODE.format(path=sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            pipesize=_PIPE,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        # Queues without locks in Python: a signal's exception must not leave one taken.
        self._calls: SimpleQueue[object] = SimpleQueue()
        self._places: SimpleQueue[None] = SimpleQueue()
        for _ in range(_CALLS_AHEAD):
            self._places.put(None)
        self._sender = threading.Thread(target=self._send, daemon=True)
        self._sender.start()

    def __enter__(self) -> "SecondProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def make(self, make: Callable[..., Any], *arguments: object) -> None:
        """Make the object there.

        :param make: a class or function of a module.
        """
        self._places.get()
        self._calls.put((make, arguments))

    def call(self, method: str, *arguments: object) -> None:
        """Call a method that returns nothing, after the calls before it; does not wait for it.

        :param arguments: must not change any more.
        """
        self._places.get()
        self._calls.put((method, arguments))

    def result(self, method: str) -> Any:
        """Return what a method returns after the calls before it; the last call.

        :raises Exception: what it, or one of the calls before it, raised there.
        :raises MachineError: where the process has ended without a result.
        """
        self.call(method)
        self._calls.put(None)
        try:
            found, error = pickle.load(self._output)
        except (EOFError, pickle.UnpicklingError):
            status = self._process.wait()
            raise MachineError(
                f"the second process of this program ended with status {status}: enough memory?"
            ) from None
        if error is not None:
            raise error
        return found

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        self._calls.put(None)
        self._sender.join()
        with suppress(OSError):  # what could not be sent is no longer wanted
            self._input.close()
        self._output.close()

    def _send(self) -> None:
        """Send the calls; once the process has ended, drop them."""
        lost = False
        while (call := self._calls.get()) is not None:
            try:
                if not lost:
                    pickle.dump(call, self._input, pickle.HIGHEST_PROTOCOL)
                    self._input.flush()
            except OSError:
                lost = True
            self._places.put(None)


def serve() -> None:
    """Be the other process: calls come through standard input, a result leaves by the output."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed must not get into the result
    found, failure = None, None
    try:
        make, arguments = pickle.load(sys.stdin.buffer)
        subject = make(*arguments)
        while True:
            method, arguments = pickle.load(sys.stdin.buffer)
            found = getattr(subject, method)(*arguments)
            if found is not None:
                break
    except EOFError:  # nobody wants a result any more
        return
    except Exception as error:
        failure = error
    with suppress(BrokenPipeError), answers:
        pickle.dump((found, failure), answers)
