# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common parts of all bag readers: topics, chunks, blocks of messages, and their order in time."""

import os
import re
import sqlite3
import struct
import sys
from abc import abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import (
    Any,
    BinaryIO,
    Final,
    Generic,
    Literal,
    NamedTuple,
    Protocol,
    TypeAlias,
    TypeVar,
)

import numpy as np
from numpy.lib.stride_tricks import as_strided, sliding_window_view

from imu_sim_ros.bags.messages.blocks import MessageBlock, Payloads, TopicInfo, as_list
from imu_sim_ros.bags.threads import prefetch
from imu_sim_ros.core.conventions import IDEAL_IMU_TOPIC
from imu_sim_ros.core.errors import ImuSimError, InputError, MissingDependencyError, system_error
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.spelling import job_argument
from imu_sim_ros.core.types import Bytes, Times
from imu_sim_ros.inputs.sharing import Shareable
from imu_sim_ros.recordings.findings.clipping import ClippingCounts

DAMAGE: Final = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RecursionError,
    TypeError,
    ValueError,
    struct.error,
)
"""Exceptions of Python, NumPy and the bag libraries for malformed bytes."""
_LONGEST_REASON: Final = 200
"""Longest text of another library's error in a message [characters]."""
_SEARCHED_BYTES: Final = 1 << 20
"""Bytes of a damaged file that are searched at once."""
_LONGEST_MATCH: Final = 64
"""Longest sequence that is searched for [bytes]."""
_ARGUMENTS: Final = re.compile(
    r"(unexpected|invalid) keyword argument|required (positional|keyword-only) argument|"
    r"takes .* positional"
)
"""Messages of Python about a call with unexpected arguments."""
_PACKAGE: Final = __name__.partition(".")[0]
_DEFECTS: Final = (AssertionError, AttributeError, NameError, TypeError)
"""Errors that bytes do not cause in the code of this package, which checks them."""
_BAG_LIBRARIES: Final = ("mcap", "rosbags", "lz4", "zstandard")
END_NS: Final = 2**63 - 1
"""After all messages."""
LOOSE_BYTES: Final = 1 << 20
"""Size of a run of messages outside chunks that is read at once [bytes]."""
_LARGEST_CHUNK: Final = 1 << 30
"""Largest accepted chunk [bytes]; those of rosbag2 and roscpp have about 1 MB."""
_ALWAYS_ALLOWED: Final = 64 << 20
"""Decompressed size that no ratio forbids [bytes]."""
_LARGEST_RATIO: Final = 40
"""Largest ratio of compression of larger chunks: a file of 10 MB must not fill the memory."""
_UNPACKED_BYTES: Final = 1 << 20
"""Bytes that are unpacked at a time."""
_Packed = TypeVar("_Packed", bytes, memoryview)
Recover: TypeAlias = bool | Literal["keep_damaged"]
"""Mode of recovery: none, without or with chunks whose checksum is wrong."""


class Timed(NamedTuple):
    """The messages of one chunk, before chunks that overlap in time are merged."""

    next_start_ns: int
    """Before this time no later chunk has a message."""
    blocks: list[MessageBlock]


def _is_of_interface(error: Exception) -> bool:
    """Return whether an error is one of a call into a library, not of the bytes of a file."""
    if isinstance(error, AttributeError):
        return isinstance(error.obj, ModuleType | type)
    return isinstance(error, TypeError) and _ARGUMENTS.search(str(error)) is not None


def _is_of_package(error: Exception) -> bool:
    """Return True for a defect of this package: raised in its code, or by a wrong call to it."""
    if not isinstance(error, _DEFECTS):
        return False
    if not _is_of_interface(error):
        frames = [frame for frame, _ in walk_tb(error.__traceback__)]
        return bool(frames) and _is_own_module(frames[-1].f_globals.get("__name__"))
    if isinstance(error, AttributeError):
        owner = error.obj
        return _is_own_module(owner.__name__ if isinstance(owner, ModuleType) else owner.__module__)
    name = str(error).partition("(")[0].partition(".")[0]
    callees = (
        getattr(module, name, None)
        for module_name, module in list(sys.modules.items())
        if _is_own_module(module_name)
    )
    return any(_is_own_module(getattr(callee, "__module__", None)) for callee in callees)


def _is_own_module(name: object) -> bool:
    """Return True for the name of a module of this package."""
    return isinstance(name, str) and name.partition(".")[0] == _PACKAGE


def recovery_advice() -> str:
    """Return the advice for a bag that is interrupted or damaged."""
    return f"{job_argument('convert', 'recover')} recovers the complete messages"


@contextmanager
def errors_naming(path: Path, hint: str = "") -> Iterator[None]:
    """Turn the errors of damaged bytes into one line; wraps the reader of a file.

    :param hint: advice to append.
    A defect of this package is passed on as it is.

    :raises InputError: for any of :data:`DAMAGE`, and for what mcap, rosbags and sqlite raise.
    :raises MissingDependencyError: if a library has another interface.
    """
    try:
        yield
    except ImuSimError:
        raise
    except OSError as error:
        raise system_error(path, error) from error
    except Exception as error:
        library = type(error).__module__.partition(".")[0]
        if not isinstance(error, (*DAMAGE, sqlite3.Error)) and library not in _BAG_LIBRARIES:
            raise
        if _is_of_package(error):
            raise
        if _is_of_interface(error):
            raise MissingDependencyError(
                f"{path}: not read, because a library of another version has another interface: "
                f"{error}; the requirements of this package name the versions"
            ) from error
        text = " ".join(str(error).split())[:_LONGEST_REASON] or type(error).__name__
        raise InputError(f"{path}: damaged: {text}{hint}") from error


class Bag(AbstractContextManager["Bag"], Shareable):
    """An open bag; use as a context manager."""

    encoding: str
    """cdr or ros1."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: list[TopicInfo] = []
        self.unreadable: dict[str, str] = {}
        """Reasons by name of topics with messages that are not of ROS."""
        self.found: list[str] = []
        """Defects of a bag in recovery that lose no message."""
        self.damage: list[str] = []
        """Lines about parts left out of a bag in recovery, with the reasons."""
        self.clippings: Sequence[ClippingCounts] = ()
        """Counts of clipped readings that the device has kept."""
        self.lost_bytes = 0
        """Bytes of those parts."""
        self.lost_messages = 0
        """Messages of those parts, as far as something counts them."""
        self._stack = ExitStack()
        """Closes the files."""

    def __enter__(self) -> "Bag":
        """Keep the files open for one more user."""
        self.hold()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the files after the last user."""
        self.release()

    def _close_files(self) -> None:
        """Close the files."""
        self._stack.close()

    def close_with(self, stack: ExitStack) -> None:
        """Close a stack, of temporary files for instance, with the bag."""
        self._stack.push(stack)

    @abstractmethod
    def _read_by_time(self, names: Collection[str]) -> Iterator[Timed]:
        """Yield the messages of topics, chunk by chunk in the order of their first times."""

    def groups(self, names: Collection[str] | None = None) -> Iterator[list[MessageBlock]]:
        """Yield messages in groups of a bounded size, each group after the one before in time.

        Chunks that overlap are merged: messages wait until no earlier one can follow. Reading and
        decompressing continue in a thread of their own while a group is processed.

        :param names: topics; None: all.
        """
        if names is None:
            names = {topic.name for topic in self.topics}
        waiting: dict[TopicInfo, list[MessageBlock]] = {}
        with errors_naming(self.path):
            for next_start_ns, blocks in prefetch(self._read_by_time(names)):
                for block in map(_unpack, blocks):
                    if len(block.t_ns):
                        waiting.setdefault(block.topic, []).append(block)
                ready = []
                for topic in list(waiting):
                    topic, t_ns, payloads = sort_by_time(waiting.pop(topic))
                    cut = int(np.searchsorted(t_ns, next_start_ns))
                    if cut:
                        ready.append(MessageBlock(topic, t_ns[:cut], payloads[:cut]))
                    if cut < len(t_ns):
                        waiting[topic] = [MessageBlock(topic, t_ns[cut:], payloads[cut:])]
                if ready:
                    yield ready
            rest = [sort_by_time(blocks) for blocks in waiting.values()]
            if rest:
                yield rest

    def find(self, name: str) -> TopicInfo | None:
        """Return the topic of a name, with or without the slash before it; None: there is none."""
        plain = name.strip("/")
        return next((topic for topic in self.topics if topic.name.strip("/") == plain), None)

    def default(self, type_name: str) -> str | None:
        """Return the topic of a type that is read if the user names none; None: the only one."""
        return None

    def topic(self, type_name: str, name: str | None) -> TopicInfo:
        """Return the topic of a type: the named one, or the only one.

        Of ``imu/data_raw`` and ``imu/data``, the same readings with an orientation (REP-145), the
        first is meant; of readings and their truth, ``ground_truth/imu``, the readings.

        :raises InputError: if there is none, or several; the line lists them.
        """
        fitting = [topic for topic in self.topics if topic.type == type_name]
        name = self.default(type_name) if name is None else name
        if name is not None:
            info = self.find(name)
            if info is not None and info.type == type_name:
                return info
            hint = suggest_topic(name, self.topics, fitting)
            raise InputError(f"{self.path}: has no topic {name} of {type_name}; {hint}")
        measured = [topic for topic in fitting if not topic.name.endswith("/" + IDEAL_IMU_TOPIC)]
        candidates = measured or fitting
        # A topic without messages is no choice, unless none has any.
        candidates = [topic for topic in candidates if topic.count] or candidates
        names = {topic.name for topic in candidates}
        once = [topic for topic in candidates if f"{topic.name}_raw" not in names]
        if len(once) == 1:
            return once[0]
        if not fitting:
            raise InputError(
                f"{self.path}: has no topic of {type_name}; it has {describe_topics(self.topics)}"
            )
        raise InputError(
            f"{self.path}: has several topics of {type_name}, name one of "
            f"{describe_topics(fitting)}"
        )


def suggest_topic(
    name: str, topics: Iterable[TopicInfo], fitting: Iterable[TopicInfo] | None = None
) -> str:
    """Return a hint for a missing topic: the nearest one of the right type, or all."""
    candidates = topics if fitting is None else fitting
    return suggestion(
        name, (topic.name for topic in candidates), f"it has {describe_topics(topics)}"
    )


class ChunkInFile(Protocol):
    """A chunk, or messages outside chunks that are read as one."""

    @property
    def position(self) -> int:
        """Beginning of the chunk in the file [bytes]."""

    @property
    def start_ns(self) -> int:
        """The first time of its messages."""


class LostRange(NamedTuple):
    """Bytes of a file that a recovery leaves out."""

    start: int
    end: int
    reasons: tuple[str, ...]
    messages: int
    """Number of messages that are known to be in it."""

    def __str__(self) -> str:
        count = f" ({self.messages} messages)" if self.messages else ""
        return f"{self.end - self.start} bytes from byte {self.start} on{count}: " + "; ".join(
            self.reasons
        )


_Chunk = TypeVar("_Chunk", bound=ChunkInFile)


class ChunkedBag(Bag, Generic[_Chunk]):
    """A bag that is one file of chunks: MCAP, ROS 1."""

    def __init__(self, path: Path, file: BinaryIO, recover: Recover) -> None:
        """Read the index of an open file.

        :param file: is closed with the bag, or at once if it cannot be used.
        :raises InputError: for a file that is damaged, unless it is to be recovered.
        """
        super().__init__(path)
        self._recover = bool(recover)
        self._keeps_damaged = recover == "keep_damaged"
        self._file = self._stack.enter_context(file)
        self._end = os.fstat(file.fileno()).st_size
        self._chunks: list[_Chunk] = []
        self._latest_range: LostRange | None = None
        self._start = 0
        """Offset of the first record in the file."""
        self._topic_of: dict[int, TopicInfo] = {}
        """Topics by number of the channel or connection that messages name."""
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise

    @abstractmethod
    def _open(self) -> None:
        """Find chunks and topics, by the index or by going through the file."""

    @abstractmethod
    def _blocks(self, chunk: _Chunk, topics_by_id: Mapping[int, TopicInfo]) -> list[MessageBlock]:
        """Return the messages of a chunk, in blocks of one topic each."""

    def _check_start(self, magic: bytes, kind: str) -> None:
        """Look at the first bytes of the file; in recovery, others than usual are damage.

        :param magic: first bytes of every such file.
        :param kind: name of the container with its article, for messages.
        :raises InputError: for a file of another kind.
        """
        if self._read_at(0, len(magic)) == magic:
            self._start = len(magic)
        elif self._recover:
            self.found.append("its first bytes are damaged")
        else:
            raise InputError(f"{self.path}: not {kind}")

    def _read_at(self, position: int, size: int) -> bytes:
        """Return a part of the file, or less at its end; several threads may read at a time.

        :raises ValueError: for a position before the file.
        """
        if position < 0:
            raise ValueError("a position before the begin of the file")
        return os.pread(self._file.fileno(), max(min(size, self._end - position), 0), position)

    def _leave_out(self, start: int, end: int, why: str, messages: int = 0) -> None:
        """Note a range of lost bytes; neighbours are one.

        :param messages: number of messages that are known to be in it.
        """
        self.lost_bytes += end - start
        self.lost_messages += messages
        latest = self._latest_range
        if latest is not None and latest.end == start and self.damage[-1] == str(latest):
            del self.damage[-1]
            reasons = latest.reasons if why in latest.reasons else (*latest.reasons, why)
            latest = LostRange(latest.start, end, reasons, latest.messages + messages)
        else:
            latest = LostRange(start, end, (why,), messages)
        self._latest_range = latest
        self.damage.append(str(latest))

    def _leave_out_messages(self, count: int, why: str) -> None:
        """Note messages that were read and cannot be used."""
        self.lost_messages += count
        self.damage.append(f"{count} messages: {why}")

    def _offsets_of(self, pattern: re.Pattern[bytes], position: int) -> Iterator[int]:
        """Yield the offsets of the file from ``position`` on that match a lookahead."""
        for start in range(position, self._end, _SEARCHED_BYTES):
            data = self._read_at(start, _SEARCHED_BYTES + _LONGEST_MATCH)
            for match in pattern.finditer(data):
                if match.start() < _SEARCHED_BYTES:
                    yield start + match.start()

    def _read_by_time(self, names: Collection[str]) -> Iterator[Timed]:
        """Yield the messages of topics, chunk by chunk in the order of their first times."""
        chunks = sorted(self._chunks, key=lambda chunk: chunk.start_ns)
        starts = [*(chunk.start_ns for chunk in chunks), END_NS][1:]
        topics_by_id = {id_: topic for id_, topic in self._topic_of.items() if topic.name in names}
        for chunk, next_start_ns in zip(chunks, starts, strict=True):
            try:
                yield Timed(next_start_ns, self._blocks(chunk, topics_by_id))
            except DAMAGE as error:
                raise InputError(
                    f"{self.path}: chunk at byte {chunk.position}: {error}; "
                    f"{job_argument('convert', 'recover')} skips it"
                ) from None


class ContradictionError(ValueError):
    """A file that defines a channel twice, in different ways: it is spliced of several."""


def describe_topics(topics: Iterable[TopicInfo]) -> str:
    """Return topics as text; the type stands once if all have the same one."""
    topics = [*topics]
    texts = [f"{topic.name} ({topic.type or 'no schema'})" for topic in topics]
    if len({topic.type for topic in topics}) == 1:
        texts[:-1] = [topic.name for topic in topics[:-1]]
    return ", ".join(texts) or "no topics"


def gather_messages(data: Bytes, starts: Times, sizes: Times) -> Payloads:
    """Return the messages at given places of a chunk; no copy if their distance is constant.

    :param data: (bytes,) the chunk.
    :param starts: (n,) first bytes.
    :param sizes: (n,) lengths.
    """
    if not len(starts):
        return []
    if int(min(starts.min(), sizes.min())) < 0 or (
        int(max(starts.max(), sizes.max())) > len(data) or int((starts + sizes).max()) > len(data)
    ):
        raise ValueError("a message reaches past the end of its chunk")
    if int(sizes.sum()) > len(data):
        raise ValueError("messages overlap")
    size = int(sizes[0])
    if bool(np.any(sizes != size)):
        content = data.tobytes()
        return [
            content[start : start + length]
            for start, length in zip(starts.tolist(), sizes.tolist(), strict=True)
        ]
    strides = np.diff(starts)
    if len(strides) and bool(np.all(strides == strides[0])) and strides[0] > 0:
        rows = as_strided(data[starts[0] :], (len(starts), size), (int(strides[0]), 1))
        rows.flags.writeable = False
        return rows
    return sliding_window_view(data, size)[starts]


def sort_by_time(blocks: Sequence[MessageBlock]) -> MessageBlock:
    """Return blocks of one topic as one, in the order of time."""
    topic, t_ns, payloads = blocks[0]
    if len(blocks) > 1:
        t_ns = np.concatenate([block.t_ns for block in blocks])
        payloads = _concatenate([block.payloads for block in blocks])
    if bool(np.all(t_ns[1:] >= t_ns[:-1])):
        return MessageBlock(topic, t_ns, payloads)
    order = np.argsort(t_ns, kind="stable")
    if isinstance(payloads, list):
        return MessageBlock(topic, t_ns[order], [payloads[k] for k in order.tolist()])
    return MessageBlock(topic, t_ns[order], payloads[order])


_COMPRESSED_MESSAGES: Final = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}
"""Compressions by the first bytes of a message; those of CDR begin with 0."""


def _unpack(block: MessageBlock) -> MessageBlock:
    """Return a block with its messages unpacked that rosbag2 has compressed one by one."""
    if not len(block.t_ns) or bytes(block.payloads[0][:4]) not in _COMPRESSED_MESSAGES:
        return block
    return block._replace(payloads=[_message(payload) for payload in as_list(block.payloads)])


def _message(payload: bytes) -> bytes:
    """Return the bytes of a message, decompressed if its payload is compressed.

    :raises ValueError: for a message that is implausibly larger than its payload.
    """
    compression = _COMPRESSED_MESSAGES.get(payload[:4])
    if compression is None:
        return payload
    message = bytearray()
    for part in _stepwise(payload, compression):
        message += part
        if len(message) > max(_ALWAYS_ALLOWED, _LARGEST_RATIO * len(payload)):
            raise ValueError(f"more than {len(message)} bytes in a message exceed the limit")
    return bytes(message)


def _concatenate(payloads: Sequence[Payloads]) -> Payloads:
    """Return the messages of several blocks as one array if all have one size, else a list."""
    tables = [rows for rows in payloads if not isinstance(rows, list)]
    if len(tables) == len(payloads) and len({rows.shape[1] for rows in tables}) == 1:
        return np.concatenate(tables)
    return [message for rows in payloads for message in as_list(rows)]


def decompress(data: _Packed, compression: str, size: int, torn: bool = False) -> bytes | _Packed:
    """Return the content of a chunk, within limits; the data themselves if not compressed.

    :param compression: none or empty, lz4, zstd or bz2.
    :param size: stated size of the content [bytes].
    :param torn: the end is missing; what precedes it is returned.
    :raises ValueError: for data in another format or of another size.
    """
    if size > min(_LARGEST_CHUNK, max(_ALWAYS_ALLOWED, _LARGEST_RATIO * len(data))):
        raise ValueError(f"{size} bytes in {len(data)} compressed ones exceed the limit")
    content: bytes | _Packed = data
    if compression not in ("", "none"):
        unpacked = bytearray()
        try:
            for part in _stepwise(data, compression):
                unpacked += part
                if len(unpacked) > size:  # it holds more than it says
                    break
        except (RuntimeError, OSError, EOFError, ValueError) as error:
            if not torn:
                raise ValueError(str(error)) from None
        content = bytes(unpacked)
    if not torn and len(content) != size:
        raise ValueError("it does not have the expected size")
    return content


def _stepwise(data: bytes | memoryview, compression: str) -> Iterator[bytes]:
    """Yield the content in steps of a bounded size, of one stream."""
    if compression == "zstd":
        import zstandard

        reader = zstandard.ZstdDecompressor().stream_reader(data)
        try:
            while unpacked := reader.read(_UNPACKED_BYTES):
                yield unpacked
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
        return
    stream: Any
    if compression == "lz4":
        import lz4.frame

        stream = lz4.frame.LZ4FrameDecompressor()
    elif compression == "bz2":
        import bz2

        stream = bz2.BZ2Decompressor()
    else:
        raise ValueError(f"chunks are compressed by {compression[:20]!r}, which is not supported")
    position = 0
    while not stream.eof:
        part: bytes | memoryview = b""
        if stream.needs_input:
            part = data[position : position + _UNPACKED_BYTES]
            position += len(part)
            if not part:
                return
        yield stream.decompress(part, _UNPACKED_BYTES)
    if stream.unused_data or position < len(data):
        raise ValueError("other bytes follow its compressed data")
