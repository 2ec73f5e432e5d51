# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output files that cannot be mistaken for complete ones before they are."""

import os
from contextlib import suppress
from pathlib import Path

from imu_sim_ros.errors import InputError, MachineError, system_error

ACTIVE_SUFFIX = ".active"
"""What ROS 1 appends to the name of a bag that is being recorded."""


def refuse_existing(path: Path) -> None:
    """Refuse a path that exists, or whose folder cannot be created or written.

    :raises InputError: with the reason.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is not a file name")
    try:
        if os.path.lexists(path):
            raise InputError(f"{path}: already exists; nothing is overwritten")
        if os.path.lexists(active_path(path)):
            raise InputError(
                f"{active_path(path)}: an unfinished output is in the way; recover or delete it"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise system_error(path, error) from None
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: the folder {path.parent} cannot be written")


def active_path(path: Path) -> Path:
    """Return the name of a file while it is being written."""
    return path.with_name(path.name + ACTIVE_SUFFIX)


def unfinished(path: Path) -> Path | None:
    """Return what a killed program left of an output; None if nothing.

    That is NAME.active, or NAME or NAME.active in the folder NAME.active that commands write to.
    """
    active = active_path(path)
    if active.is_dir():
        inside = (active / path.name, active / active.name)
        return next((place for place in inside if place.exists()), None)
    return active if active.exists() else None


def make_folder(path: Path) -> None:
    """Create a folder that does not exist yet.

    :raises InputError: where that is impossible.
    """
    refuse_existing(path)
    try:
        path.mkdir()
    except OSError as error:
        raise system_error(path, error) from None


class OutputFile:
    """A file that grows by whole records and gets its name when it is complete."""

    def __init__(self, path: Path, renamed: bool = True) -> None:
        """Open a new file.

        :param renamed: write under the name with ``.active``; files of a rosbag2 folder do not
            need it, because a missing metadata.yaml marks the bag as incomplete.
        """
        refuse_existing(path)
        self.path = path
        self.current = active_path(path) if renamed else path
        try:
            self._file = open(self.current, "x+b", buffering=0)  # noqa: SIM115 - closed by finish
        except OSError as error:
            raise system_error(path, error) from None
        self.position = 0

    def write(self, *parts: bytes | memoryview) -> None:
        """Append parts; where not all of them fit on the disk, none is kept.

        :raises MachineError: with the system's reason, for instance that no space is left.
        """
        position = self.position
        try:
            for part in parts:
                rest = memoryview(part).cast("B")
                while rest:
                    written = os.pwrite(self._file.fileno(), rest, position)
                    position, rest = position + written, rest[written:]
        except OSError as error:
            self.cut(self.position)
            raise MachineError(f"{self.path}: {error.strerror or error}") from None
        # Only now: if the lines above are interrupted, position stays at the end of a record.
        self.position = position

    def cut(self, position: int) -> None:
        """Truncate the file at a position."""
        self.position = position
        with suppress(OSError):
            self._file.truncate(position)

    def rewrite(self, position: int, part: bytes) -> None:
        """Overwrite existing bytes."""
        os.pwrite(self._file.fileno(), part, position)

    def sync(self) -> None:
        """Sync everything to the disk."""
        try:
            os.fdatasync(self._file.fileno())
        except OSError as error:
            raise MachineError(f"{self.path}: {error.strerror or error}") from None

    @property
    def closed(self) -> bool:
        """Whether it was closed, whole or not."""
        return self._file.closed

    def finish(self) -> None:
        """Close the file and give it its name."""
        self.cut(self.position)
        self._file.close()
        if self.current != self.path:
            self.current.rename(self.path)
            self.current = self.path

    def abandon(self, empty: bool = False) -> None:
        """Close the file and keep its partial name; an empty file is removed."""
        self.cut(self.position)
        self._file.close()
        if empty:
            self.current.unlink(missing_ok=True)
