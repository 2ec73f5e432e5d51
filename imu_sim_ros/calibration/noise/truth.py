# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of recovered and true parameters."""

from typing import NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.analysis import AllanResult
from imu_sim_ros.calibration.noise.estimate import Estimate
from imu_sim_ros.calibration.noise.gauss_markov import CORRELATION_TIME, SIGMA
from imu_sim_ros.calibration.noise.terms import QUANTISATION
from imu_sim_ros.core.conventions import AXES, TRIADS
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters


class ParameterComparison(NamedTuple):
    """One parameter of one axis next to its truth."""

    axis: int
    key: str
    truth: float
    estimate: Estimate
    covered: bool

    def to_dict(self) -> dict[str, object]:
        """Return the comparison in plain types, for ``--json``."""
        return {
            "triad": TRIADS[self.axis // 3],
            "axis": AXES[self.axis % 3],
            "parameter": self.key,
            "truth": self.truth,
            "covered": self.covered,
        }


def load_truth(path: str) -> ImuParameters:
    """Return the IMU of a parameter file or of a name in config/imus.

    :raises ConfigurationError: for a file that cannot be read or does not fit.
    """
    from imu_sim_ros.simulation.parameters import load_simulation  # only analyses with a truth

    return load_simulation({"imu.preset": str(files.find("imus", path))}).imu


def true_noise(imu: ImuParameters, rate: float) -> dict[str, Array]:
    """Return the true values by key, each (6,).

    The rounding of the readings to their resolution adds white noise: with steps of LSB
    the samples' variance grows by LSB^2 / 12. Increments in steps are quantisation noise with
    ``Q = step / sqrt(12)`` (IEEE Std 952-1997, C.1.5).

    :param rate: sample rate [Hz].
    """
    triads = [_true_noise(imu.triad(name), rate) for name in TRIADS]
    return {key: np.concatenate([values[key] for values in triads]) for key in triads[0]}


def _true_noise(triad: TriadParameters, rate: float) -> dict[str, Array]:
    """Return the true coefficients (3,) of a triad by the keys of the noise terms."""
    return {
        QUANTISATION.key: np.asarray(triad.increment_resolution) / np.sqrt(12.0),
        "noise_density": np.sqrt(triad.white_variance(rate) / rate),
        "random_walk": np.asarray(triad.random_walk),
        "bias_instability": np.asarray(triad.bias_instability),
        "rate_ramp": np.abs(triad.rate_ramp),
        SIGMA: triad.gauss_markov,
        CORRELATION_TIME: np.asarray(triad.correlation_time),
    }


def compare(result: AllanResult, imu: ImuParameters) -> list[ParameterComparison]:
    """Return the comparison of the parameters that both the model and the sensor have.

    Quantisation is compared if the sensor has increments in steps. A Gauss-Markov process is not in
    the standard model, where it looks like flicker and walk; of such a sensor, the standard model
    is compared in the white noise alone.
    """
    truth = true_noise(imu, result.timing.rate)
    comparisons = []
    for axis in (k for k in range(6) if result.noise[k] is not None):
        lacks_process = SIGMA not in result.keys and truth[SIGMA][axis] > 0.0
        for key in ("noise_density",) if lacks_process else result.keys:
            absent = key == QUANTISATION.key and truth[key][axis] == 0.0
            if key in truth and not absent:
                estimate, value = result.estimate(axis, key), float(truth[key][axis])
                comparisons.append(
                    ParameterComparison(
                        axis=axis,
                        key=key,
                        truth=value,
                        estimate=estimate,
                        covered=estimate.covers(value),
                    )
                )
    return comparisons
