# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The magnetometer of a board, from the field of the world to the digital output.

::

    1  field        B = R_ib.T R_wb.T B_w(p, t)     in the IMU's axes, at the IMU's place
    2  iron         A B + b + c I(t)                soft iron, hard iron, currents
    3  axes         R_im.T (...)                    misalignment to the accelerometer
    4  the sensor   scale, bias, walk, 1/f, noise, range and steps, as in gyroscopes

``reading = scale * (R_im.T A B) + bias + n`` where the bias is all that does not depend on B.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.config import EnvironmentParameters, ImuParameters
from imu_sim_ros.config.auxiliary import MagnetometerParameters
from imu_sim_ros.rotation.components import rotate, rotate_inverse, transform
from imu_sim_ros.sensor.auxiliary.magnetic_field import MagneticField
from imu_sim_ros.sensor.auxiliary.own_rate import OwnRate, Sampled, instantaneous
from imu_sim_ros.sensor.block import ImuBlock, MagneticBlock
from imu_sim_ros.sensor.errors import (
    TemperatureProfile,
    Triad,
    TurnOn,
    with_constants,
    with_turn_on,
)
from imu_sim_ros.sensor.faults import Fault
from imu_sim_ros.trajectory import Trajectory

Array = NDArray[np.float64]

NAME: Final = "magnetometer"


def realised_magnetometer(parameters: MagnetometerParameters, seed: int) -> MagnetometerParameters:
    """Return the magnetometer of this seed with nothing left to draw but the noise.

    A turn-on scale s multiplies all that the sensor's axes see: iron and currents take it.
    """
    p = with_constants(parameters, NAME, seed)
    drawn = TurnOn(seed, NAME, p.as_triad())
    r_im = rotation.to_matrix(rotation.exp(p.misalignment))
    gain = r_im @ np.diag(1.0 + drawn.scale) @ r_im.T
    result: MagnetometerParameters = with_turn_on(p, drawn, gain)
    return result


class Magnetometer:
    """One magnetometer; its samples are read in order."""

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the IMU's sample 0 [ns].
        """
        self._own = OwnRate(NAME, imu.magnetometer, imu, environment, t0_ns)
        self._field = MagneticField(environment)
        self._lever_arm_b = np.reshape(imu.lever_arm, (3, 1))
        self._r_ib = np.reshape(imu.mounting, (3, 3)).T
        unit = with_constants(imu.magnetometer, NAME, environment.seed)
        # Misalignment and soft iron in one matrix: exactly the identity where there is neither.
        self._r_mi = rotation.to_matrix(rotation.exp(unit.misalignment)).T
        self._iron = self._r_mi @ np.reshape(unit.soft_iron, (3, 3))
        self._hard_iron: Array = (self._r_mi @ np.array(unit.hard_iron))[:, None]
        self._coupling: Array = (self._r_mi @ np.array(unit.current_coupling))[:, None]
        self._current = np.reshape(unit.current_profile, (-1, 2)).T
        self._last: Sampled | None = None
        self._triad = Triad(NAME, instantaneous(imu), environment.seed, imu.magnetometer.rate)
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._reference_temperature = imu.reference_temperature
        self._own.configure(imu)
        self._triad.configure(instantaneous(imu))

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault begin with the first sample not before the IMU's sample ``first``."""
        self._own.inject(fault, first)

    def imu_samples(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return, of the samples read last, the IMU's that each follows; whether at its time."""
        assert self._last is not None
        return self._own.imu_samples(self._last)

    def read(
        self, block: ImuBlock, trajectory: Trajectory, temperature: TemperatureProfile
    ) -> MagneticBlock:
        """Return the samples that were not read yet and lie before the end of the IMU's block."""
        samples = self._own.next(block.first + len(block.true_t_ns), trajectory.duration)
        self._last = samples
        position, q_wb, celsius = self._own.place(samples, block, trajectory, temperature)
        place = position + rotate(q_wb, self._lever_arm_b)
        field_w = self._field.at(samples.t, place)
        ideal = transform(self._r_ib, rotate_inverse(q_wb, field_w))
        disturbance = self._disturbance(samples.t)
        offset = celsius - self._reference_temperature
        along = transform(self._iron, ideal) + disturbance
        made = self._triad.read(
            samples.first, along, np.zeros(along.shape), offset, self._own.faults
        )
        stamped = self._own.stamp(samples)
        return MagneticBlock(
            samples.true_t_ns,
            *stamped,
            made.reading.T,
            ideal.T,
            (made.bias + made.scale * disturbance).T,
        )

    def _disturbance(self, t: Array) -> Array:
        """Return what iron and currents add in the sensor's axes (3, n) [T]."""
        if not self._current.size:
            return np.broadcast_to(self._hard_iron, (3, len(t)))
        current = np.interp(t, self._current[0], self._current[1])
        result: Array = self._hard_iron + self._coupling * current
        return result
