# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``convert_bag``: a bag or dataset into another form; interrupted bags into whole ones."""

import argparse
import contextlib
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros import program
from imu_sim_ros.bags import beside, convert
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY
from imu_sim_ros.bags.messages.encode_cameras import COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import open_bag, read_poses
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.bags.writer import Writer, amount, described
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.inputs import (
    PoseReader,
    add_skip_bad_rows,
    refused_messages,
    skipped_rows,
)
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import Skipped
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.sensors import known_tables

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded_bag import RecordedImages
    from imu_sim_ros.datasets.recorded_folder import FolderImages

_SHOWN_DAMAGE: Final = 10
EXAMPLES: Final = """
  convert_bag recording -o recording.bag --compression lz4  # rosbag2 -> ROS 1
  convert_bag flight.bag -o flight/mav0 --format euroc  # ROS 1 -> EuRoC
  convert_bag MH_01_easy -o MH_01.mcap --images compressed  # EuRoC -> MCAP, with its images
  convert_bag torn.mcap -o whole.mcap --recover  # an interrupted recording
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(
        prog="convert_bag",
        description=__doc__,
        examples=EXAMPLES,
    )
    result.add_argument(
        "input", type=Path, help="ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file"
    )
    bag_output.add_arguments(result)
    result.add_argument(
        "--topics", metavar="NAME,...", default="", help="topics to convert (default: all)"
    )
    result.add_argument(
        "--images",
        choices=("raw", "compressed", "both", "none"),
        help="messages for a folder's images (default: raw); select a bag's images with --topics",
    )
    result.add_argument(
        "--recover",
        action="store_true",
        help="recover all complete messages of an interrupted or damaged bag",
    )
    add_skip_bad_rows(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, convert_bag, argv)


def convert_bag(arguments: argparse.Namespace) -> None:
    """Convert what the arguments name."""
    form = bag_output.form(arguments)
    written = bag_output.bag_outputs(arguments)
    from_text = text_reader.is_text(arguments.input)
    _check_images(arguments, form, from_text)
    arguments.staged = written.where(arguments.output)
    with written:
        if from_text:
            result = _from_text(arguments, form, written)
        else:
            result = _from_bag(arguments, form, written)
    _report(result, arguments)


def _check_images(arguments: argparse.Namespace, form: str | None, from_text: bool) -> None:
    """Refuse a choice of images that would have no effect."""
    if arguments.images and not from_text:
        raise InputError(f"--images {arguments.images}: is for folders; --topics chooses of a bag")
    if form and arguments.images not in (None, "none"):
        raise InputError(f"--images {arguments.images}: does not apply to {form}; only none does")


def _from_bag(arguments: argparse.Namespace, form: str | None, written: Outputs) -> dict[str, Any]:
    whole = not arguments.recover or _is_whole(arguments.input)
    with open_bag(arguments.input, arguments.recover) as bag:
        topics = convert.chosen(bag, _names(arguments))
        if form is None:
            counts, last_ns = _bag_to_bag(bag, topics, arguments, written)
        elif form == "tum":
            counts, last_ns = _bag_to_tum(bag, topics, arguments)
        else:
            counts, last_ns = _bag_to_dataset(bag, topics, form, arguments, written)
    if not arguments.recover:
        return _result(arguments, counts, last_ns, False)
    if not sum(counts.values()):
        raise InputError([*_recovery(bag), f"{arguments.input}: nothing recoverable"])
    for line in _recovery(bag):
        print(f"convert_bag: {line}", file=sys.stderr)
    recovered = not whole or bool(bag.damage or bag.found)
    result = _result(arguments, counts, last_ns, recovered)
    return {**result, "found": bag.found, "left_out": bag.damage}


def _recovery(bag: Bag) -> list[str]:
    """Return what a recovery found and left out, line by line."""
    lines = [f"{bag.path}: found: {line}" for line in bag.found]
    for k, line in enumerate(bag.damage):
        if k == _SHOWN_DAMAGE:
            lines.append(f"{bag.path}: left out: and {len(bag.damage) - k} more places")
            break
        lines.append(f"{bag.path}: left out: {line}")
    return lines if bag.damage else [*lines, f"{bag.path}: nothing is left out"]


def _names(arguments: argparse.Namespace) -> list[str]:
    return [name for name in arguments.topics.split(",") if name]


def _is_whole(path: Path) -> bool:
    try:
        open_bag(path).close()
    except InputError:
        return False
    return True


def _writer(arguments: argparse.Namespace, written: Outputs) -> Writer:
    writer = open_writer(
        arguments.staged,
        arguments.storage,
        arguments.compression,
        arguments.split_duration,
        arguments.split_size,
    )
    written.describe(arguments.output, lambda: described(writer.topics))
    return writer


def _renamed(arguments: argparse.Namespace) -> dict[str, str]:
    return {"/" + old: "/" + new.lstrip("/") for old, new in arguments.topic}


def _bag_to_bag(
    bag: Bag, topics: Sequence[Any], arguments: argparse.Namespace, written: Outputs
) -> tuple[dict[str, int], int]:
    total = sum(topic.count for topic in topics)
    with (
        _writer(arguments, written) as writer,
        _progress(arguments, total) as advance,
    ):
        renamed = _renamed(arguments)
        refused = refused_messages(arguments, "convert_bag", arguments.input)
        convert.bag_to_bag(bag, writer, topics, renamed, advance, *refused)
    return _tally(writer)


def _tally(writer: Writer) -> tuple[dict[str, int], int]:
    counts = {topic.name: topic.count for topic in writer.topics}
    return counts, max((topic.last_ns for topic in writer.topics), default=-1)


def _bag_to_dataset(
    bag: Bag, topics: Sequence[Any], form: str, arguments: argparse.Namespace, written: Outputs
) -> tuple[dict[str, int], int]:
    readings = bag.topic(IMU, _only_named(topics, IMU, arguments))
    truths = [topic for topic in topics if topic.type == ODOMETRY]
    chosen: dict[str, str | None] = {IMU: readings.name}
    if truths:
        chosen[ODOMETRY] = bag.topic(ODOMETRY, _only_named(topics, ODOMETRY, arguments)).name
    one_table = arguments.staged.suffix.lower() == ".csv"
    tables = {} if one_table else beside.tables_of(topics, readings.name, known_tables())
    names = {kind: topic.name for kind, topic in tables.items()}
    total = readings.count + sum(topic.count for topic in [*truths, *tables.values()])
    with _dataset(arguments, form, bool(truths), written, names) as dataset:
        images = _images(bag, topics, form, arguments)
        total += sum(topic.count for topic in images.topics) if images else 0
        with _progress(arguments, total) as advance:
            skipped, warned = refused_messages(arguments, "convert_bag", arguments.input)
            convert.to_dataset(
                bag.path,
                dataset,
                chosen,
                advance,
                arguments.recover,
                skipped,
                _described(names),
                warned,
            )
            if images:
                images.write(advance, _comment(arguments))
    if form == "euroc":
        _describe(arguments, bool(truths), names)
    counts = _rows(dataset, readings.name, chosen.get(ODOMETRY), names)
    if images is None:
        return counts, dataset.last_ns
    return {**counts, **images.counts}, max(dataset.last_ns, images.last_ns)


def _images(
    bag: Bag, topics: Sequence[TopicInfo], form: str, arguments: argparse.Namespace
) -> "RecordedImages | None":
    """Return the images of the topics, where there are some and the dataset is a folder."""
    kinds = {topic.type for topic in topics}
    if not kinds & {IMAGE, COMPRESSED_IMAGE} or not arguments.staged.is_dir():
        return None
    from imu_sim_ros.datasets.recorded_bag import (  # they need OpenCV
        RecordedImages,
        recorded_cameras,
    )

    return RecordedImages(bag, recorded_cameras(topics), arguments.staged, form)


def _comment(arguments: argparse.Namespace) -> str:
    return f"converted from {arguments.input.name} by imu_sim_ros"


def _only_named(topics: Sequence[Any], type_name: str, arguments: argparse.Namespace) -> str | None:
    """Return the topic of a type that ``--topics`` names; None where none is named."""
    fitting = [topic.name for topic in topics if topic.type == type_name]
    if arguments.topics and not fitting:
        raise InputError(f"--topics {arguments.topics}: none of them is of {type_name}")
    return fitting[0] if arguments.topics and len(fitting) == 1 else None


def _dataset(
    arguments: argparse.Namespace,
    form: str,
    states: bool,
    written: Outputs,
    tables: Collection[str],
) -> Dataset:
    dataset = Dataset(
        arguments.staged, form, states, beside=[(known_tables()[kind], 0) for kind in tables]
    )
    written.describe(arguments.output, lambda: amount(dataset.rows, dataset.last_ns, "rows"))
    return dataset


def _rows(
    dataset: Dataset, readings: str, truth: str | None, tables: Mapping[str, str]
) -> dict[str, int]:
    counts = {name: dataset.beside[kind, 0].rows for kind, name in tables.items()}
    if dataset.imu is not None:
        counts[readings] = dataset.imu.rows
    if dataset.truth is not None and truth:
        counts[truth] = dataset.truth.rows
    return counts


def _bag_to_tum(
    bag: Bag, topics: Sequence[Any], arguments: argparse.Namespace
) -> tuple[dict[str, int], int]:
    named = topics[0].name if arguments.topics and len(topics) == 1 else None
    skipped, warned = refused_messages(arguments, "convert_bag", arguments.input)
    recover = arguments.recover
    poses = read_poses(bag.path, named, skipped is not None, warned=warned, recover=recover)
    if skipped is not None and poses.skipped:
        skipped(poses.skipped)
    return _write_tum(poses, named or convert.TRUTH, arguments)


def _write_tum(
    poses: PoseSequence, name: str, arguments: argparse.Namespace
) -> tuple[dict[str, int], int]:
    import numpy as np

    none = np.zeros((len(poses.t_ns), 3))
    with Dataset(arguments.staged, "tum") as dataset:
        dataset.write_states(text_writer.States(*poses[:3], none, none, none))
    return {name: len(poses.t_ns)}, int(max(poses.t_ns, default=-1))


def _poses(arguments: argparse.Namespace) -> PoseSequence:
    """Return the poses of a text file."""
    return PoseReader(arguments, "convert_bag")(arguments.input)


def _skipped(arguments: argparse.Namespace) -> Skipped | None:
    return skipped_rows(arguments, "convert_bag", arguments.input)


def _from_text(arguments: argparse.Namespace, form: str | None, written: Outputs) -> dict[str, Any]:
    if arguments.topics:
        raise InputError(f"{arguments.input}: text has no topics to choose from")
    if form == "tum":
        return _result(arguments, *_write_tum(_poses(arguments), convert.TRUTH, arguments), False)
    if form is not None:
        return _result(arguments, *_text_to_dataset(arguments, form, written), False)
    if convert.holds_poses(arguments.input):
        with _writer(arguments, written) as writer, _progress(arguments, 0) as advance:
            convert.poses_to_bag(_poses(arguments), writer, _renamed(arguments), advance)
        return _result(arguments, *_tally(writer), False)
    with (
        _folder_images(arguments) as images,
        _writer(arguments, written) as writer,
        _progress(arguments, 0) as advance,
    ):
        renamed = _renamed(arguments)
        seen = images.streams(writer, renamed, arguments.images or "raw") if images else []
        known = known_tables()
        skipped = _skipped(arguments)
        convert.text_to_bag(arguments.input, writer, renamed, advance, skipped, seen, known)
    return _result(arguments, *_tally(writer), False)


def _text_to_dataset(
    arguments: argparse.Namespace, form: str, written: Outputs
) -> tuple[dict[str, int], int]:
    states = text_reader.has_states(arguments.input)
    one_table = arguments.staged.suffix.lower() == ".csv"
    tables = {} if one_table else text_reader.beside_names(arguments.input, known_tables())
    names = {kind: name for name, kind in tables.items()}
    with (
        _folder_images(arguments) as images,
        _dataset(arguments, form, states, written, names) as dataset,
        _progress(arguments, 0) as advance,
    ):
        chosen: dict[str, str | None] = {IMU: None, **({ODOMETRY: None} if states else {})}
        convert.to_dataset(
            *(arguments.input, dataset, chosen, advance, False, _skipped(arguments)),
            _described(names),
        )
        seen = {}
        if images and arguments.staged.is_dir():
            seen = images.copy(arguments.staged, form, _comment(arguments), advance)
    if form == "euroc":
        _describe(arguments, states, names)
    called = {kind: f"/{known_tables()[kind].topic}" for kind in names}
    counts = _rows(dataset, convert.READINGS, convert.TRUTH, called)
    return {**counts, **seen}, dataset.last_ns


def _folder_images(
    arguments: argparse.Namespace,
) -> "contextlib.AbstractContextManager[FolderImages | None]":
    """Return the images of a folder; None where it has none, or they are not wanted."""
    places = text_reader.places(arguments.input) if arguments.input.is_dir() else ()
    cameras = [name for place in places for name in text_reader.sensor_folders(place, "cam")]
    if arguments.images == "none" or not cameras:
        return contextlib.nullcontext()
    from imu_sim_ros.datasets.recorded_folder import FolderImages  # with the cameras' modules

    return FolderImages(arguments.input, _skipped(arguments))


def _describe(arguments: argparse.Namespace, states: bool, tables: Collection[str]) -> None:
    """Write sensor.yaml files; what the input does not tell is left out."""
    import numpy as np

    def rate(name: str, table: Table | None = None) -> float:
        first = np.empty(0, np.int64)
        with contextlib.suppress(InputError):  # no usable row
            first = next(beside.stamps(arguments.staged, name, table), first)
        period = float(np.median(np.diff(first))) if len(first) > 1 else 0.0
        return round(1e9 / period, 3) if period else 0.0

    pose = (np.eye(3), np.zeros(3))
    comment = _comment(arguments)
    text_writer.write_euroc_descriptions(arguments.staged, rate("imu0"), {}, *pose, comment, states)
    for table, _ in _described(dict.fromkeys(tables, "")):
        own = rate(f"{table.name}0", table)
        text_writer.write_euroc_beside(arguments.staged, table, 0, own, *pose, comment)


def _described(names: Mapping[str, str]) -> list[tuple[Table, str]]:
    """Return tables instead of their kinds."""
    known = known_tables()
    return [(known[kind], name) for kind, name in names.items()]


def _progress(arguments: argparse.Namespace, total: int) -> Any:
    return program.progress(f"writing {arguments.output}", total, arguments.quiet or arguments.json)


def _result(
    arguments: argparse.Namespace, counts: dict[str, int], last_ns: int, recovered: bool
) -> dict[str, Any]:
    return {
        "output": str(arguments.output),
        "messages": counts,
        "recovered": recovered,
        "last_stamp_ns": last_ns if last_ns >= 0 else None,
    }


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
        return
    if arguments.quiet:
        return
    counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
    word = "recovered" if result["recovered"] else "written"
    last_ns = result["last_stamp_ns"]
    until = f", up to stamp {last_ns / 1e9:.9f} s" if last_ns is not None else ""
    print(f"{result['output']}: {word}: {counts or 'no messages'}{until}")


if __name__ == "__main__":
    sys.exit(main())
