# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is opened for reading: regular files, and texts of a bounded size."""

import os
import stat
from pathlib import Path
from typing import BinaryIO, Final

from imu_sim_ros.errors import InputError, system_error

LARGEST_TEXT: Final = 16 << 20
"""[bytes] of a file that is read as a whole; the largest of this package have some 10 kB."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file; devices, pipes and folders, of which one may read for ever, are refused.

    :raises InputError: with the reason.
    :raises MachineError: where the system cannot read it.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is not a file name")
    try:
        # Without O_NONBLOCK, opening a pipe waits for its writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise system_error(path, error) from None
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        what = "Is a directory" if stat.S_ISDIR(mode) else "is a device or a pipe, not a file"
        raise InputError(f"{path}: {what}")
    return os.fdopen(descriptor, "rb")


def read_text(path: str | Path) -> str:
    """Return a text file as a whole.

    :raises InputError: for what is not text in UTF-8, or larger than texts are.
    """
    with open_regular(path) as file:
        try:
            content = file.read(LARGEST_TEXT + 1)
        except OSError as error:
            raise system_error(path, error) from None
    if len(content) > LARGEST_TEXT:
        raise InputError(
            f"{path}: larger than {LARGEST_TEXT >> 20} MiB, too large for a parameter file"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file in UTF-8 (byte {error.start})") from None
