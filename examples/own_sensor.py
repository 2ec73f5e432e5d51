# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sensor of one's own, a sonar altimeter, with parameters, truth, topics and a table.

With an entry point "sonar = own_sensor:SENSOR" of the group imu_sim_ros.sensors in another package:
generate -o flight.mcap --set sensors=[sonar], simulator --sensors "[sonar]". In a script,
register_sensor(SENSOR) does without one.
"""

from dataclasses import dataclass

import numpy as np

from imu_sim_ros import register_sensor, simulate
from imu_sim_ros.bags.messages.encode import VECTOR3_STAMPED
from imu_sim_ros.core import gate, rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.parameters.kinds import number
from imu_sim_ros.sensors.declaration import Sensor, SensorReadings, topic
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.parameters import SensorParameters


@dataclass(frozen=True)
class SonarParameters(SensorParameters):
    """Rate, stamps, losses, frame and mount are inherited."""

    rate: float = number(10.0, "pings per second", unit="Hz", minimum=0.01, maximum=100.0)
    noise: float = number(0.02, "of a range, one sigma", unit="m", minimum=0.0, live=True)
    bias_sigma: float = number(0.0, "of a constant error, drawn from the seed", unit="m")
    ground: float = number(-10.0, "height of the ground in the world", unit="m")


@dataclass(frozen=True, repr=False)
class SonarReadings(SensorReadings):
    """Readings of the sonar and their truth: the attribute ``sonar`` of a flight."""

    range: Array  # (n,) as read [m]
    ideal: Array  # (n,) [m]
    bias: Array  # (n,) [m]


class Sonar(SensorModel):
    """The model: motion in, readings and their truth out."""

    def __init__(self, mounted, t0_ns, other_models):
        super().__init__(mounted, t0_ns)
        self.noise = self.stream("noise")  # a random stream of its own
        self.bias = self.parameters.bias_sigma * self.stream("bias").normal()

    def measure(self, t, world):
        """Return the readings first, then their truth."""
        motion = world.motion(t)
        height = self.position(motion)[:, 2] - self.parameters.ground
        ideal = height / rotation.to_matrix(self.attitude(motion))[:, 2, 2]  # along the beam
        bias = np.full(len(t), self.bias)
        noise = self.parameters.noise * self.noise.standard_normal(len(t))
        return {"range": ideal + bias + noise, "ideal": ideal, "bias": bias}


DOWN = np.array([0.0, 0.0, -1.0])  # messages hold vectors from the sonar to the ground
VECTOR = (VECTOR3_STAMPED, "Vector3StampedEncoder")
HEADERS = {"csv": "timestamp,range", "euroc": "#timestamp [ns],range [m]"}
SENSOR = Sensor(
    *("sonar", "sonar", SonarParameters, Sonar),
    topics=(
        topic("sonar/beam", *VECTOR, lambda sonar, rows, _: [sonar.range[rows, None] * DOWN]),
        topic("ground_truth/sonar", *VECTOR, lambda r, n, _: [r.ideal[n, None] * DOWN], truth=True),
    ),
    table=Table("sonar", "Sonar", gate.POSITION, HEADERS, VECTOR3_STAMPED, "sonar/beam"),
    values=lambda sonar: sonar.range[:, None],
    readings=SonarReadings,
    text="sonar altimeter: the distance to level ground along -z",
)

if __name__ == "__main__":
    register_sensor(SENSOR)
    print(simulate(trajectory="figure_eight", duration=10, sensors=["sonar"]).sonar)
