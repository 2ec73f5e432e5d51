# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SQLite files and folders of rosbag2 as blocks of messages."""

import re
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from imu_sim_ros.bags.compressed_files import SUFFIXES, stem
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.schemas import Schema
from imu_sim_ros.bags.reader import Bag, Recover, Timed, errors_naming, recovery_advice
from imu_sim_ros.bags.sqlite_pages import MessagePages
from imu_sim_ros.bags.writer import METADATA_FILE
from imu_sim_ros.core.errors import InputError, MachineError
from imu_sim_ros.core.types import Bytes
from imu_sim_ros.inputs.rows import is_present, open_regular, read_text
from imu_sim_ros.parameters.yaml_text import parse_yaml

SQLITE: Final = b"SQLite format 3\0"
"""First bytes of a database."""
_ROWS: Final = 4096
"""Number of rows that are fetched at once."""
_MAX_TOPICS: Final = 10_000
"""Largest number of topics of a database."""
OpenFile: TypeAlias = Callable[[Path, Recover], Bag]
"""Opens a file of a bag."""


class SqliteBag(Bag):
    """One SQLite file of rosbag2, of any schema version."""

    encoding = "cdr"

    def __init__(self, path: Path, recover: Recover = False) -> None:
        """Open a file.

        :param recover: roll an unfinished transaction back, in a copy, and leave damaged parts out.
        """
        super().__init__(path)
        self._recover = bool(recover)
        self._read_from = path
        self._pages: MessagePages | None = None
        """Messages of a damaged file in recovery."""
        try:
            mode = "mode=ro"
            if recover:
                self._read_from, mode = self._recoverable()
            self._database = sqlite3.connect(
                f"{self._read_from.absolute().as_uri()}?{mode}", uri=True, check_same_thread=False
            )
            self._stack.callback(self._database.close)
            self._database.execute("PRAGMA trusted_schema = OFF")
            if recover:
                # SQLite then opens files whose end, or whose index, is missing.
                self._database.execute("PRAGMA writable_schema = ON")
            self._topics = self._read_topics()
        except sqlite3.Error as error:
            self._stack.close()
            hint = "" if recover else f" ({recovery_advice()})"
            raise InputError(f"{path}: {error}{hint}") from None
        self.topics = list(self._topics.values())

    def _recoverable(self) -> tuple[Path, str]:
        """Return the file to open, and how, so that the original stays as it was found.

        Without a journal and with sound first bytes it is itself. SQLite rolls a journal back by
        writing: that needs a copy of both in the folder for temporary files, because the disk of
        the original may be full.
        """
        with open_regular(self.path) as file:
            is_damaged = file.read(len(SQLITE)) != SQLITE
        sources = [self.path.with_name(self.path.name + suffix) for suffix in ("-journal", "-wal")]
        journals = [source for source in sources if is_present(source) and source.stat().st_size]
        if not journals and not is_damaged:
            return self.path, "immutable=1"
        if journals:
            self.found.append(f"{journals[0].name}: a transaction that did not end is rolled back")
        try:
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            for source in (self.path, *journals):
                shutil.copyfile(source, folder / source.name)
            if is_damaged:
                self.found.append("its first bytes are damaged")
                with (folder / self.path.name).open("r+b") as copy:
                    copy.write(SQLITE)
        except OSError as error:
            self._stack.close()
            raise MachineError(
                f"{self.path}: cannot be copied into {tempfile.gettempdir()}: {error.strerror}; "
                "the variable TMPDIR names a folder with more room"
            ) from None
        return folder / self.path.name, "mode=rw"

    def _read_topics(self) -> dict[int, TopicInfo]:
        """Return the topics of the database by their ids.

        :raises InputError: for a database of another kind.
        """
        columns = self._columns("topics")
        if not {"id", "name", "type"} <= columns or (
            not {"topic_id", "timestamp", "data"} <= self._columns("messages")
        ):
            raise InputError(f"{self.path}: not a database of rosbag2")
        schemas = {}
        if self._columns("message_definitions"):
            schemas = {
                name: Schema(str(text), str(digest), str(language))
                for name, text, digest, language in self._database.execute(
                    "SELECT topic_type, encoded_message_definition, type_description_hash, "
                    "encoding FROM message_definitions"
                )
            }
        if self._recover:
            counts = self._scan()
        else:
            statement = "SELECT topic_id, count(*) FROM messages GROUP BY topic_id"
            counts = dict(self._database.execute(statement).fetchall())
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        rows = self._database.execute(f"SELECT id, name, type, {qos} FROM topics ORDER BY id")
        topics = rows.fetchmany(_MAX_TOPICS)
        if not all(isinstance(string, str) for _, *strings in topics for string in strings[:2]):
            raise InputError(f"{self.path}: the names of its topics are not strings")
        return {
            id_: TopicInfo(
                name,
                type_name,
                counts.get(id_, 0),
                schemas.get(type_name, Schema("", "")),
                profiles,
            )
            for id_, name, type_name, profiles in topics
        }

    def _columns(self, name: str) -> set[str]:
        """Return the columns of a table; none for anything but a plain table.

        A view, or a computed column, may never end.
        """
        kind = self._database.execute(
            "SELECT type, sql FROM sqlite_master WHERE name = ?", (name,)
        ).fetchone()
        if kind is None:
            return set()
        columns = self._database.execute(f"PRAGMA table_xinfo({name})").fetchall()
        plain = kind[0] == "table" and re.match(r"\s*CREATE\s+TABLE\b", str(kind[1]), re.I)
        if not plain or any(column[6] for column in columns):
            raise InputError(f"{self.path}: {name} is not a plain table")
        return {column[1] for column in columns}

    def _scan(self) -> dict[int, int]:
        """Read and count all messages; those of a damaged file page by page."""
        counts: dict[int, int] = {}
        try:
            rows = self._database.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
            )
            for id_, t_ns, payload in rows:
                if not isinstance(t_ns, int) or not isinstance(payload, bytes):
                    raise sqlite3.DatabaseError("a message is damaged")
                counts[id_] = counts.get(id_, 0) + 1
        except sqlite3.Error as error:
            return self._scan_pages(str(error))
        return counts

    def _scan_pages(self, problem: str) -> dict[int, int]:
        """Count the messages that are found in the pages, and note which are lost by their ids."""
        columns = self._database.execute("PRAGMA table_xinfo(messages)").fetchall()
        topics = {id_ for (id_,) in self._database.execute("SELECT id FROM topics")}
        self._pages = MessagePages(self._read_from, [column[1] for column in columns], topics)
        self._stack.callback(self._pages.close)
        counts: dict[int, int] = {}
        last_id = 0
        for rows in self._pages.rows():
            for row in rows:
                if row.id > last_id + 1:
                    lost = f"messages {last_id + 1} to {row.id - 1}"
                    self.damage.append(f"{lost} ({row.id - 1 - last_id}): {problem}")
                    self.lost_messages += row.id - 1 - last_id
                last_id = max(last_id, row.id)
                counts[row.topic] = counts.get(row.topic, 0) + 1
        if self._pages.is_cut:
            self.damage.append(
                f"the messages after number {last_id}: the end of the file is missing"
            )
        elif not self.damage:
            self.found.append(f"{problem}; all messages up to number {last_id} are there")
        return counts

    def _read_by_time(self, names: Collection[str]) -> Iterator[Timed]:
        """Yield the messages of topics in the order of time, some thousand rows at a time."""
        ids = {id_ for id_, topic in self._topics.items() if topic.name in names}
        if self._pages is not None:
            for page in self._pages.rows():
                rows = [(row.topic, row.t_ns, row.data) for row in page if row.topic in ids]
                if rows:
                    yield Timed(rows[-1][1], self._blocks(rows))
            return
        # What is to be recovered is read in the order of the table: its index may be damaged.
        order = "id" if self._recover else "timestamp, id"
        cursor = self._database.execute(
            "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN "
            f"({','.join('?' * len(ids))}) ORDER BY {order}",
            tuple(ids),
        )
        try:
            while rows := cursor.fetchmany(_ROWS):
                yield Timed(rows[-1][1], self._blocks(rows))
        except sqlite3.Error as error:
            raise InputError(f"{self.path}: {error} ({recovery_advice()})") from None

    def _blocks(self, rows: Sequence[tuple[int, object, object]]) -> list[MessageBlock]:
        """Return rows of the table of messages, in blocks of one topic each."""
        columns_by_topic: dict[int, tuple[list[int], list[bytes]]] = {}
        for id_, t_ns, payload in rows:
            if not isinstance(t_ns, int) or not isinstance(payload, bytes):
                raise ValueError("a message whose time is not a number or whose data are not bytes")
            times, payloads = columns_by_topic.setdefault(id_, ([], []))
            times.append(t_ns)
            payloads.append(payload)
        return [
            MessageBlock(self._topics[id_], np.array(times, dtype=np.int64), _table(payloads))
            for id_, (times, payloads) in columns_by_topic.items()
        ]


class Rosbag2Folder(Bag):
    """A rosbag2 folder with its files in order."""

    encoding = "cdr"

    def __init__(self, path: Path, open_file: OpenFile, recover: Recover = False) -> None:
        """Open a folder.

        :param open_file: opens one of its files.
        :param recover: do without metadata.yaml, and leave out damaged parts.
        :raises InputError: if there is no metadata.yaml, unless the bag is to be recovered.
        """
        super().__init__(path)
        self._parts: list[Bag] = []
        self._open_file = open_file
        try:
            for file in self._files_there() if recover else self._listed_files():
                self._add(file, recover)
            encodings = {part.encoding for part in self._parts if part.topics}
            if len(encodings) > 1:
                raise InputError(f"{path}: holds messages of ROS 1 and of ROS 2")
            self.encoding = next(iter(encodings), self.encoding)
            self.topics = _merge_topics([topic for part in self._parts for topic in part.topics])
        except BaseException:
            self._stack.close()
            raise

    def _add(self, file: Path, recover: Recover) -> None:
        """Open a file; one that cannot be opened is left out when recovering."""
        try:
            with errors_naming(file):
                part = self._open_file(file, recover)
        except InputError as error:
            if not recover:
                raise
            self.damage += [line.removeprefix(f"{self.path}/") for line in error.problems]
            self.lost_bytes += file.stat().st_size
            return
        self._stack.enter_context(part)
        self._parts.append(part)
        self.found += [f"{file.name}: {line}" for line in part.found]
        self.damage += [f"{file.name}: {line}" for line in part.damage]
        self.unreadable.update(part.unreadable)
        self.lost_bytes += part.lost_bytes
        self.lost_messages += part.lost_messages

    def _files_there(self) -> list[Path]:
        """Return the storage files that a folder has, and note how its metadata differ."""
        files = _storage_files(self.path)
        try:
            listed = set(read_metadata(self.path))
        except InputError as error:
            self.found += error.problems
            return files
        existing = set(files)
        self.damage += [
            f"{file.name}: metadata.yaml lists it, and it is not there"
            for file in sorted(listed - existing)
        ]
        self.found += [
            f"{file.name}: metadata.yaml does not list it" for file in sorted(existing - listed)
        ]
        return files

    def _listed_files(self) -> list[Path]:
        """Return the files that metadata.yaml lists; each must exist once."""
        advice = f"; {recovery_advice()}" if _storage_files(self.path) else ""
        files = read_metadata(self.path, advice)
        if len(set(files)) != len(files):
            raise InputError(f"{self.path}: metadata.yaml lists a file twice")
        missing = [file for file in files if not is_present(file)]
        if missing:
            raise InputError(f"{missing[0]}: missing; metadata.yaml lists it")
        return files

    def _read_by_time(self, names: Collection[str]) -> Iterator[Timed]:
        """Yield the messages of topics, file by file."""
        topics = {(topic.name, topic.type): topic for topic in self.topics}
        for part in self._parts:
            for next_start_ns, blocks in part._read_by_time(names):
                # Each file is in order of its own; what overlaps between files stays apart.
                yield Timed(
                    next_start_ns,
                    [
                        MessageBlock(topics[topic.name, topic.type], t_ns, payloads)
                        for topic, t_ns, payloads in blocks
                    ],
                )


def read_metadata(folder: Path, advice: str = "") -> list[Path]:
    """Return the files that metadata.yaml lists.

    A file that was compressed or unpacked since then counts as the listed one.

    :param advice: end of the line about a folder without metadata.yaml.
    :raises InputError: if it is missing or has another form.
    """
    file = folder / METADATA_FILE
    if not is_present(file):
        raise InputError(f"{folder}: no metadata.yaml, so not a whole rosbag2 bag{advice}")
    try:
        content = parse_yaml(read_text(file))
    except ValueError as error:
        raise InputError(f"{file}: not the metadata of a rosbag2 bag: {error}") from None
    content = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    content = content if isinstance(content, dict) else {}
    names = content.get("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{file}: not the metadata of a rosbag2 bag")
    return [_current_form(folder / Path(name).name) for name in names]


def _current_form(file: Path) -> Path:
    """Return the existing form of a listed file: compressed or not."""
    plain = stem(file)
    forms = [file, plain, *(plain.with_name(plain.name + suffix) for suffix in SUFFIXES)]
    return next(filter(is_present, forms), file)


def _storage_files(folder: Path) -> list[Path]:
    """Return the storage files of a folder in the order of their numbers.

    Of a file that is there both compressed and unpacked, the unpacked one is returned.
    """
    files: dict[Path, Path] = {}
    for file in sorted(folder.iterdir(), key=lambda file: (len(file.name), file.name)):
        if stem(file).suffix in (".mcap", ".db3"):
            files.setdefault(stem(file), file)

    def order(unpacked: Path) -> tuple[int, str]:
        number = re.search(r"_(\d+)$", unpacked.stem)
        return (int(number[1]) if number else -1, unpacked.name)

    return [files[unpacked] for unpacked in sorted(files, key=order)]


def _merge_topics(topics: Collection[TopicInfo]) -> list[TopicInfo]:
    """Return the topics of several files, each once, with all their messages."""
    from dataclasses import replace

    merged: dict[tuple[str, str], TopicInfo] = {}
    for topic in topics:
        key = (topic.name, topic.type)
        previous_count = merged[key].count if key in merged else 0
        merged[key] = replace(merged.get(key, topic), count=previous_count + topic.count)
    return list(merged.values())


def _table(payloads: list[bytes]) -> Bytes | list[bytes]:
    """Return messages as an array (n, size) if all have one size, else unchanged."""
    size = len(payloads[0])
    if size == 0 or any(len(payload) != size for payload in payloads):
        return payloads
    return np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, size)
