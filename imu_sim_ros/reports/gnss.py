# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GNSS receivers of a bag as sections of a page: tracks, and errors against stated deviations."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import NAV_SAT_FIX, TWIST_WITH_COVARIANCE
from imu_sim_ros.bags.read import decode_blocks, open_bag
from imu_sim_ros.core.geodesy import tangent_plane
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.reports.page import Item, Section
from imu_sim_ros.reports.sensors import TRUTH, MeasuredQuantity, comparison, truth_of
from imu_sim_ros.reports.streams import track

_DIRECTIONS: Final = ("east", "north", "up")


def gnss_sections(path: Path) -> list[Section]:
    """Return a section for each topic of NavSatFix in a bag that is no truth; [] without any.

    :raises InputError: for what cannot be read.
    """
    with open_bag(path) as bag:
        topics = [info for info in bag.topics if info.count]
    sections = []
    for fixes in _measured_topics(topics, NAV_SAT_FIX):
        items = _fixes(path, fixes.name, truth_of(fixes, topics))
        for velocities in _measured_topics(topics, TWIST_WITH_COVARIANCE):
            if velocities.name.rpartition("/")[0] == fixes.name.rpartition("/")[0]:
                items += _velocities(path, velocities.name, truth_of(velocities, topics))
        sections.append(Section(f"{path.name}: {fixes.name}", items, fixes.name))
    return sections


def _measured_topics(topics: Iterable[TopicInfo], type_name: str) -> list[TopicInfo]:
    """Return the topics of a type, without those of the truth."""
    return [topic for topic in topics if topic.type == type_name and TRUTH not in topic.name]


def _fixes(path: Path, name: str, true_name: str | None) -> list[Item]:
    """Return the plots of a topic of positions, with its errors if the truth is there."""
    t_ns, geodetic, variance, status = _read_fixes(path, name)
    fixed = (status >= 0) & np.isfinite(geodetic).all(axis=1)
    text = f"{name}: {len(t_ns):,} messages, {int(fixed.sum()):,} with a fix"
    if not fixed.any():
        return [{"kind": "text", "text": text}]
    origin = geodetic[fixed][0]
    measured = _quantity("m", t_ns[fixed], tangent_plane(geodetic[fixed], origin), variance[fixed])
    tracks = [track(name, 0, measured.values)]
    truth = None
    if true_name is not None:
        true_ns, true_geodetic, true_variance, _ = _read_fixes(path, true_name)
        truth = _quantity("m", true_ns, tangent_plane(true_geodetic, origin), true_variance)
        tracks.insert(0, track(true_name, None, truth.values))
    text += f"; metres east, north and up of {origin[0]:.7f}, {origin[1]:.7f} deg"
    items: list[Item] = [
        {"kind": "text", "text": text},
        {"kind": "path", "title": f"Track of {name}", "series": tracks},
    ]
    return items + comparison(measured, truth, name, str(path))


def _velocities(path: Path, name: str, true_name: str | None) -> list[Item]:
    """Return the plots of a topic of velocities, with its errors if the truth is there."""
    measured = _read_velocities(path, name)
    truth = None if true_name is None else _read_velocities(path, true_name)
    return comparison(measured, truth, name, str(path))


def _quantity(unit: str, t_ns: Times, values: Array, variance: Array) -> MeasuredQuantity:
    """Return values east, north and up with their variances."""
    return MeasuredQuantity("", unit, _DIRECTIONS, t_ns, values, variance)


def _read_fixes(path: Path, name: str) -> tuple[Times, Array, Array, Array]:
    """Return stamps, latitude, longitude, height (n, 3), stated variances (n, 3), status (n,)."""
    names = ("latitude", "longitude", "altitude", "position_covariance", "status")
    blocks = list(decode_blocks(path, NAV_SAT_FIX, name, names))
    columns = {key: np.concatenate([block.numbers[key] for block in blocks]) for key in names}
    geodetic = np.column_stack([columns[key].reshape(-1) for key in names[:3]])
    variance = columns["position_covariance"].reshape(-1, 9)[:, ::4]
    t_ns = np.concatenate([block.t_ns for block in blocks])
    return t_ns, geodetic, np.maximum(variance, 0.0), columns["status"].reshape(-1)


def _read_velocities(path: Path, name: str) -> MeasuredQuantity:
    """Return the velocities of a topic with their variances."""
    names = ("linear", "twist_covariance")
    blocks = list(decode_blocks(path, TWIST_WITH_COVARIANCE, name, names))
    velocity, covariance = (
        np.concatenate([block.numbers[key] for block in blocks]) for key in names
    )
    variance = np.maximum(covariance.reshape(-1, 36)[:, [0, 7, 14]], 0.0)
    return _quantity("m/s", np.concatenate([block.t_ns for block in blocks]), velocity, variance)
