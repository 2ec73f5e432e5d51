# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A LiDAR as the rest of the package sees it: topics and readings."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Single
from imu_sim_ros.sensors.declaration import (
    Companions,
    Mounted,
    NativeOutputs,
    Payloads,
    Sensor,
    SensorReadings,
    Topic,
    import_on_call,
)
from imu_sim_ros.sensors.lidar.layouts import LAYOUTS, Cloud, custom_points
from imu_sim_ros.sensors.lidar.parameters import LidarParameters
from imu_sim_ros.sensors.samples import Rows, Samples

TOPIC: Final = "points"
CUSTOM_TOPIC: Final = "livox/lidar"
_CLOUD: Final = ("sensor_msgs/msg/PointCloud2", "PointCloud2Encoder")
_CUSTOM: Final = ("livox_ros_driver2/msg/CustomMsg", "LivoxEncoder")
_MODEL: Final = "imu_sim_ros.sensors.lidar.model"
_TRUTHS: Final = (
    *(("true_range", "range"), ("range_error",) * 2, ("incidence",) * 2, ("reflectivity",) * 2),
    *(("time",) * 2, ("ring",) * 2, ("surface",) * 2, ("body",) * 2, ("outcome",) * 2),
)
"""Values and the fields of the true points that hold them."""
_TRUE_POINT: Final = np.dtype(
    [
        *((axis, "<f4") for axis in "xyz"),
        *((name, "<f4") for name in ("range", "range_error", "incidence", "reflectivity", "time")),
        ("ring", "<u2"),
        ("surface", "<i4"),
        ("body", "u1"),
        ("outcome", "u1"),
    ]
)


@dataclass(frozen=True, repr=False)
class LidarReadings(SensorReadings):
    """The n scans of a LiDAR that are delivered, m rays each, and the truth of every ray."""

    range: Single
    """(n, m) measured ranges [m]; NaN: no return."""
    intensity: Single
    """(n, m) measured intensities; 100 for a white surface square on."""
    direction: Single
    """(n, m, 3) nominal directions, unit vectors in the sensor's frame."""
    time: Array
    """(n, m) times of the rays since the start of the scan [s]."""
    ring: NDArray[np.uint16]
    """(n, m) numbers of the rings."""
    true_range: Single
    """(n, m) true ranges along the true directions [m]; infinite: nothing there."""
    true_point: Single
    """(n, m, 3) point that each ray met, in the sensor's frame at the start of the scan [m]."""
    range_error: Single
    """(n, m) measured minus true range [m]."""
    incidence: Single
    """(n, m) angle between the ray and the surface's normal [rad]."""
    reflectivity: Single
    """(n, m) diffuse reflectivity of what each ray met; NaN: nothing there."""
    surface: NDArray[np.int32]
    """(n, m) number of the rectangle or triangle, within its body; -1: nothing there."""
    body: NDArray[np.uint8]
    """(n, m) number of the moving body, from 1; 0: what is at rest."""
    outcome: NDArray[np.uint8]
    """(n, m) 0: a point of a surface, 1: of several within the beam, 2: of rain or dust; without a
    point: 3: nothing there, 4: too far, too near or too dark, 5: through glass, 6: lost."""

    @property
    def points(self) -> Single:
        """(n, m, 3) points in the sensor's frame at each ray's time [m]; NaN without a return."""
        positions: Single = self.range[..., None] * self.direction
        return positions

    def cloud(self, k: int) -> Cloud:
        """Return the points of scan k."""
        return next(clouds(self, [k]))


def clouds(readings: Samples | LidarReadings, scans: Iterable[int]) -> Iterator[Cloud]:
    """Yield the points of some scans."""
    for k in scans:
        rows = np.isfinite(readings.range[k])
        distance = readings.range[k][rows]
        yield Cloud(
            t_ns=int(readings.t_ns[k]),
            xyz=distance[:, None] * readings.direction[k][rows],
            intensity=readings.intensity[k][rows],
            ring=readings.ring[k][rows],
            time=readings.time[k][rows],
            range=distance,
        )


def _true_points(readings: Samples, k: int) -> NDArray[np.void]:
    """Return the truth of the points of scan k, in their order."""
    hits = np.isfinite(readings.range[k])
    rows = np.zeros(int(hits.sum()), _TRUE_POINT)
    for axis, column in zip("xyz", readings.true_point[k][hits].T, strict=True):
        rows[axis] = column
    for value, name in _TRUTHS:
        rows[name] = readings.values[value][k][hits]
    return rows


Rays = Iterator[tuple[int, NDArray[np.void]]]
"""Stamps of scans [ns], and their points."""


def _topic(
    name: str,
    kind: tuple[str, str],
    scans: Callable[[Samples, Iterable[int], LidarParameters], Rays],
    truth: bool = False,
    foreign: bool = False,
) -> Topic:
    """Return a topic of a message for each scan."""

    def make(mounted: Mounted[LidarParameters], encoding: str) -> Payloads:
        from imu_sim_ros.bags.messages import encode_cameras

        messages = getattr(encode_cameras, kind[1])(mounted.frame, encoding)

        def payloads(readings: Samples, rows: Rows, parameters: LidarParameters) -> list[bytes]:
            chosen = np.arange(len(readings.t_ns))[rows].tolist()
            return [messages.encode(*scan) for scan in scans(readings, chosen, parameters)]

        return payloads

    return Topic(name=name, type=kind[0], flags=(), payloads=make, truth=truth, foreign=foreign)


def _points(readings: Samples, scans: Iterable[int], parameters: LidarParameters) -> Rays:
    """Yield stamps and points of scans in the layout of the parameters."""
    layout = LAYOUTS[parameters.layout]
    return ((cloud.t_ns, layout.rows(cloud)) for cloud in clouds(readings, scans))


def _custom(readings: Samples, scans: Iterable[int], _: object) -> Rays:
    """Yield stamps and points of scans as Livox has them."""
    return ((cloud.t_ns, custom_points(cloud)) for cloud in clouds(readings, scans))


def _truth(readings: Samples, scans: Iterable[int], _: object) -> Rays:
    """Yield stamps and true points of scans."""
    return ((int(readings.true_t_ns[k]), _true_points(readings, k)) for k in scans)


SENSOR: Final[Sensor[LidarParameters]] = Sensor(
    name="lidar",
    quantity="lidar",
    section=LidarParameters,
    model=import_on_call(_MODEL, "Lidar"),
    topics=(
        _topic(TOPIC, _CLOUD, _points),
        _topic(CUSTOM_TOPIC, _CUSTOM, _custom, foreign=True),
        _topic("ground_truth/points", _CLOUD, _truth, truth=True),
    ),
    readings=LidarReadings,
    realised=import_on_call(_MODEL, "realise_lidar"),
    sees=True,
    in_sight=import_on_call(_MODEL, "visibility_mask"),
    text="LiDAR scans, each ray cast from the sensor's pose at its time, with range errors",
    outputs=NativeOutputs(
        Companions(
            lambda parameters: ("_scans",) if parameters.files != "none" else (),
            import_on_call("imu_sim_ros.sensors.lidar.files", "ScanFiles"),
        )
    ),
    presets="lidar",
)
