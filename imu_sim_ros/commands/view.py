# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``view``: show a flight in rerun: truth, estimates, images, readings and biases over time.

Needs rerun: ``pip install rerun-sdk``.
"""

import argparse
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.bags.clouds import cloud_frame, measured_cloud_topics, read_cloud, read_clouds
from imu_sim_ros.bags.messages.encode import ODOMETRY, VECTOR3_STAMPED
from imu_sim_ros.bags.messages.encode_cameras import COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.read import open_bag, vector_blocks
from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.core.conventions import (
    ACCEL_UNITS,
    GYRO_UNITS,
    LANDMARKS_TOPIC,
    TF_STATIC_TOPIC,
    TRIADS,
)
from imu_sim_ros.core.errors import InputError, Problems
from imu_sim_ros.core.records import States, concatenate
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.datasets.world import frame_of, static_transforms, transform_between
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import has_topics, imu_choices, read_trajectory, reading_blocks
from imu_sim_ros.jobs.recorded import camera_names, read_images
from imu_sim_ros.jobs.selection import check_choice, input_lines
from imu_sim_ros.jobs.tracks import has_truth, truth_topic
from imu_sim_ros.plots.flight_view import FlightView, rerun

EXAMPLES: Final = """
view flight.mcap
view flight.mcap track.csv vio.tum --save flight.rrd
view MH_01/mav0 --save MH_01.rrd
"""


_TRUTH: Final = "truth"

_ARGUMENTS: Final = {
    "flight FLIGHT": {"type": Path, "help": "bag or EuRoC folder"},
    "estimates ESTIMATE": {
        "type": Path,
        "nargs": "*",
        "help": "estimated path: TUM or EuRoC text, or a bag",
    },
    "--truth-topic TOPIC": "topic of the truth, if the bag has several",
    "--frame FRAME": "frame of the readings, if a topic carries several IMUs",
    "--gyro-topic TOPIC": "topic of the gyroscope, if the accelerometer has another one",
    "--accel-topic TOPIC": "topic of the accelerometer, interpolated to the times of the gyroscope",
    "--gyro-unit": {"choices": tuple(GYRO_UNITS), "help": "unit of the gyroscope in the input"},
    "--accel-unit": {
        "choices": tuple(ACCEL_UNITS),
        "help": "unit of the accelerometer in the input",
    },
    "--save FILE": "write a .rrd file instead of starting the viewer",
    "--no-images": "leave out images",
    "--landmarks FILE": "landmarks.csv of generate --format tracks (default: those of the bag)",
    **FORCE,
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("view", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def view(arguments: argparse.Namespace) -> None:
    """Read the flight and send it to the viewer or into a file."""
    rerun()  # said before anything is read
    written = outputs(arguments)
    save = arguments.save and written.add(arguments.save, endings=(".rrd",))
    with written.stage():
        truth, paths = _paths(arguments)  # what cannot be read is said before the viewer starts
        flight_view = FlightView(arguments.flight.name)
        if save:
            flight_view.save(save.path)
        else:
            flight_view.spawn()
        result = _fill(flight_view, arguments, truth, paths)
        flight_view.flush()
    notes = result.pop("notes")
    parts = ", ".join(f"{count} {noun}" for noun, count in result.items())
    result = {"output": arguments.save and str(arguments.save), **result, "notes": notes}
    lines = [*input_lines(notes), f"{arguments.save or 'rerun'}: {parts}"]
    program.print_result(arguments, result, lines)


def _paths(arguments: argparse.Namespace) -> tuple[str | None, dict[str, States]]:
    """Return the topic of the truth, and truth and estimates by name, as far as there are some."""
    flight, paths, problems = arguments.flight, dict[str, States](), Problems()
    with problems.collect():
        is_known = has_truth(flight)
        truth = truth_topic(flight, arguments.truth_topic) if is_known else None
        if truth is not None or (is_known and not has_topics(flight)):
            paths[_TRUTH] = read_trajectory(flight, truth)
    for estimate in arguments.estimates:
        name = estimate.stem if estimate.stem not in paths else str(estimate.with_suffix(""))
        with problems.collect():
            paths[name] = read_trajectory(estimate)
    problems.tell()
    return truth, paths


def _fill(
    shown: FlightView,
    arguments: argparse.Namespace,
    truth: str | None,
    paths: Mapping[str, States],
) -> JsonObject:
    """Add the contents of the inputs to a view; return their numbers by kind, and the notes.

    :param truth, paths: as :func:`_paths` returns them.
    """
    flight = arguments.flight
    counts = {"paths": 0, "readings": 0, "biases": 0, "images": 0, "scans": 0, "landmarks": 0}
    for name, poses in paths.items():
        shown.path(name, poses)
        counts["paths"] += 1
    notes: list[str] = []
    for imu in imu_choices(flight, _choice(arguments)):
        blocks = list(reading_blocks(flight, imu))
        if not blocks:
            continue
        readings = concatenate(blocks)
        name = (imu.topic or "imu").strip("/")
        for triad, values in zip(TRIADS, (readings.gyro, readings.accel), strict=True):
            if values is not None:
                shown.series(f"{name}/{triad}", readings.t_ns, values)
        counts["readings"] += len(readings.t_ns)
        notes += [note for note in readings.notes if note not in notes]
    if arguments.frame is not None and not counts["readings"]:
        raise InputError(f"{flight}: contains no readings of the frame {arguments.frame}")
    if has_topics(flight):
        counts["biases"] = _biases(shown, flight)
    if not arguments.no_images:
        is_folder = not has_topics(flight)
        cameras = camera_names(flight) if is_folder else _topics(flight, IMAGE, COMPRESSED_IMAGE)
        for name in cameras:
            shown.images(name.strip("/"), read_images(flight, name))
            counts["images"] += 1
    if has_topics(flight):
        body = frame_of(flight, ODOMETRY, truth, 1) if truth else ""
        counts["scans"] = _clouds(shown, flight, body)
    points = _landmarks(flight, arguments.landmarks)
    if len(points):
        shown.points("landmarks", points)
        counts["landmarks"] = len(points)
    if not counts["paths"] and not counts["readings"]:
        raise InputError(f"{flight}: has neither odometry nor readings of an IMU")
    return {**counts, "notes": notes}


def _choice(arguments: argparse.Namespace) -> Choice:
    """Return frame, topics and units of the readings."""
    triads = arguments.gyro_topic, arguments.accel_topic
    units = arguments.gyro_unit, arguments.accel_unit
    return check_choice(None, arguments.frame, *triads, *units, of_a_file=True)


def _topics(flight: Path, *types: str) -> list[str]:
    """Return the topics of some types that have messages in a bag."""
    with open_bag(flight) as bag:
        return [info.name for info in bag.topics if info.type in types and info.count]


def _biases(shown: FlightView, flight: Path) -> int:
    """Add the true biases of a bag; returns how many topics have some."""
    topics = [name for name in _topics(flight, VECTOR3_STAMPED) if name.endswith("_bias")]
    for topic in topics:
        parts = list(vector_blocks(flight, topic))
        t_ns, values = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        shown.series(topic.strip("/"), t_ns, values)
    return len(topics)


def _clouds(shown: FlightView, flight: Path, body: str) -> int:
    """Add the scans of a bag; returns how many topics have some.

    :param body: frame of the true poses; empty: there are none.
    """
    topics = measured_cloud_topics(flight)
    for topic in topics:
        frame = cloud_frame(flight, topic)
        mount = transform_between(static_transforms(flight), frame, body) if body else None
        fixed = None if mount is None else (f"{_TRUTH}/body/{frame}", mount)
        if fixed is None:
            print(
                f"view: {topic}: in its own frame, because the bag does not say where {frame} is "
                f"in the world (a true path, and {TF_STATIC_TOPIC})",
                file=sys.stderr,
            )
        shown.clouds(topic.strip("/"), read_clouds(flight, topic), fixed)
    return len(topics)


def _landmarks(flight: Path, path: Path | None) -> Any:
    """Return the positions (n, 3) of landmarks.csv (id, x, y, z), or of a bag's first cloud."""
    if path is None:
        return np.empty((0, 3)) if not has_topics(flight) else read_cloud(flight, LANDMARKS_TOPIC)
    try:
        rows = np.loadtxt(path, delimiter=",", ndmin=2, skiprows=1)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {error}") from None
    if rows.shape[1] != 4:
        raise InputError(f"{path}: must have the columns id, x, y, z")
    return rows[:, 1:]


main = partial(program.main, parser, view)

if __name__ == "__main__":
    sys.exit(main())
