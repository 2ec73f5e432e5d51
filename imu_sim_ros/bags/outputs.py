# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything a program writes: refused before any work begins, or renamed when it is complete."""

import errno
import fcntl
import glob
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from imu_sim_ros.core.errors import ImuSimError, InputError, MachineError, system_error
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.terminal.progress import current_watcher

ACTIVE_SUFFIX = ".active"
"""Suffix of the name of a bag that is being recorded, as in ROS 1."""


def refuse_existing(path: Path) -> None:
    """Refuse a path that exists, or whose folder cannot be created or written.

    :raises InputError: with the reason.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is not a file name")
    try:
        for existing in (path, active_path(path)):
            if is_being_written(existing):
                raise _concurrent_writer(existing)
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


def lock_output(descriptor: int) -> None:
    """Lock an open file or folder until it is closed, so that others see that it is being written.

    A reader that tests the lock holds it for a moment, so that several attempts are made.
    """
    for _ in range(_LOOKS):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_LOOK)
        except OSError:  # a file system without locks
            return
        else:
            return


def is_being_written(path: Path) -> bool:
    """Return whether a program of this package is writing a file or folder."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return is_locked(descriptor)
    finally:
        os.close(descriptor)


def is_locked(descriptor: int) -> bool:
    """Return whether a program of this package is writing an open file or folder."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        fcntl.flock(descriptor, fcntl.LOCK_UN)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    return False


def active_path(path: Path) -> Path:
    """Return the name of a file while it is being written."""
    return path.with_name(path.name + ACTIVE_SUFFIX)


def resolve_name(path: Path) -> Path:
    """Return a path that ends in a name: ``.`` is the working folder; only the root has none."""
    return Path(os.path.abspath(path)) if path.name in ("", "..") else path


def find_unfinished_output(path: Path) -> Path | None:
    """Return the remains of an output of a killed program; None if there are none.

    That is NAME.active, or NAME or NAME.active in the folder NAME.active that commands write to.
    """
    active = active_path(path)
    if active.is_dir():
        candidates = (active / path.name, active / active.name)
        return next((part for part in candidates if part.exists()), None)
    return active if active.exists() else None


def make_folder(path: Path) -> None:
    """Create a folder that does not exist yet.

    :raises InputError: if that is impossible.
    """
    refuse_existing(path)
    try:
        path.mkdir()
    except OSError as error:
        raise system_error(path, error) from None


def make_locked_folder(path: Path) -> int:
    """Create a folder as :func:`make_folder` does, and lock it.

    :returns: a descriptor; the folder is locked until it is closed.
    """
    make_folder(path)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise system_error(path, error) from None
    lock_output(descriptor)
    return descriptor


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file, or none.

    :raises ImuSimError: if it cannot be written, with the reason.
    """
    try:
        path.write_bytes(data)
    except OSError as error:
        path.unlink(missing_ok=True)
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
        lock_output(self._file.fileno())
        self.position = 0

    def write(self, *parts: bytes | memoryview) -> None:
        """Append parts; if they do not all fit on the disk, none is kept.

        :raises MachineError: with the system's reason, for instance that no space is left.
        """
        self._check_untouched()
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

    def _check_untouched(self) -> None:
        """Refuse to go on in a file that another program has truncated or deleted.

        :raises MachineError: if it has.
        """
        status = os.fstat(self._file.fileno())
        if status.st_size < self.position:
            raise MachineError(
                f"{self.path}: another program has truncated it to {status.st_size} of "
                f"{self.position} bytes"
            )
        if not status.st_nlink:
            raise MachineError(f"{self.path}: another program has deleted it")

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
            sync = os.fdatasync if hasattr(os, "fdatasync") else os.fsync  # macOS has the latter
            sync(self._file.fileno())
        except OSError as error:
            raise MachineError(f"{self.path}: {error.strerror or error}") from None

    @property
    def closed(self) -> bool:
        """True if the output was closed, complete or not."""
        return self._file.closed

    def finish(self) -> None:
        """Close the file and give it its name.

        :raises InputError: if something else has this name by now.
        """
        self._check_untouched()
        if self.current != self.path:
            _refuse_newcomer(self.path)
        self.cut(self.position)
        with current_watcher().undisturbed():  # what is closed has its name
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


def _refuse_newcomer(path: Path) -> None:
    """Refuse to replace a file that appeared under an output's name in the meantime."""
    if os.path.lexists(path):
        raise InputError(f"{path}: appeared in the meantime; nothing is overwritten")


PARTIAL: Final = "partial"
_LOOK: Final = 0.01
"""Time between two tries to lock a staging folder [s]."""
_LOOKS: Final = 50
"""Tries for one's own folder, which another program may be looking at."""
_LONGEST_ADDITION: Final = len(".partial99")
_OURS: Final = frozenset(
    {
        *(".bag", ".mcap", ".db3", ".yaml", ".json", ".csv", ".npz", ".tum", ".txt", ".log"),
        *(".png", ".svg", ".pdf", ".jpg", ".html", ".parquet", ".bin", ".ply", ".pcd"),
    }
)
"""File suffixes of output folders: a folder with any other file in it is not replaced."""
_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FILES_LOOKED_AT: Final = 100_000
"""Largest number of folders in an output folder that are looked through before it is replaced."""


@dataclass
class Target:
    """One output, and where it is written until it is complete."""

    final: Path
    """Final path: that of a file or of a folder that is made as a whole, or that of a
    folder, which may exist, for some files."""
    folder: Path
    """The folder, in the end, of what is in ``staging``."""
    paths: list[Path]
    """Every path that will be written."""
    staging: Path
    """The folder that is renamed from; it lies next to the target."""
    path: Path
    """Path for writing."""
    keep_partial: bool = False
    """True if the complete part is kept under a partial name when the program is interrupted."""
    companion_of: "Target | None" = None
    """An output of the same folder, in whose staging folder this one is written, so that a killed
    program leaves one folder. With ``keep_partial`` this output is complete before the first part
    of that one, and is kept under the name of that part."""
    summary: Callable[[], str] | None = None
    """Describes the contents of a kept part: "812 messages up to stamp 4.06 s". None: there is no
    whole part yet, for its files are only being opened."""


class Outputs:
    """The outputs of one run of a program, which lie in staging folders until they are whole.

    Add all of them first, and write them inside ``staged``. That refuses, all together, those that
    exist (unless ``force``), that are an input, that cannot be made; and makes their parents. The
    end of the block gives every output its name; an error removes what was written. Ctrl-C and the
    like (any exception that is no :class:`Exception`) leave targets with ``keep_partial`` as
    ``NAME.partial.EXT``; the exception's args then get a line about each::

        outputs = Outputs(inputs=[bag], force=arguments.force)
        table = outputs.add(Path("table.csv"))
        with outputs.stage():
            write_csv(table.path, ...)
    """

    def __init__(
        self,
        inputs: Iterable[str | Path] = (),
        force: bool = False,
        discard_partial: bool = False,
    ) -> None:
        """Set up without targets.

        :param inputs: files and folders that are read; none of them is ever written to.
        :param force: replace what exists.
        :param discard_partial: keep nothing of an interrupted run.
        """
        self.force, self.discard_partial = force, discard_partial
        self._inputs = [Path(path) for path in inputs]
        self._targets: list[Target] = []

    def add(
        self,
        path: str | Path,
        *,
        endings: Sequence[str] = (),
        keep_partial: bool = False,
        companion_of: Target | None = None,
    ) -> Target:
        """Add a file, or a folder that is made as a whole.

        :param path: final path.
        :param endings: allowed endings of the name; if empty, any.
        :param keep_partial: keep complete parts when the program is interrupted.
        :param companion_of: an output of the same folder.
        :returns: the output, with the ``path`` for writing. Siblings with its stem (``NAME_0.bag``)
            are renamed as well.
        """
        final = Path(path)
        if endings and final.suffix.lower() not in endings:
            raise InputError(f"{path}: must end in {' or '.join(endings)}")
        owner = companion_of
        staging = owner.staging if owner else final.parent / (final.name + ACTIVE_SUFFIX)
        target = Target(
            final, final.parent, [final], staging, staging / final.name, keep_partial, owner
        )
        self._targets.append(target)
        return target

    def add_files(self, folder: str | Path, names: Iterable[str]) -> Path:
        """Add files of a folder that may exist, with other files in it.

        :returns: the folder to write them to.
        """
        final = Path(folder)
        staging = final.parent / (final.name + ACTIVE_SUFFIX)
        paths = [final / name for name in names]
        self._targets.append(Target(final, final, paths, staging, staging))
        return staging

    @contextmanager
    def stage(self) -> Iterator[None]:
        """Stage the outputs during a block of work, and give them their names after it.

        :raises InputError: with a line for each output that cannot be written.
        """
        problems = [problem for target in self._targets for problem in self._problems(target)]
        problems += self._collisions()
        if problems:
            raise InputError(problems)
        staged = [target for target in self._targets if target.companion_of is None]
        follower = current_watcher()
        with ExitStack() as ending, ExitStack() as cleanup:
            for target in staged:
                folder = target.staging
                try:
                    missing = [p for p in (folder.parent, *folder.parent.parents) if not p.exists()]
                    for parent in reversed(missing):
                        parent.mkdir(exist_ok=True)
                        cleanup.callback(_remove_empty, parent)
                    if os.path.lexists(folder):
                        self._remove_stale(folder)
                    with follower.undisturbed():  # else a folder could remain
                        lock = _claim(folder)
                        cleanup.callback(os.close, lock)
                        cleanup.callback(_remove_own, folder, lock)
                    # One that found it unlocked may be looking whether it is stale.
                    _lock(lock, folder, _LOOKS)
                except OSError as error:
                    raise system_error(target.final, error) from None
            try:
                yield
            except BaseException as error:
                ending.enter_context(follower.undisturbed())
                if not isinstance(error, Exception) and not self.discard_partial:
                    error.args = (*error.args, *self._keep_parts(staged))
                if isinstance(error, OSError) and error.errno in _FULL and error.filename is None:
                    # The error of a write has no file name; the failed one is among these.
                    error.filename = ", ".join(str(target.final) for target in self._targets)
                if isinstance(error, ImuSimError):
                    final_lines = [self._replace_staging_names(line) for line in error.problems]
                    raise type(error)(final_lines) from None
                raise
            ending.enter_context(follower.undisturbed())
            entries: dict[Path, list[Path]] = {}
            for target in staged:  # all before the first gets its name: none is left alone
                try:
                    entries[target.staging] = sorted(target.staging.iterdir())
                except OSError as error:
                    raise system_error(target.final, error) from None
                for entry in () if self.force else entries[target.staging]:
                    _refuse_newcomer(target.folder / entry.name)
            for target in staged:
                try:
                    target.folder.mkdir(exist_ok=True)
                    for entry in entries[target.staging]:
                        output = target.folder / entry.name
                        if output.is_dir() and not output.is_symlink():
                            # removed with the staging folder
                            output.rename(active_path(entry))
                        entry.rename(output)
                except OSError as error:
                    raise system_error(target.final, error) from None
                follower.complete(target.final)

    def _problems(self, target: Target) -> Iterator[str]:
        """Yield the problems of a target, at most one line for each of its paths."""
        final = target.final
        if final.name in ("", "..") or "\0" in str(final):
            yield f"{str(final)!r}: is not a file name"
            return
        try:
            longest = os.pathconf("/", "PC_NAME_MAX") - _LONGEST_ADDITION
            if len(os.fsencode(final.name)) > longest:
                yield f"{final.name[:40]}...: the name is longer than {longest} bytes"
                return
            if target.paths != [final] and os.path.lexists(final) and not final.is_dir():
                yield f"{final}: exists and is not a folder"
                return
            ancestor = next(
                folder for folder in final.absolute().parents if os.path.lexists(folder)
            )
            if not ancestor.is_dir():
                yield f"{final}: {ancestor} is not a folder"
                return
            for output in target.paths:
                existing = [output] if os.path.lexists(output) else []
                if output.suffix:  # the files of an output that is split
                    pattern = f"{glob.escape(output.stem)}_*{glob.escape(output.suffix)}"
                    existing += [
                        part
                        for part in output.parent.glob(pattern)
                        if part.stem.removeprefix(output.stem + "_").isdecimal()
                    ]
                for path in existing[:1]:
                    used = self._input_in(path)
                    if used:
                        yield f"{output}: {used}; an input is never overwritten"
                    elif is_being_written(path):
                        yield str(_concurrent_writer(path))
                    elif not path.is_symlink() and not path.is_file() and not path.is_dir():
                        yield f"{output}: exists and is neither a file nor a folder"
                    elif not self.force:
                        yield f"{path}: already exists; {argument('force', True)} replaces it"
                    elif path.is_dir() and not path.is_symlink():
                        yield from _irreplaceable(path)
        except OSError as error:
            yield f"{final}: {error.strerror or error}"

    def _input_in(self, output: Path) -> str:
        """Return the input that is this existing file or folder, is in it, or contains it."""
        output_path = Path(os.path.realpath(output))
        for input_path in self._inputs:
            if not input_path.exists():
                continue
            input_real = Path(os.path.realpath(input_path))
            if output_path == input_real or (
                output.exists() and os.path.samefile(output, input_path)
            ):
                return f"is the input {input_path}"  # by its name, or a link of any kind
            if output_path in input_real.parents:
                return f"holds the input {input_path}"
            if input_real in output_path.parents:
                return f"lies in the input {input_path}"
        return ""

    def _collisions(self) -> Iterator[str]:
        """Yield targets that are, or lie in, one another."""
        previous: list[tuple[Path, Path, bool]] = []
        for target in self._targets:
            for output in target.paths:
                try:
                    real = Path(os.path.realpath(output.parent)) / output.name
                except OSError:
                    continue
                for previous_real, previous_output, whole in previous:
                    if real == previous_real:
                        yield f"{output}: two outputs would have this name"
                    elif whole and (previous_real in real.parents or real in previous_real.parents):
                        yield f"{output}: another output is {previous_output}"
                previous.append((real, output, target.paths == [target.final]))

    def _remove_stale(self, staging: Path) -> None:
        """Remove the remains of a killed run, with ``force``; never the output of a running one."""
        with ExitStack() as looking:
            if is_being_written(staging):
                raise _concurrent_writer(staging)
            folder = staging.is_dir() and not staging.is_symlink()
            if folder:
                lock = _open(staging)
                looking.callback(os.close, lock)
                _lock(lock, staging)
            if not self.force:
                raise InputError(
                    f"{staging}: an unfinished output is in the way; recover or delete it, or "
                    f"{argument('force', True)}"
                )
            # Still locked: another program that finds it, too, does not take it for its own.
            if folder:
                shutil.rmtree(staging)
            else:
                staging.unlink()

    def _keep_parts(self, staged: Sequence[Target]) -> list[str]:
        """Rename the complete parts of an interrupted run, and describe their contents."""
        lines = []
        companions = {target.path for target in self._targets if target.companion_of is not None}
        for target in staged:
            if not target.keep_partial or target.summary is None:
                continue
            names: list[str] = []
            for entry in sorted(target.staging.iterdir()):
                if entry in companions or (entry.is_dir() and not any(entry.iterdir())):
                    continue
                partial = _partial_name(target.final.with_name(entry.name))
                entry.rename(partial)
                names.append(str(partial))
            if names:
                suffix = f" and {len(names) - 1} more files" if len(names) > 1 else ""
                companion_names = self._keep_companions(target, Path(names[0]).name)
                next_to_it = f", with {', '.join(companion_names)}" if companion_names else ""
                lines.append(f"{names[0]}{suffix}: {target.summary()}{next_to_it}")
        return lines

    def _keep_companions(self, target: Target, part: str) -> list[str]:
        """Rename an output's complete companions like its kept part."""
        names = []
        for companion in self._targets:
            if (
                companion.companion_of is not target
                or not companion.keep_partial
                or not companion.path.exists()
            ):
                continue
            companion_name, owner = companion.final.name, target.final
            stem = owner.name if companion_name.startswith(owner.name) else owner.stem
            partial = companion.final.with_name(
                part.removesuffix(owner.name.removeprefix(stem)) + companion_name.removeprefix(stem)
            )
            companion.path.rename(partial)
            names.append(partial.name)
        return names

    def _replace_staging_names(self, line: str) -> str:
        """Return a line with the targets' names in place of the staging ones."""
        for target in self._targets:
            folder_text = "" if target.folder == Path() else f"{target.folder}/"
            line = line.replace(f"{target.staging}/", folder_text)
        return line


def _claim(staging: Path) -> int:
    """Make a staging folder; return its descriptor.

    :raises InputError: if another program was faster.
    """
    try:
        staging.mkdir()
    except FileExistsError:
        raise _concurrent_writer(staging) from None
    return _open(staging)


def _open(staging: Path) -> int:
    """Return a descriptor of a staging folder that exists."""
    try:
        return os.open(staging, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        raise _concurrent_writer(staging) from None


def _remove_own(staging: Path, lock: int) -> None:
    """Remove a staging folder, but not one that another program has put in its place."""
    with suppress(InputError):
        _lock(lock, staging)
        shutil.rmtree(staging, ignore_errors=True)


def _lock(descriptor: int, staging: Path, looks: int = 1) -> None:
    """Lock an open staging folder.

    :raises InputError: if another program has it, or has put its own in its place.
    """
    for _ in range(looks):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_LOOK)
            continue
        except OSError:  # a file system without locks
            pass
        if _is_still(descriptor, staging):
            return
        break
    raise _concurrent_writer(staging)


def _is_still(descriptor: int, path: Path) -> bool:
    """Return whether a path leads to the opened file or folder."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _concurrent_writer(staging: Path) -> InputError:
    """Return the error of an output that another program is writing."""
    return InputError(f"{staging}: another program is writing this output")


def _remove_empty(folder: Path) -> None:
    """Remove a folder that nobody else has put files into."""
    with suppress(OSError):  # it is in use
        folder.rmdir()


def _partial_name(path: Path) -> Path:
    """Return the first free name of a part: ``NAME.partial.EXT``, ``NAME.partial2.EXT``, ..."""
    count = 1
    while True:
        word = PARTIAL if count == 1 else f"{PARTIAL}{count}"
        name = path.with_name(f"{path.stem}.{word}{path.suffix}")
        if not os.path.lexists(name):
            return name
        count += 1


def _irreplaceable(folder: Path) -> Iterator[str]:
    """Yield why a folder is not replaced, even with force: files in it that are not outputs."""
    real = Path(os.path.realpath(folder))
    working = Path(os.path.realpath(os.curdir))
    if real == working or real in working.parents:
        yield f"{folder}: is or holds the working folder and is not replaced"
        return
    for count, (parent, _, files) in enumerate(os.walk(folder)):
        foreign = [name for name in files if Path(name).suffix.lower() not in _OURS]
        if foreign or count > _FILES_LOOKED_AT:
            name = f"{parent}/{foreign[0]}" if foreign else "a large folder tree"
            yield f"{folder}: holds {name}, which is not an output, and is not replaced"
            return
