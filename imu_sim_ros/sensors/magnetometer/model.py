# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The magnetometer of an IMU, from the field of the world to the digital output."""

import math
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, MissingDependencyError
from imu_sim_ros.core.rotation import rotate, rotate_inverse, transform
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.realised import add_constants, include_turn_on
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.magnetometer.parameters import MagnetometerParameters
from imu_sim_ros.sensors.model import SensorWithImu
from imu_sim_ros.sensors.timing import Sampled
from imu_sim_ros.sensors.world import World

MU0_OVER_4_PI: Final = 1e-7
"""Magnetic constant over 4 pi [T m/A]; measured in the SI of 2019, it agrees to nine digits."""
_FILES: Final = ((2025.0, "WMM_2025"), (2020.0, "WMM_2020"), (2015.0, "WMM_2015v2"))
_OLDEST: Final = "WMM_2010"


class MagneticField:
    """Field in the world frame, ENU; the Earth's part is one vector for the whole world."""

    def __init__(self, environment: EnvironmentParameters) -> None:
        """Set up the field of the parameters.

        :raises ConfigurationError: for a place or date beyond the World Magnetic Model.
        :raises MissingDependencyError: if pygeomag is missing.
        """
        p = environment.magnetic_field
        self.earth_w = (
            np.array(p.value) if p.model == "constant" else world_magnetic_model(environment)
        )
        """(3,) field of the Earth in the world [T]."""
        dipoles = np.reshape(p.dipoles, (-1, 6))
        self._dipoles = [(row[:3], row[3:]) for row in dipoles]
        self._radius = p.dipole_radius
        self._alternating = np.array(p.alternating)
        self._angular_frequency = 2.0 * math.pi * p.alternating_frequency

    def field(self, t: Array, position: Array) -> Array:
        """Return the field (n, 3) [T] at times t (n,) [s] and positions (n, 3) [m] in the world.

        A dipole m at a distance r: ``mu_0 / (4 pi r^3) (3 (m r) r / r^2 - m)`` (Jackson, "Classical
        Electrodynamics", 3rd ed., eq. 5.56); inside its sphere of radius R, ``mu_0 m / (2 pi R^3)``
        (eq. 5.105 with the magnetisation ``m / (4 pi R^3 / 3)``).
        """
        field = np.empty((len(t), 3), order="F")
        field[:] = self.earth_w
        for centre, moment in self._dipoles:
            field += self._dipole(position - centre, moment)
        if self._alternating.any():
            field += self._alternating * np.sin(self._angular_frequency * t)[:, None]
        return field

    def _dipole(self, r: Array, moment: Array) -> Array:
        """Return the field (n, 3) of a dipole at places (n, 3) relative to it."""
        x, y, z = r.T
        squared = x * x + y * y + z * z
        in_sphere = squared < self._radius**2
        squared = np.where(in_sphere, 1.0, squared)
        along = 3.0 * (moment[0] * x + moment[1] * y + moment[2] * z) / squared
        cubed = squared * np.sqrt(squared)
        far_field = MU0_OVER_4_PI * (along[:, None] * r - moment) / cubed[:, None]
        within = 2.0 * MU0_OVER_4_PI * moment / self._radius**3
        return np.where(in_sphere[:, None], within, far_field)


def world_magnetic_model(environment: EnvironmentParameters) -> Array:
    """Return the Earth's field at the world's origin, ENU (3,) [T].

    The World Magnetic Model of NOAA and BGS, as pygeomag computes it: north, east and down in nT.

    :raises ConfigurationError: for a place or date beyond the model.
    :raises MissingDependencyError: if pygeomag is missing.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise MissingDependencyError(
            "magnetic_field.model = wmm needs pygeomag: pip install pygeomag "
            "(there is no apt package)"
        ) from None
    date = environment.magnetic_field.date
    name = next((name for year, name in _FILES if date >= year), _OLDEST)
    try:
        components = GeoMag(coefficients_file=f"wmm/{name}.COF").calculate(
            glat=environment.latitude_deg,
            glon=environment.longitude_deg,
            alt=environment.height * 1e-3,
            time=date,
        )
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"magnetic_field.model = wmm: {error}") from None
    return np.array([components.y, components.x, -components.z]) * 1e-9


NAME: Final = "magnetometer"


def realise_magnetometer(parameters: MagnetometerParameters, seed: int) -> MagnetometerParameters:
    """Return the magnetometer of this seed, without random constants left.

    A turn-on scale s multiplies the whole field at the sensor's axes, with iron and currents.
    """
    p = add_constants(parameters, NAME, seed)
    return include_turn_on(p, NAME, seed, rotation.to_matrix(rotation.exp(p.misalignment)))


class Iron(NamedTuple):
    """Disturbances of a magnetometer in its axes, of one unit or of a batch."""

    response: Array
    """(..., 3, 3) misalignment and soft iron; exactly the identity without them."""
    hard: Array
    """(..., 3) hard iron [T]."""
    coupling: Array
    """(..., 3) field of one ampere [T/A]."""


def iron(unit: MagnetometerParameters) -> Iron:
    """Return the disturbances of one magnetometer in its axes m, from those in the IMU's axes i.

    :param unit: parameters after :func:`realise_magnetometer`: its random constants are drawn.
    """
    r_mi = rotation.to_matrix(rotation.exp(unit.misalignment)).T
    soft_iron = np.reshape(unit.soft_iron, (3, 3))
    return Iron(
        response=r_mi @ soft_iron,
        hard=r_mi @ np.array(unit.hard_iron),
        coupling=r_mi @ np.array(unit.current_coupling),
    )


def current_at(parameters: MagnetometerParameters, t: Array) -> Array:
    """Return the current in the wires (n,) [A] at times t (n,) [s]; None without a current."""
    profile = np.reshape(parameters.current_profile, (-1, 2)).T
    return np.interp(t, profile[0], profile[1])


def read_field(
    triad: Triad,
    iron_effects: Iron,
    start: int,
    ideal: Array,
    current: Array | None,
    additions: Additions,
    faults: FaultSchedule | None = None,
) -> dict[str, Array]:
    """Return the next n samples of one magnetometer or of a batch, and their truth, by name [T].

    :param triad: errors of the sensor.
    :param iron_effects: disturbances of the sensor.
    :param start: index of the first sample.
    :param ideal: (n, ..., 3) field in the IMU's axes [T].
    :param current: (n, ...) current in the wires [A]; None: none.
    :param additions, faults: as for :meth:`Triad.read`.
    """
    disturbance = np.broadcast_to(iron_effects.hard, ideal.shape)
    if current is not None:
        disturbance = disturbance + iron_effects.coupling * current[..., None]
    field = transform(iron_effects.response, ideal) + disturbance
    # A magnetometer has no errors by force: the triad's second input has no effect.
    samples = triad.read(start, field, field, additions, faults)
    bias = samples.bias + samples.scale * disturbance
    return {"field": samples.reading, "ideal_field": ideal, "bias": bias}


class Magnetometer(SensorWithImu):
    """One magnetometer."""

    parameters: MagnetometerParameters

    def __init__(self, mounted: Mounted[ImuParameters], t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the start [ns].
        """
        super().__init__(mounted, t0_ns)
        imu, environment = mounted.parameters, mounted.environment
        self._field = MagneticField(environment)
        self.earth_w = self._field.earth_w
        """(3,) the Earth's field in the world [T]."""
        self._r_ib = np.reshape(imu.mounting, (3, 3)).T
        self._iron = iron(add_constants(self.parameters, NAME, environment.seed))

    def ideal(self, t: Array, world: World) -> Array:
        """Return the field in the IMU's axes (n, 3) [T]."""
        motion = world.motion(t)
        position = motion.position + rotate(motion.q_wb, self.lever_arm_b)
        return transform(self._r_ib, rotate_inverse(motion.q_wb, self._field.field(t, position)))

    def measure(self, samples: Sampled, ideal: Array, additions: Additions) -> dict[str, Array]:
        """Return fields and biases [T] of the next n samples."""
        flows = bool(self.parameters.current_profile)
        current = current_at(self.parameters, samples.t) if flows else None
        faults = self.timing.faults
        return read_field(self.triad, self._iron, samples.first, ideal, current, additions, faults)
