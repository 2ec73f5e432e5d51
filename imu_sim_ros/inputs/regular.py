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
    try:
        _check_kind(path, os.fstat(descriptor).st_mode, stat.S_IFREG)
    except InputError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def is_present(path: str | Path) -> bool:
    """Return whether a file exists that another file, or the form of a folder, names.

    Only what does not exist is absent. What is there and cannot be that file is an error, so that
    nothing a dataset has is left out without a word.

    :raises InputError: for a broken link, a loop of links, a folder, a device or a pipe.
    :raises MachineError: where the system cannot read it.
    """
    return _is_present(Path(path), stat.S_IFREG)


def names_in(folder: str | Path) -> list[str]:
    """Return the sorted names in a folder of a dataset; none where it is absent.

    :raises InputError: as for :func:`is_present`, for what is no folder.
    """
    if not _is_present(Path(folder), stat.S_IFDIR):
        return []
    try:
        return sorted(os.listdir(folder))
    except OSError as error:
        raise system_error(folder, error) from None


def _is_present(path: Path, kind: int) -> bool:
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        for place in (path, *path.parents):
            if os.path.lexists(place):
                if not place.exists():
                    raise InputError(f"{place}: a broken link to {os.readlink(place)}") from None
                break
        return False
    except OSError as error:
        raise system_error(path, error) from None
    except ValueError:
        raise InputError(f"{str(path)!r}: is not a file name") from None
    _check_kind(path, mode, kind)
    return True


def _check_kind(path: str | Path, mode: int, kind: int) -> None:
    """Refuse what is not of a kind.

    :param kind: ``S_IFREG`` or ``S_IFDIR``.
    """
    found = stat.S_IFMT(mode)
    if found == kind:
        return
    if kind == stat.S_IFDIR:
        raise InputError(f"{path}: Not a directory")
    if found == stat.S_IFDIR:
        raise InputError(f"{path}: Is a directory")
    raise InputError(f"{path}: is a device or a pipe, not a file")


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
