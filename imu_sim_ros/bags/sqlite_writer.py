# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SQLite files of rosbag2, schema version 4 (that of ROS 2 Jazzy)."""

import os
import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from itertools import repeat
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages.blocks import as_list, as_row_template, interleave
from imu_sim_ros.bags.messages.schemas import qos_text
from imu_sim_ros.bags.outputs import refuse_existing
from imu_sim_ros.bags.writer import (
    METADATA_VERSION,
    BagTopic,
    Block,
    Writer,
    count_messages,
    rosbag2_metadata,
    time_order,
)
from imu_sim_ros.core.errors import MachineError
from imu_sim_ros.core.yaml_output import as_yaml

SCHEMA_VERSION: Final = 4
"""Version of rosbag2's SQLite tables, that of Jazzy."""
_TABLES: Final = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(
    id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(
    id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
    encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(
    id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""
_INSERT: Final = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)"
_INSERT_ROWS: Final = """
INSERT INTO messages (topic_id, timestamp, data)
SELECT part.column1, row.value, substr(?1, row.key * {width} + part.column2, part.column3)
FROM json_each(?2) AS row CROSS JOIN (VALUES {parts}) AS part"""
"""The messages of all topics at the times ?2 out of the rows ?1; in this order."""
_TALLY: Final = """
SELECT count(*), coalesce(min(timestamp), 9223372036854775807), coalesce(max(timestamp), -1)
FROM messages WHERE topic_id = ?"""
_TRANSACTION_BYTES: Final = 16 << 20
"""Bytes of messages after which a transaction is committed."""
_STATEMENT_BYTES: Final = 512 << 10
"""Messages that one statement inserts: memory of this size is kept by malloc from one to the next,
that of 4 MiB is not, and its page faults take a fifth of the time."""


class SqliteWriter(Writer):
    """One SQLite file of a rosbag2 folder.

    A transaction ends with every flush, or after some 16 MiB: what is committed survives the end of
    the process at any moment.
    """

    encoding = "cdr"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        refuse_existing(path)
        self._bytes = 0
        self._uncommitted = 0
        try:
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            # No waiting for the disk: a flush that is to survive a power cut syncs the file.
            self._database.execute("PRAGMA synchronous = OFF")
            self._database.execute("PRAGMA journal_mode = DELETE")
            self._database.executescript(_TABLES)
            self._database.execute("INSERT INTO schema VALUES (?, 'jazzy')", (SCHEMA_VERSION,))
            self._database.execute("BEGIN")
        except sqlite3.Error as error:
            raise MachineError(f"{path}: {error}") from None

    @property
    def size(self) -> int:
        """Bytes of the messages so far, without the overhead of the database."""
        return self._bytes

    def _register(self, topic: BagTopic) -> None:
        """Insert the topic, and the definition of its type."""
        text, digest, language = topic.schema
        row = (
            topic.index + 1,
            topic.name,
            topic.type_name,
            "cdr",
            qos_text(topic.qos),
            digest,
        )
        self._execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?, ?)", row)
        is_known = any(earlier.type_name == topic.type_name for earlier in self.topics)
        if text and not is_known:
            self._execute(
                "INSERT INTO message_definitions (topic_type, encoding, "
                "encoded_message_definition, type_description_hash) VALUES (?, ?, ?, ?)",
                (topic.type_name, language, text, digest),
            )
        self._commit()

    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics, ordered by record time among each other."""
        blocks = [block for block in blocks if len(block.t_ns)]
        if not blocks:
            return
        times = blocks[0].t_ns
        has_constant_sizes = not any(isinstance(block.payloads, list) for block in blocks)
        if (
            has_constant_sizes
            and len({block.topic for block in blocks}) == len(blocks)
            and all(np.array_equal(block.t_ns, times) for block in blocks)
            and bool(np.all(times[1:] >= times[:-1]))
        ):
            self._insert_rows(blocks)
            return
        order = time_order([block.t_ns for block in blocks])
        t_ns = np.concatenate([block.t_ns for block in blocks])[order]
        payloads = [payload for block in blocks for payload in as_list(block.payloads)]
        if len(blocks) == 1:
            ids = repeat(blocks[0].topic.index + 1)
        else:
            owner = np.repeat(
                [block.topic.index + 1 for block in blocks], [len(block.t_ns) for block in blocks]
            )
            ids = iter(owner[order].tolist())
            payloads = [payloads[k] for k in order.tolist()]
        rows = zip(ids, t_ns.tolist(), payloads)  # noqa: B905 - repeat has no end
        try:
            self._database.executemany(_INSERT, rows)
        except sqlite3.Error as error:
            raise MachineError(f"{self.path}: {error}") from None
        count_messages(blocks)
        self._count_bytes(sum(map(len, payloads)))

    def _insert_rows(self, blocks: Sequence[Block]) -> None:
        """Write messages of constant sizes at the same times, many with one statement.

        SQLite takes the messages out of one piece of memory itself: that needs no object of Python
        for each of them, and other threads run meanwhile.
        """
        patterns = [
            as_row_template(payloads) for _, _, payloads in blocks if not isinstance(payloads, list)
        ]
        sizes = [len(pattern.template) for pattern in patterns]
        starts = np.cumsum([1, *sizes[:-1]]).tolist()
        parts = [
            (block.topic.index + 1, start, size)
            for block, start, size in zip(blocks, starts, sizes, strict=True)
        ]
        statement = _INSERT_ROWS.format(width=sum(sizes), parts=str(parts)[1:-1])
        count = max(_STATEMENT_BYTES // max(sum(sizes), 1), 1)
        for first_row in range(0, len(blocks[0].t_ns), count):
            rows = slice(first_row, first_row + count)
            t_ns = np.ascontiguousarray(blocks[0].t_ns[rows])
            times = str(t_ns.tolist())  # JSON, from which SQLite takes them
            self._execute(statement, (interleave(patterns, rows).data, times))
            count_messages([Block(topic, t_ns, payloads) for topic, _, payloads in blocks])
            self._count_bytes(len(t_ns) * sum(sizes))

    def flush(self, durable: bool = False) -> None:
        """End the transaction."""
        self._commit()
        if durable:
            with self.path.open("rb") as file:
                os.fsync(file.fileno())

    def close(self) -> None:
        """Store the metadata."""
        content = rosbag2_metadata("sqlite3", self.topics, [self])
        self._execute(
            "INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)",
            (METADATA_VERSION, as_yaml(content)),
        )
        self._execute("COMMIT")
        self._execute("PRAGMA journal_mode = DELETE")  # takes the empty journal away
        self._database.close()

    def abandon(self) -> list[Path]:
        """Keep the committed messages."""
        # If that fails, the next program that opens the file rolls the journal back.
        with suppress(sqlite3.Error):
            self._database.rollback()
        self._database.close()
        if not self.count:
            self.path.unlink(missing_ok=True)
        return [self.path] if self.count else []

    def stop(self) -> None:
        """Finish with every message that the database has; it counts them itself."""
        with suppress(sqlite3.ProgrammingError):  # it is closed
            if not self._database.in_transaction:
                self._execute("BEGIN")
            for topic in self.topics:
                row = self._database.execute(_TALLY, (topic.index + 1,)).fetchone()
                topic.count, topic.first_ns, topic.last_ns = row
            if self.count:
                self.close()
            else:
                self.abandon()

    def _execute(self, statement: str, values: Sequence[object] = ()) -> None:
        """Run a statement; an error of the database names the file."""
        try:
            self._database.execute(statement, values)
        except sqlite3.Error as error:
            raise MachineError(f"{self.path}: {error}") from None

    def _count_bytes(self, size: int) -> None:
        """Add to the size of the transaction, and end it when it is large."""
        self._bytes += size
        self._uncommitted += size
        if self._uncommitted >= _TRANSACTION_BYTES:
            self._commit()

    def _commit(self) -> None:
        """End the transaction and begin the next one."""
        self._execute("COMMIT")
        self._execute("BEGIN")
        self._uncommitted = 0
