# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``make demo``: run the three nodes as separate processes, and count their messages.

The simulator flies a trajectory, the integrator dead-reckons its readings, the recorder writes all
of it into a bag. The numbers printed afterwards come from the bag and from the nodes.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.jobs import demo
from imu_sim_ros.jobs.dead_reckon import plot_named_tracks
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.terminal.text_tables import print_lines
from imu_sim_ros.trajectory.parameters import trajectory_layer

EXAMPLES: Final = """
make demo
python -m imu_sim_ros.commands.demo --imu mpu6000 --duration 10s -o flight --force
"""
_PICTURE: Final = "trajectory.png"
_ARGUMENTS: Final = {
    "--trajectory NAME|FILE": {"default": "lecture", "help": "the motion; default %(default)s"},
    "--imu NAME|FILE": {"default": "lecture", "help": "the sensor; default %(default)s"},
    "--rate HZ": {"default": 200.0, "help": "samples per second; default %(default)s"},
    "--duration TIME": {"default": 20.0, "help": "length of the flight [s]; default %(default)s"},
    "-o --output FOLDER": {
        "type": Path,
        "default": Path("demo_output"),
        "help": "for the bag and the picture; default %(default)s",
    },
    **FORCE,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("demo", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, integrate and record live; then compare, print and draw."""
    layers = {
        "imu.preset": arguments.imu,
        **trajectory_layer(arguments.trajectory),
        "rate": arguments.rate,
        "duration": arguments.duration,
    }
    parameters = load_simulation(layers)
    Body(parameters, read_states)  # a file that cannot be flown is refused before the start
    written = outputs(arguments)
    folder = written.add(arguments.output).path
    with written.stage():
        folder.mkdir()
        _demonstrate(parameters, arguments, folder)
    print(f"bag:     {arguments.output / demo.BAG}\npicture: {arguments.output / _PICTURE}")


def _demonstrate(
    parameters: SimulationParameters, arguments: argparse.Namespace, folder: Path
) -> None:
    """Fly and record into a folder; then print and draw."""
    from imu_sim_ros.plots import style

    print(
        f"simulator, integrator and recorder run for {parameters.duration:g} s "
        f"at {parameters.rate:g} Hz: IMU {arguments.imu}, trajectory {arguments.trajectory}",
        flush=True,
    )
    counts = demo.run_nodes(parameters, folder)
    print_lines([demo.message_table(folder / demo.BAG, counts)])
    tracks = demo.tracks(parameters, folder / demo.BAG)
    print_lines([demo.error_table(tracks, parameters.duration)])
    title = (
        f"Dead reckoning against the truth: sensor {arguments.imu}, "
        f"trajectory {arguments.trajectory}, {parameters.rate:g} Hz, {parameters.duration:g} s"
    )
    style.save(plot_named_tracks(tracks, title), folder / _PICTURE)


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
