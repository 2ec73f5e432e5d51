# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GNSS receivers of a bag as sections of a page: track, and errors against what is stated."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import NAV_SAT_FIX, TWIST_WITH_COVARIANCE
from imu_sim_ros.bags.read import decoded_blocks, open_bag
from imu_sim_ros.reports.of_sensors import TRUTH, Compared, compared, truth_of
from imu_sim_ros.reports.page import Item, Section
from imu_sim_ros.reports.streams import extremes
from imu_sim_ros.sensors.gravity import earth_fixed, east_north_up
from imu_sim_ros.types import Array, Times

_DIRECTIONS: Final = ("east", "north", "up")


def gnss_sections(path: Path) -> list[Section]:
    """Return a section for each topic of NavSatFix in a bag that is no truth; [] without any.

    :raises InputError: for what cannot be read.
    """
    with open_bag(path) as bag:
        topics = [info for info in bag.topics if info.count]
    sections = []
    for fixes in _named(topics, NAV_SAT_FIX):
        items = _fixes(path, fixes.name, truth_of(fixes, topics))
        for other in _named(topics, TWIST_WITH_COVARIANCE):
            if other.name.rpartition("/")[0] == fixes.name.rpartition("/")[0]:
                items += _velocities(path, other.name, truth_of(other, topics))
        sections.append(Section(f"{path.name}: {fixes.name}", items))
    return sections


def _named(topics: Iterable[TopicInfo], kind: str) -> list[TopicInfo]:
    return [one for one in topics if one.type == kind and TRUTH not in one.name]


def _fixes(path: Path, name: str, true_name: str | None) -> list[Item]:
    t_ns, geodetic, variance, status = _read_fixes(path, name)
    fixed = (status >= 0) & np.isfinite(geodetic).all(axis=1)
    words = f"{name}: {len(t_ns):,} messages, {int(fixed.sum()):,} with a fix"
    if not fixed.any():
        return [{"kind": "text", "text": words}]
    origin = geodetic[fixed][0]
    read = _measured("m", t_ns[fixed], _local(geodetic[fixed], origin), variance[fixed])
    tracks = [_track(name, 0, read.values)]
    truth = None
    if true_name is not None:
        true_ns, true_geodetic, none, _ = _read_fixes(path, true_name)
        truth = _measured("m", true_ns, _local(true_geodetic, origin), none)
        tracks.insert(0, _track(true_name, None, truth.values))
    words += f"; metres east, north and up of {origin[0]:.7f}, {origin[1]:.7f} deg"
    items: list[Item] = [
        {"kind": "text", "text": words},
        {"kind": "path", "title": f"Track of {name}", "series": tracks},
    ]
    return items + compared(read, truth, name, str(path))


def _velocities(path: Path, name: str, true_name: str | None) -> list[Item]:
    read = _read_velocities(path, name)
    truth = None if true_name is None else _read_velocities(path, true_name)
    return compared(read, truth, name, str(path))


def _measured(unit: str, t_ns: Times, values: Array, variance: Array) -> Compared:
    return Compared("", unit, _DIRECTIONS, t_ns, values, variance)


def _track(name: str, colour: int | None, positions: Array) -> Item:
    x, y, z = positions[extremes(positions)].T
    return {"name": name, "colour": colour, "x": x, "y": y, "z": z}


def _local(geodetic: Array, origin: Array) -> Array:
    """Return places (n, 3) east, north, up of an origin, all latitude, longitude, height."""
    at = [np.array([x]) for x in origin]
    difference = earth_fixed(*geodetic.T) - earth_fixed(*at)
    return np.einsum("ij,nj->ni", east_north_up(at[0], at[1])[0], difference)


def _read_fixes(path: Path, name: str) -> tuple[Times, Array, Array, Array]:
    """Return stamps, latitude, longitude, height (n, 3), stated variances (n, 3), status (n,)."""
    names = ("latitude", "longitude", "altitude", "position_covariance", "status")
    found = list(decoded_blocks(path, NAV_SAT_FIX, name, names))
    columns = {key: np.concatenate([one.numbers[key] for one in found]) for key in names}
    geodetic = np.column_stack([columns[key].reshape(-1) for key in names[:3]])
    variance = columns["position_covariance"].reshape(-1, 9)[:, ::4]
    t_ns = np.concatenate([one.t_ns for one in found])
    return t_ns, geodetic, np.maximum(variance, 0.0), columns["status"].reshape(-1)


def _read_velocities(path: Path, name: str) -> Compared:
    names = ("linear", "twist_covariance")
    found = list(decoded_blocks(path, TWIST_WITH_COVARIANCE, name, names))
    velocity, stated = (np.concatenate([one.numbers[key] for one in found]) for key in names)
    variance = np.maximum(stated.reshape(-1, 36)[:, [0, 7, 14]], 0.0)
    return _measured("m/s", np.concatenate([one.t_ns for one in found]), velocity, variance)
