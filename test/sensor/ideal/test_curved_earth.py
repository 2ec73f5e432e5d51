# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings on a curved Earth against Newton's law in inertial space, and against pyins."""

import math
from typing import Any

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.rotation import skew, to_matrix
from imu_sim_ros.sensors.gravity import EARTH_RATE, CurvedEarth, normal_gravity
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

A, E2 = 6378137.0, 6.69437999014e-3
PLACE: dict[str, Any] = {
    "curved_earth": True,
    "gravity_model": "wgs84",
    "latitude_deg": 48.0,
    "longitude_deg": 11.5,
    "height": 500.0,
}
FLIGHT: dict[str, Any] = {
    "trajectory.type": "harmonic",
    "trajectory.x.polynomial": [2000.0, 230.0, 0.05],
    "trajectory.y.polynomial": [-1000.0, -150.0],
    "trajectory.z.polynomial": [9000.0, 3.0],
    "trajectory.z.amplitude": [20.0],
    "trajectory.z.angular_frequency": [0.3],
    "trajectory.x.amplitude": [10.0],
    "trajectory.x.angular_frequency": [0.5],
    "trajectory.roll.amplitude": [0.3],
    "trajectory.roll.angular_frequency": [0.7],
    "trajectory.pitch.amplitude": [0.2],
    "trajectory.pitch.angular_frequency": [0.5],
    "trajectory.yaw.polynomial": [0.3, 0.1],
}


class Jet:
    """A function of time by value and first and second derivative: exact rules, no steps."""

    def __init__(self, *values: Any) -> None:
        self.f, self.d, self.dd = values if len(values) == 3 else (values[0], 0.0, 0.0)

    def __add__(self, o: Any) -> "Jet":
        o = o if isinstance(o, Jet) else Jet(o)
        return Jet(self.f + o.f, self.d + o.d, self.dd + o.dd)

    def __mul__(self, o: Any) -> "Jet":
        o = o if isinstance(o, Jet) else Jet(o)
        return Jet(
            self.f * o.f,
            self.d * o.f + self.f * o.d,
            self.dd * o.f + 2.0 * self.d * o.d + self.f * o.dd,
        )

    __radd__, __rmul__ = __add__, __mul__

    def of(self, f: Any, d: Any, dd: Any) -> "Jet":
        return Jet(f, d * self.d, dd * self.d**2 + d * self.dd)

    def sin(self) -> "Jet":
        return self.of(np.sin(self.f), np.cos(self.f), -np.sin(self.f))

    def cos(self) -> "Jet":
        return self.of(np.cos(self.f), -np.sin(self.f), -np.cos(self.f))

    def power(self, p: float) -> "Jet":
        return self.of(self.f**p, p * self.f ** (p - 1), p * (p - 1) * self.f ** (p - 2))


def in_space(block: Samples, t: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rate and specific force (n, 3) of a point of the body from its path in space.

    ``f = R^T (r'' - gravitation)``; the rate from the derivative of the attitude in space.
    """
    m = block.motion
    phi_0, h_0 = math.radians(PLACE["latitude_deg"]), PLACE["height"]
    w = 1.0 - E2 * math.sin(phi_0) ** 2
    north = A * (1.0 - E2) / w**1.5 + h_0
    east = (A / math.sqrt(w) + h_0) * math.cos(phi_0)
    x, y, z = (Jet(m.position[:, k], m.velocity[:, k], m.acceleration[:, k]) for k in range(3))
    phi, h = phi_0 + y * (1.0 / north), h_0 + z
    # In space longitude grows with the Earth's rotation.
    lam = x * (1.0 / east) + Jet(EARTH_RATE * t, EARTH_RATE, 0.0)
    sp, cp, sl, cl = phi.sin(), phi.cos(), lam.sin(), lam.cos()
    n = A * (1.0 + -E2 * sp * sp).power(-0.5)
    r = [(n + h) * cp * cl, (n + h) * cp * sl, (n * (1.0 - E2) + h) * sp]
    zero = Jet(0.0 * t, 0.0, 0.0)
    c_en = [[-1.0 * sl, -1.0 * sp * cl, cp * cl], [cl, -1.0 * sp * sl, cp * sl], [zero, cp, sp]]
    omega, alpha = m.angular_velocity, m.angular_acceleration
    r_nb = to_matrix(m.q_wb)
    omega_x, alpha_x = skew(omega), skew(alpha)
    # The attitude in space C = C_en R_nb and its derivatives, R' = R [omega]x.
    r_1 = r_nb @ omega_x
    r_2 = r_nb @ (omega_x @ omega_x + alpha_x)
    c_0, c_1, c_2 = (
        np.array(
            [[np.broadcast_to(getattr(e, d), t.shape) for e in row] for row in c_en]
        ).transpose(2, 0, 1)
        for d in ("f", "d", "dd")
    )
    body, body_1 = c_0 @ r_nb, c_1 @ r_nb + c_0 @ r_1
    body_2 = c_2 @ r_nb + 2.0 * c_1 @ r_1 + c_0 @ r_2
    spin = np.swapaxes(body, 1, 2) @ body_1
    rate = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    acceleration = np.stack([e.dd for e in r], axis=1) + body_2 @ arm
    g = np.array([normal_gravity(a, b) for a, b in zip(phi.f, h.f, strict=True)])
    gravity = -g[:, None] * c_0[:, :, 2]
    # Gravity less its centrifugal part; it is taken to be the same at both ends of the lever arm.
    centre = (np.stack([r[0].f, r[1].f, 0.0 * t], axis=1) + body @ arm) * [1.0, 1.0, 0.0]
    gravitation = gravity - EARTH_RATE**2 * centre
    force = np.einsum("nij,ni->nj", body, acceleration - gravitation)
    return rate, force


@pytest.mark.parametrize("arm", [(0.0, 0.0, 0.0), (0.5, -1.0, 2.0)])
def test_readings_are_newtons_law_in_space(arm: tuple[float, ...]) -> None:
    values = {"imu.preset": "perfect", "earth_rotation": True, "imu.lever_arm": list(arm)}
    block = Body(load_simulation({**PLACE, **FLIGHT, **values, "rate": 5.0})).next(500)["imu"]
    t = np.arange(500) / 5.0
    rate, force = in_space(block, t, np.array(arm))
    assert np.abs(block.gyro - rate).max() < 1e-12
    assert np.abs(block.accel - force).max() < 1e-9


def test_a_world_that_does_not_rotate_still_curves() -> None:
    values = {"imu.preset": "perfect", **PLACE, "trajectory.type": "harmonic"}
    values["trajectory.x.polynomial"] = [0.0, 250.0]
    block = Body(load_simulation(values)).next(2)["imu"]
    radius = A / math.sqrt(1.0 - E2 * math.sin(math.radians(48.0)) ** 2) + 500.0
    v = 250.0
    latitude = math.radians(48.0)
    assert block.gyro[0] == pytest.approx([0.0, v / radius, v / radius * math.tan(latitude)])
    lift = normal_gravity(latitude, 500.0) - v**2 / radius
    side = v**2 / radius * math.tan(latitude)
    assert block.accel[0] == pytest.approx([0.0, side, lift], abs=1e-9)


def navigated_by_pyins(rate: float, seconds: float) -> np.ndarray:
    """Return the errors north, east [m] and of heading [deg] of pyins on our increments."""
    pd = pytest.importorskip("pandas")
    strapdown = pytest.importorskip("pyins.strapdown")
    values = {
        "imu.preset": "perfect",
        "imu.sampling": "averaged",
        "earth_rotation": True,
        **PLACE,
        "rate": rate,
        "trajectory.type": "harmonic",
        "trajectory.x.polynomial": [0.0, 200.0],
        "trajectory.y.polynomial": [0.0, -150.0],
        "trajectory.yaw.polynomial": [0.0, 1e-3],
    }
    parameters = load_simulation(values)
    block = Body(parameters).next(round(seconds * rate) + 1)["imu"]
    earth = CurvedEarth(parameters)
    place, ground = earth.geodetic(block.motion.position), earth.over_ground(block.motion)
    to_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    frd = np.diag([1.0, -1.0, -1.0])
    attitude = to_ned @ to_matrix(block.motion.q_wb[[0, -1]]) @ frd
    heading = np.degrees(np.arctan2(attitude[:, 1, 0], attitude[:, 0, 0]))
    latitude, longitude = np.degrees(place.latitude), np.degrees(place.longitude)
    at_start = [latitude[0], longitude[0], place.height[0], *(to_ned @ ground.velocity[0])]
    names = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    start = pd.Series([*at_start, 0.0, 0.0, heading[0]], index=names, name=0.0)
    increments = np.hstack([block.gyro[1:] @ frd, block.accel[1:] @ frd]) / rate
    names = ["theta_x", "theta_y", "theta_z", "dv_x", "dv_y", "dv_z"]
    table = pd.DataFrame(increments, columns=names, index=np.arange(1, len(increments) + 1) / rate)
    table.insert(0, "dt", 1.0 / rate)
    end = strapdown.Integrator(start, with_altitude=False).integrate(table).iloc[-1]
    metres = math.radians(1.0) * A
    return np.array(
        [
            (end.lat - latitude[-1]) * metres,
            (end.lon - longitude[-1]) * metres * math.cos(place.latitude[-1]),
            end.heading - heading[-1],
        ]
    )


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_pyins_navigates_150_km_with_the_readings() -> None:
    """pyins holds the rates of an interval: its error is of first order, and nothing is left."""
    coarse, fine = navigated_by_pyins(2.0, 600.0), navigated_by_pyins(4.0, 600.0)
    assert np.abs(fine[:2]).max() < 20.0
    assert fine == pytest.approx(coarse / 2.0, rel=0.01, abs=1e-7)
    assert np.abs(2.0 * fine - coarse)[:2].max() < 0.02


def test_at_the_origin_it_is_the_flat_world() -> None:
    flat = {key: value for key, value in PLACE.items() if key not in ("curved_earth",)}
    values = {"imu.preset": "perfect", "earth_rotation": True, "trajectory.type": "static"}
    mounted_reading, two = (
        Body(load_simulation({**values, **place})).next(10)["imu"] for place in (PLACE, flat)
    )
    assert np.allclose(mounted_reading.gyro, two.gyro, rtol=0.0, atol=1e-18)
    assert np.allclose(mounted_reading.accel, two.accel, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"gravity_model": "constant"}, "gravity_model = 'constant': must be wgs84 where"),
        ({"latitude_deg": -89.0}, "latitude_deg = -89: must be within 85 deg"),
    ],
)
def test_parameters_that_contradict_the_curved_earth_are_refused(
    values: dict[str, Any], line: str
) -> None:
    with pytest.raises(ConfigurationError, match=line):
        load_simulation({**PLACE, **values})
