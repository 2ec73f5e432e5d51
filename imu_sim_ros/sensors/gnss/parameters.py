# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a GNSS receiver on the body: ``gnss.*``."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from imu_sim_ros.core.timebase import LOWEST_RATE
from imu_sim_ros.parameters.kinds import choice, flag, integer, number, numbers, text
from imu_sim_ros.parameters.sections import section
from imu_sim_ros.sensors.parameters import SensorParameters

MODES: Final = ("single", "dgps", "float", "fixed")
"""Modes of a receiver: alone, with corrections, with carrier phase."""
_PER_MODE: Final = "for the modes single, dgps, float (RTK) and fixed (RTK)"


@dataclass(frozen=True)
class RawParameters:
    """Raw measurements of each satellite, and their errors."""

    rinex: bool = flag(
        False,
        "measure pseudorange, carrier phase and Doppler; generate writes them next to its output, "
        "as RINEX: NAME.obs and NAME.nav",
    )
    frequencies: int = integer(2, "1: L1 C/A; 2: L2 P(Y) as well", minimum=1, maximum=2)
    code_sigma: float = number(
        0.3,
        "standard deviation of a pseudorange at the zenith; elsewhere divided by the sine of the "
        "elevation",
        unit="m",
        minimum=0.0,
    )
    phase_sigma: float = number(0.002, "likewise of a carrier phase", unit="m", minimum=0.0)
    rate_sigma: float = number(
        0.05, "likewise of the range rate from the Doppler", unit="m/s", minimum=0.0
    )
    clock_offset: float = number(
        1e-4,
        "receiver's clock minus GPS time at the start",
        unit="s",
        minimum=-1e-2,
        maximum=1e-2,
    )
    clock_drift: float = number(
        1e-7, "constant rate error of the receiver's clock", unit="s/s", minimum=-1e-4, maximum=1e-4
    )
    clock_random_walk: float = number(
        3e-10,
        "random walk of the receiver's clock; default: a temperature-compensated crystal (h0 = "
        "2e-19 s)",
        unit="s/sqrt(s)",
        minimum=0.0,
    )
    ionosphere: bool = flag(True, "delay of the ionosphere by Klobuchar's model")
    klobuchar: tuple[float, ...] = numbers(
        (1.118e-8, -7.451e-9, -5.961e-8, 1.192e-7, 1.167e5, -2.294e5, -1.311e5, 1.049e6),
        "alpha 0 to 3 and beta 0 to 3 of that model, if the ephemeris file has none",
        unit="s, s/semicircle, ...",
        group=8,
    )
    troposphere: bool = flag(True, "delay of the troposphere by Saastamoinen's model")

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line unless there are eight numbers."""
        if len(self.klobuchar) != 8:
            yield f"{prefix}klobuchar: must be eight numbers, alpha 0 to 3 and beta 0 to 3"


@dataclass(frozen=True)
class GnssParameters(SensorParameters):
    """One receiver; its lever arm is that of the antenna."""

    rate: float = number(10.0, "fixes per second", unit="Hz", minimum=LOWEST_RATE, maximum=100.0)
    frame: str = text("gps_link", "frame of its messages, at the antenna; empty: body_frame")
    preset: str = text("none", "file in config/gnss, or a path, to start from")
    mode: str = choice("single", MODES, "mode at the start")
    mode_changes: tuple[float, ...] = numbers(
        (),
        "time [s] since the start and mode (1 single, 2 dgps, 3 float, 4 fixed) alternating, times "
        "increasing",
        unit="s, 1",
        group=2,
        minimum=0.0,
    )
    horizontal_sigma: tuple[float, ...] = numbers(
        (1.5, 0.6, 0.2, 0.01),
        f"standard deviation of the error east, and likewise north, {_PER_MODE}",
        unit="m",
        minimum=0.0,
        group=4,
    )
    vertical_sigma: tuple[float, ...] = numbers(
        (3.0, 1.2, 0.4, 0.015),
        f"standard deviation of the error up, {_PER_MODE}",
        unit="m",
        minimum=0.0,
        group=4,
    )
    white_share: float = number(
        0.1,
        "share of white noise in the variance of these errors; the rest is a first-order "
        "Gauss-Markov process, like the residuals of ionosphere and troposphere",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )
    correlation_time: float = number(
        200.0,
        "time constant of the Gauss-Markov process",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    random_walk: float = number(
        0.0,
        "random walk of the error on each axis; the stated covariance does not include it",
        unit="m/sqrt(s)",
        minimum=0.0,
    )
    multipath_rate: float = number(
        0.0, "mean rate of jumps by multipath", unit="1/s", minimum=0.0, maximum=100.0
    )
    multipath_sigma: float = number(
        0.0,
        "standard deviation of a jump on each axis; the stated covariance does not include it",
        unit="m",
        minimum=0.0,
    )
    multipath_duration: float = number(
        5.0,
        "mean duration of a jump (exponentially distributed)",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    velocity_sigma: float = number(
        0.05, "standard deviation of the velocity, white, on each axis", unit="m/s", minimum=0.0
    )
    covariance_factor: float = number(
        1.0,
        "stated covariance over the true one, of position and velocity; below 1, the receiver is "
        "overconfident",
        unit="1",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    outages: tuple[float, ...] = numbers(
        (),
        "start, from the IMU's first sample, and duration of each outage",
        unit="s, s",
        group=2,
        minimum=0.0,
    )
    outage_boxes: tuple[float, ...] = numbers(
        (),
        "boxes in the world in which there is no fix: least x, y, z, then largest x, y, z, of each",
        unit="m",
        group=6,
    )
    outage_rate: float = number(
        0.0, "mean rate of random outages", unit="1/s", minimum=0.0, maximum=100.0
    )
    outage_duration: float = number(
        10.0,
        "mean duration of random outages (exponentially distributed)",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    silent: bool = flag(
        True,
        "no message in an outage; false: messages with STATUS_NO_FIX, the last known position "
        "and unknown covariance",
    )
    sky: str = choice(
        "satellites",
        ("satellites", "constant"),
        "satellites: 30 satellites like those of GPS, seen above the masks, dilute the precision; "
        "constant: `satellites`, `hdop` and `vdop` apply all the time",
    )
    elevation_mask_deg: float = number(
        10.0,
        "satellites below this elevation are not used",
        unit="deg",
        minimum=0.0,
        maximum=90.0,
    )
    mask_boxes: tuple[float, ...] = numbers(
        (),
        "boxes in the world in which a higher mask hides satellites, as houses do: least x, y, z, "
        "largest x, y, z, and elevation, of each",
        unit="m, deg",
        group=7,
    )
    hdop: float = number(
        1.0,
        "horizontal dilution of precision at which `horizontal_sigma` applies; the error is "
        "proportional to the dilution",
        minimum=0.1,
        maximum=99.9,
    )
    vdop: float = number(
        1.5,
        "vertical dilution of precision at which `vertical_sigma` applies",
        minimum=0.1,
        maximum=99.9,
    )
    satellites: int = integer(12, "satellites in use if `sky` is constant", minimum=4, maximum=60)

    ephemeris: str = text(
        "",
        "RINEX navigation file, version 2 or 3, with the GPS satellites of the sky; empty: a "
        "generic constellation of 30",
    )
    raw: RawParameters = section(RawParameters)
    nmea: str = text(
        "",
        "pseudo-terminal to which a node writes NMEA, like a receiver on a serial line: pty, or "
        "the path of a symbolic link to create; empty: none",
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from super().problems(prefix)
        for name, sigmas in (
            ("horizontal_sigma", self.horizontal_sigma),
            ("vertical_sigma", self.vertical_sigma),
        ):
            if len(sigmas) != len(MODES):
                yield f"{prefix}{name}: must be four numbers, {_PER_MODE}"
        for previous, following in pairwise(self.mode_changes[::2]):
            if following <= previous:
                yield (
                    f"{prefix}mode_changes: time {following:g} s after {previous:g} s: "
                    "must increase"
                )
        for mode in self.mode_changes[1::2]:
            if mode not in (1.0, 2.0, 3.0, 4.0):
                yield f"{prefix}mode_changes: mode {mode:g}: must be 1, 2, 3 or 4"
        for k in range(0, len(self.outage_boxes), 6):
            box = self.outage_boxes[k : k + 6]
            if any(low >= high for low, high in zip(box[:3], box[3:], strict=True)):
                yield f"{prefix}outage_boxes: {list(box)}: least must be below largest"
        for k in range(0, len(self.mask_boxes), 7):
            box = self.mask_boxes[k : k + 7]
            if any(low >= high for low, high in zip(box[:3], box[3:6], strict=True)):
                yield f"{prefix}mask_boxes: {list(box)}: least must be below largest"
            if not 0.0 <= box[6] <= 90.0:
                yield f"{prefix}mask_boxes: elevation {box[6]:g}: must be between 0 and 90 deg"
        if self.mask_boxes and self.sky == "constant":
            yield f"{prefix}mask_boxes: must be empty if {prefix}sky is constant"
        if self.sky == "constant" and (self.ephemeris or self.raw.rinex):
            name = "ephemeris" if self.ephemeris else "raw.rinex"
            yield f"{prefix}{name}: must not be given where {prefix}sky is constant"
        if bool(self.multipath_rate) != bool(self.multipath_sigma):
            yield (
                f"{prefix}multipath_rate = {self.multipath_rate:g} and {prefix}multipath_sigma = "
                f"{self.multipath_sigma:g}: must both be 0 or both be above 0"
            )
