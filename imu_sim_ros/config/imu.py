"""Parameters of the IMU: every error of the chain, each off at zero."""

from dataclasses import dataclass

from imu_sim_ros.config.parameter import ZERO_VECTOR, Vector, text, vector


@dataclass(frozen=True)
class ImuParameters:
    """One IMU; names and units of the noise are kalibr's."""

    preset: str = text("lecture", "file in config/imus, or a path, to start from")
    gyroscope_noise_density: Vector = vector(
        ZERO_VECTOR,
        "white noise of the gyroscope, continuous time",
        unit="rad/s/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    gyroscope_random_walk: Vector = vector(
        ZERO_VECTOR,
        "random walk of the gyroscope's bias, continuous time",
        unit="rad/s^2/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    accelerometer_noise_density: Vector = vector(
        ZERO_VECTOR,
        "white noise of the accelerometer, continuous time",
        unit="m/s^2/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
    accelerometer_random_walk: Vector = vector(
        ZERO_VECTOR,
        "random walk of the accelerometer's bias, continuous time",
        unit="m/s^3/sqrt(Hz)",
        minimum=0.0,
        live=True,
    )
