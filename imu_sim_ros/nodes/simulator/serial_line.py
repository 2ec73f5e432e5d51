# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sentences of a sensor on a pseudo-terminal, as receivers have a serial line."""

import os
import select
import tty
from contextlib import suppress
from pathlib import Path
from typing import Final

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.sensors.declaration import Serial
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.topics import Encode, Messages

PLAIN: Final = "pty"
"""Value in place of a link if there is none."""


class PseudoTerminal:
    """A terminal that one writes into without ever waiting for its reader.

    What nobody reads is gone: a reader that opens the terminal gets what comes from then on. A
    reader that is too slow loses whole messages.
    """

    def __init__(self, where: str) -> None:
        """Make the terminal, and a symbolic link to it.

        :param where: path of the link; ``pty`` for none.
        :raises InputError: if the link cannot be made.
        """
        self.written = self.lost = 0
        self._rest = b""
        self._master, slave = os.openpty()
        tty.setraw(slave)  # no echo, and line ends as they are
        os.set_blocking(self._master, False)
        self.path = os.ttyname(slave)
        os.close(slave)  # so that a hang-up says that nobody reads
        self._link = None if where == PLAIN else Path(where)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        if self._link is not None:
            try:
                self._make_link(self._link)
            except OSError as error:
                os.close(self._master)
                raise InputError(f"{where}: no link can be made here: {error.strerror}") from None

    @property
    def name(self) -> str:
        """Return the path for reading."""
        return self.path if self._link is None else f"{self._link} ({self.path})"

    def send(self, message: bytes) -> None:
        """Write a message without waiting; a message that the line or no reader takes is lost."""
        if any(event & select.POLLHUP for _, event in self._poll.poll(0)):
            self._rest = b""
            return
        if self._rest:
            self._rest = self._write(self._rest)
        if self._rest:
            self.lost += 1
            return
        self._rest = self._write(message)
        if len(self._rest) == len(message):
            self._rest = b""
            self.lost += 1
        else:
            self.written += 1

    def close(self) -> None:
        """Remove the terminal and its link."""
        if self._link is not None:
            with suppress(OSError):
                if os.readlink(self._link) == self.path:
                    self._link.unlink()
        os.close(self._master)

    def _write(self, content: bytes) -> bytes:
        """Write bytes; return those that did not fit."""
        try:
            return content[os.write(self._master, content) :]
        except BlockingIOError:
            return content

    def _make_link(self, link: Path) -> None:
        """Replace a link of an earlier run, but no other file."""
        if link.is_symlink():
            link.unlink()
        link.symlink_to(self.path)


def messages(serial: Serial[MountedParameters]) -> Encode:
    """Return the function that turns delivered samples into messages of a serial line."""

    def encode(samples: Samples, _: object) -> Messages:
        rows = samples.delivered
        lines = [line.encode("ascii") for line in serial.lines(samples, rows)]
        return Messages(samples.t_ns[rows], samples.release_t_ns[rows], lines)

    return encode
