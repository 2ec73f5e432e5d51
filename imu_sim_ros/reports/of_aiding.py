# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GNSS receivers of a bag as sections of a page: track, and errors against what is stated."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import NAV_SAT_FIX, TWIST_WITH_COVARIANCE
from imu_sim_ros.bags.read import decoded_blocks, open_bag
from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.association import common_rows
from imu_sim_ros.reports.of_bag import error_series, plot
from imu_sim_ros.reports.page import Item, Section
from imu_sim_ros.reports.streams import extremes
from imu_sim_ros.sensors.gravity import earth_fixed, east_north_up
from imu_sim_ros.types import Array, Times

_TRUTH: Final = "ground_truth/"
_DIRECTIONS: Final = ("east", "north", "up")
_INSIDE: Final = (1.0, 2.0, 3.0)
"""Stated standard deviations, of whose shares a page tells."""
_GAUSSIAN: Final = (0.683, 0.954, 0.997)


class _Measured(NamedTuple):
    """n measurements of a receiver, or their truth, in east, north, up."""

    t_ns: Times
    values: Array
    """(n, 3)."""
    variance: Array
    """(n, 3) stated; 0: unknown."""


def gnss_sections(path: Path) -> list[Section]:
    """Return a section for each topic of NavSatFix in a bag that is no truth; [] without any.

    :raises InputError: for what cannot be read.
    """
    with open_bag(path) as bag:
        topics = [info for info in bag.topics if info.count]
    sections = []
    for fixes in _named(topics, NAV_SAT_FIX):
        items = _fixes(path, fixes, _truth_of(fixes, topics))
        for other in _named(topics, TWIST_WITH_COVARIANCE):
            if other.rpartition("/")[0] == fixes.rpartition("/")[0]:
                items += _velocities(path, other, _truth_of(other, topics))
        sections.append(Section(f"{path.name}: {fixes}", items))
    return sections


def _named(topics: Iterable[TopicInfo], kind: str) -> list[str]:
    return [one.name for one in topics if one.type == kind and _TRUTH not in one.name]


def _truth_of(name: str, topics: Sequence[TopicInfo]) -> str | None:
    """Return the topic of the truth of gps/fix, ground_truth/gps_fix, in the same namespace."""
    *space, group, last = ["", *name.strip("/").split("/")][-3:]
    wanted = f"{'/'.join([*filter(None, space), _TRUTH])}{group}_{last}"
    return next((one.name for one in topics if one.name.strip("/") == wanted), None)


def _fixes(path: Path, name: str, true_name: str | None) -> list[Item]:
    t_ns, geodetic, variance, status = _read_fixes(path, name)
    fixed = (status >= 0) & np.isfinite(geodetic).all(axis=1)
    words = f"{name}: {len(t_ns):,} messages, {int(fixed.sum()):,} with a fix"
    if not fixed.any():
        return [{"kind": "text", "text": words}]
    origin = geodetic[fixed][0]
    read = _Measured(t_ns[fixed], _local(geodetic[fixed], origin), variance[fixed])
    tracks = [_track(name, 1, read.values)]
    truth = None
    if true_name is not None:
        true_ns, true_geodetic, none, _ = _read_fixes(path, true_name)
        truth = _Measured(true_ns, _local(true_geodetic, origin), none)
        tracks.insert(0, _track(true_name, 0, truth.values))
    words += f"; metres east, north and up of {origin[0]:.7f}, {origin[1]:.7f} deg"
    items: list[Item] = [
        {"kind": "text", "text": words},
        {"kind": "path", "title": f"Track of {name}", "series": tracks},
    ]
    return items + _errors(read, truth, name, "m", str(path))


def _velocities(path: Path, name: str, true_name: str | None) -> list[Item]:
    read = _read_velocities(path, name)
    truth = None if true_name is None else _read_velocities(path, true_name)
    return _errors(read, truth, name, "m/s", str(path))


def _track(name: str, colour: int, places: Array) -> Item:
    x, y, z = places[extremes(places)].T
    return {"name": name, "colour": colour, "x": x, "y": y, "z": z}


def _errors(
    read: _Measured, truth: _Measured | None, name: str, unit: str, link: str
) -> list[Item]:
    """Return errors over time in the band of three stated deviations; without a truth, the band."""
    t_s = (read.t_ns - read.t_ns[0]) * 1e-9
    link = f"{link} {name}"
    if truth is None:
        sigma = np.sqrt(read.variance)
        rows = extremes(sigma)
        series = [
            {"name": axis, "colour": k, "x": t_s[rows], "y": sigma[rows, k]}
            for k, axis in enumerate(_DIRECTIONS)
        ]
        drawn = plot(f"{name}: stated deviation", "time [s]", f"[{unit}]", series, link=link)
        return [{"kind": "plots", "items": [drawn]}]
    try:
        rows = common_rows(read.t_ns, truth.t_ns)
    except InputError as problem:
        return [{"kind": "text", "text": f"{name}: {problem}"}]
    at_s = (truth.t_ns - read.t_ns[0]) * 1e-9
    expected = [np.interp(t_s[rows], at_s, truth.values[:, k]) for k in range(3)]
    error = read.values[rows] - np.column_stack(expected)
    variance = read.variance[rows]
    errors = [
        plot(
            f"{name}: error {axis}",
            "time [s]",
            f"[{unit}]",
            error_series(t_s[rows], error[:, k], variance[:, k]),
            link=link,
        )
        for k, axis in enumerate(_DIRECTIONS)
    ]
    return [{"kind": "text", "text": _summary(name, error, variance, unit)},
            {"kind": "plots", "items": errors}]  # fmt: skip


def _summary(name: str, error: Array, variance: Array, unit: str) -> str:
    """Return how large errors are, and how many lie within what is stated."""
    sizes = ", ".join(
        f"{size:.3g} {axis}"
        for size, axis in zip(np.sqrt(np.mean(error**2, axis=0)), _DIRECTIONS, strict=True)
    )
    words = f"{name}: as read minus true, root mean square [{unit}]: {sizes}"
    stated = (variance > 0.0).all(axis=1)
    if not stated.any():
        return f"{words}; it states no covariance"
    ratio = np.abs(error[stated]) / np.sqrt(variance[stated])
    shares = ", ".join(
        f"{float(np.mean(ratio <= limit)):.1%} within {limit:g} ({usual:.1%})"
        for limit, usual in zip(_INSIDE, _GAUSSIAN, strict=True)
    )
    return f"{words}; stated standard deviations, of a Gaussian in brackets: {shares}"


def _local(geodetic: Array, origin: Array) -> Array:
    """Return places (n, 3) east, north, up of an origin, all latitude, longitude, height."""
    at = [np.array([x]) for x in origin]
    difference = earth_fixed(*geodetic.T) - earth_fixed(*at)
    return np.einsum("ij,nj->ni", east_north_up(at[0], at[1])[0], difference)


def _read_fixes(path: Path, name: str) -> tuple[Times, Array, Array, Array]:
    """Return stamps, latitude, longitude, height (n, 3), stated variances (n, 3), status (n,)."""
    names = ("latitude", "longitude", "altitude", "position_covariance", "status")
    found = [fields for _, fields in decoded_blocks(path, NAV_SAT_FIX, name, names)]
    columns = {key: np.concatenate([one.numbers[key] for one in found]) for key in names}
    geodetic = np.column_stack([columns[key].reshape(-1) for key in names[:3]])
    variance = columns["position_covariance"].reshape(-1, 9)[:, ::4]
    t_ns = np.concatenate([one.t_ns for one in found])
    return t_ns, geodetic, np.maximum(variance, 0.0), columns["status"].reshape(-1)


def _read_velocities(path: Path, name: str) -> _Measured:
    names = ("linear", "twist_covariance")
    found = [fields for _, fields in decoded_blocks(path, TWIST_WITH_COVARIANCE, name, names)]
    velocity, stated = (np.concatenate([one.numbers[key] for one in found]) for key in names)
    variance = np.maximum(stated.reshape(-1, 36)[:, [0, 7, 14]], 0.0)
    return _Measured(np.concatenate([one.t_ns for one in found]), velocity, variance)
