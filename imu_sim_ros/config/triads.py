# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the errors of gyroscope and accelerometer: each off at zero, each per axis.

Names and units of the noise are kalibr's. ``live`` marks what may change between two blocks without
a jump of anything else.
"""

from dataclasses import dataclass

from imu_sim_ros.config.parameter import (
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    Matrix,
    Vector,
    matrix,
    numbers,
    vector,
)

NO_CROSS_AXIS = (0.0,) * 6


@dataclass(frozen=True)
class GyroscopeParameters:
    """Errors of the gyroscope."""

    gyroscope_noise_density: Vector = vector(
        0.0,
        "white noise of the gyroscope, continuous time, two-sided: the variance of a sample is "
        "density^2 * rate; a data sheet's one-sided density D is D / sqrt(2) here",
        unit="rad/s/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    gyroscope_random_walk: Vector = vector(
        0.0,
        "random walk of the gyroscope's bias, continuous time",
        unit="rad/s^2/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    gyroscope_gauss_markov_sigma: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the gyroscope: its stationary standard deviation",
        unit="rad/s",
        minimum=0.0,
        live=True,
    )
    gyroscope_gauss_markov_density: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the gyroscope: the noise that drives it (as in RotorS)",
        unit="rad/s^2/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    gyroscope_correlation_time: Vector = vector(
        0.0, "correlation time of the gyroscope's Gauss-Markov bias", unit="s", minimum=0.0
    )
    gyroscope_bias_instability: Vector = vector(
        0.0,
        "bias instability B of the gyroscope: 1/f noise of two-sided density "
        "B^2 / (2 pi f); the flat Allan deviation is 0.664 B",
        unit="rad/s",
        minimum=0.0,
        live=True,
    )
    gyroscope_rate_ramp: Vector = vector(
        0.0, "steady drift of the gyroscope's bias", unit="rad/s^2", live=True
    )
    gyroscope_bias: Vector = vector(0.0, "constant bias of the gyroscope", unit="rad/s", live=True)
    gyroscope_turn_on_bias_sigma: Vector = vector(
        0.0,
        "standard deviation of the gyroscope's bias from run to run, drawn from the seed",
        unit="rad/s",
        minimum=0.0,
    )
    gyroscope_turn_on_scale_sigma: Vector = vector(
        0.0,
        "standard deviation of the gyroscope's scale from run to run, drawn from the seed",
        unit="1",
        minimum=0.0,
    )
    gyroscope_scale_misalignment: Matrix = matrix(
        IDENTITY_MATRIX, "scale and misalignment S of the gyroscope: reading = S x + b", live=True
    )
    gyroscope_scale_error_percent: Vector = vector(
        0.0,
        "scale error of the gyroscope, instead of the matrix: the diagonal of S - I",
        unit="%",
        live=True,
    )
    gyroscope_misalignment_percent: tuple[float, ...] = numbers(
        NO_CROSS_AXIS,
        "cross-axis terms of the gyroscope, instead of the matrix: xy, xz, yx, yz, zx, zy of S",
        unit="%",
        group=6,
        live=True,
    )
    gyroscope_quadratic: Vector = vector(
        0.0, "second-order non-linearity of the gyroscope: q x^2", unit="1/(rad/s)", live=True
    )
    gyroscope_g_sensitivity: Matrix = matrix(
        ZERO_MATRIX,
        "what one m/s^2 of specific force adds to the gyroscope's reading",
        unit="(rad/s)/(m/s^2)",
        live=True,
    )
    gyroscope_temperature_bias: tuple[float, ...] = numbers(
        (),
        "bias polynomial of the gyroscope: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="rad/s/K^(k+1)",
        group=3,
        live=True,
    )
    gyroscope_temperature_scale: tuple[float, ...] = numbers(
        (),
        "scale polynomial of the gyroscope: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="1/K^(k+1)",
        group=3,
        live=True,
    )
    gyroscope_temperature_bias_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the gyroscope's linear bias drift with temperature; "
        "sign and size are drawn from the seed and add to temperature_bias",
        unit="rad/s/K",
        minimum=0.0,
    )
    gyroscope_temperature_scale_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the gyroscope's linear scale drift with temperature; "
        "sign and size are drawn from the seed and add to temperature_scale",
        unit="1/K",
        minimum=0.0,
    )
    gyroscope_misalignment_sigma: Vector = vector(
        0.0,
        "standard deviation over units of each cross-axis term of the gyroscope's axis, "
        "drawn from the seed",
        unit="1",
        minimum=0.0,
    )
    gyroscope_quadratic_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the gyroscope's second-order non-linearity, "
        "drawn from the seed",
        unit="1/(rad/s)",
        minimum=0.0,
    )
    gyroscope_g_sensitivity_sigma: Vector = vector(
        0.0,
        "standard deviation over units of each term of the g-sensitivity of the gyroscope's axis, "
        "drawn from the seed",
        unit="(rad/s)/(m/s^2)",
        minimum=0.0,
    )
    gyroscope_bandwidth: Vector = vector(
        0.0, "cut-off (-3 dB) of the gyroscope's low-pass; 0: none", unit="Hz", minimum=0.0
    )
    gyroscope_range: Vector = vector(
        0.0, "largest rate of the gyroscope; 0: no limit", unit="rad/s", minimum=0.0, live=True
    )
    gyroscope_resolution: Vector = vector(
        0.0,
        "step of the gyroscope's digital output (1 LSB); 0: none. The largest reading is the "
        "largest whole step within the range",
        unit="rad/s",
        minimum=0.0,
        live=True,
    )
    gyroscope_increment_resolution: Vector = vector(
        0.0,
        "step of the gyroscope's delta angles where sampling is averaged; what rounding leaves is "
        "carried on to the next; 0: exact",
        unit="rad",
        minimum=0.0,
        live=True,
    )


@dataclass(frozen=True)
class AccelerometerParameters:
    """Errors of the accelerometer."""

    accelerometer_noise_density: Vector = vector(
        0.0,
        "white noise of the accelerometer, continuous time, two-sided: the variance of a sample is "
        "density^2 * rate; a data sheet's one-sided density D is D / sqrt(2) here",
        unit="m/s^2/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    accelerometer_random_walk: Vector = vector(
        0.0,
        "random walk of the accelerometer's bias, continuous time",
        unit="m/s^3/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    accelerometer_gauss_markov_sigma: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the accelerometer: its stationary standard deviation",
        unit="m/s^2",
        minimum=0.0,
        live=True,
    )
    accelerometer_gauss_markov_density: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the accelerometer: the noise that drives it "
        "(as in RotorS)",
        unit="m/s^3/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    accelerometer_correlation_time: Vector = vector(
        0.0, "correlation time of the accelerometer's Gauss-Markov bias", unit="s", minimum=0.0
    )
    accelerometer_bias_instability: Vector = vector(
        0.0,
        "bias instability B of the accelerometer: 1/f noise of two-sided density "
        "B^2 / (2 pi f); the flat Allan deviation is 0.664 B",
        unit="m/s^2",
        minimum=0.0,
        live=True,
    )
    accelerometer_rate_ramp: Vector = vector(
        0.0, "steady drift of the accelerometer's bias", unit="m/s^3", live=True
    )
    accelerometer_bias: Vector = vector(
        0.0, "constant bias of the accelerometer", unit="m/s^2", live=True
    )
    accelerometer_turn_on_bias_sigma: Vector = vector(
        0.0,
        "standard deviation of the accelerometer's bias from run to run, drawn from the seed",
        unit="m/s^2",
        minimum=0.0,
    )
    accelerometer_turn_on_scale_sigma: Vector = vector(
        0.0,
        "standard deviation of the accelerometer's scale from run to run, drawn from the seed",
        unit="1",
        minimum=0.0,
    )
    accelerometer_scale_misalignment: Matrix = matrix(
        IDENTITY_MATRIX,
        "scale and misalignment S of the accelerometer: reading = S x + b",
        live=True,
    )
    accelerometer_scale_error_percent: Vector = vector(
        0.0,
        "scale error of the accelerometer, instead of the matrix: the diagonal of S - I",
        unit="%",
        live=True,
    )
    accelerometer_misalignment_percent: tuple[float, ...] = numbers(
        NO_CROSS_AXIS,
        "cross-axis terms of the accelerometer, instead of the matrix: xy, xz, yx, yz, zx, zy of S",
        unit="%",
        group=6,
        live=True,
    )
    accelerometer_quadratic: Vector = vector(
        0.0,
        "second-order non-linearity of the accelerometer: q x^2",
        unit="1/(m/s^2)",
        live=True,
    )
    accelerometer_temperature_bias: tuple[float, ...] = numbers(
        (),
        "bias polynomial of the accelerometer: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="m/s^2/K^(k+1)",
        group=3,
        live=True,
    )
    accelerometer_temperature_scale: tuple[float, ...] = numbers(
        (),
        "scale polynomial of the accelerometer: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="1/K^(k+1)",
        group=3,
        live=True,
    )
    accelerometer_temperature_bias_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the accelerometer's linear bias drift with temperature; "
        "sign and size are drawn from the seed and add to temperature_bias",
        unit="m/s^2/K",
        minimum=0.0,
    )
    accelerometer_temperature_scale_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the accelerometer's linear scale drift with temperature; "
        "sign and size are drawn from the seed and add to temperature_scale",
        unit="1/K",
        minimum=0.0,
    )
    accelerometer_misalignment_sigma: Vector = vector(
        0.0,
        "standard deviation over units of each cross-axis term of the accelerometer's axis, "
        "drawn from the seed",
        unit="1",
        minimum=0.0,
    )
    accelerometer_quadratic_sigma: Vector = vector(
        0.0,
        "standard deviation over units of the accelerometer's second-order non-linearity, "
        "drawn from the seed",
        unit="1/(m/s^2)",
        minimum=0.0,
    )
    accelerometer_bandwidth: Vector = vector(
        0.0, "cut-off (-3 dB) of the accelerometer's low-pass; 0: none", unit="Hz", minimum=0.0
    )
    accelerometer_range: Vector = vector(
        0.0,
        "largest specific force of the accelerometer; 0: no limit",
        unit="m/s^2",
        minimum=0.0,
        live=True,
    )
    accelerometer_resolution: Vector = vector(
        0.0,
        "step of the accelerometer's digital output (1 LSB); 0: none. The largest reading is the "
        "largest whole step within the range",
        unit="m/s^2",
        minimum=0.0,
        live=True,
    )
    accelerometer_increment_resolution: Vector = vector(
        0.0,
        "step of the accelerometer's delta velocities where sampling is averaged; what rounding "
        "leaves is carried on to the next; 0: exact",
        unit="m/s",
        minimum=0.0,
        live=True,
    )
