"""``generate``: parameters in, a bag or a dataset out, as fast as the machine can."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from imu_sim_ros.bags.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.commands import common
from imu_sim_ros.config.simulation import load_simulation
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.rotation import rotate_inverse
from imu_sim_ros.stream import Simulation


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    result = common.Parser(prog="generate", description=__doc__)
    common.add_simulation_arguments(result)
    result.add_argument("-o", "--output", required=True, type=Path, help="bag to write")
    result.add_argument("--storage", choices=("mcap", "sqlite3"), default="mcap")
    result.add_argument("--imu-only", action="store_true", help="no ground truth")
    common.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    arguments = parser().parse_args(argv)
    return common.run("generate", lambda: generate(arguments))


def generate(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    started = time.perf_counter()
    parameters = load_simulation(*common.simulation_layers(arguments))
    simulation = Simulation(parameters)
    if simulation.total is None:
        raise ConfigurationError("duration = 0: this trajectory has no end; give --duration")
    storage = "ros1" if arguments.output.suffix == ".bag" else arguments.storage
    counts = {"imu/data_raw": 0} if arguments.imu_only else {"imu/data_raw": 0, "ground_truth/odom": 0}
    with open_writer(arguments.output, storage) as writer:
        imu = ImuEncoder(parameters.imu_frame, writer.encoding)
        odometry = OdometryEncoder(parameters.world_frame, parameters.body_frame, writer.encoding)
        topics = {
            name: writer.add_topic(f"/{name}", IMU if name.startswith("imu") else ODOMETRY)
            for name in counts
        }
        for block in simulation.blocks():
            rows = block.delivered
            t_ns = block.t_ns[rows]
            messages = imu.encode(t_ns, block.gyro[rows], block.accel[rows])
            writer.write(topics["imu/data_raw"], t_ns, messages)
            counts["imu/data_raw"] += len(rows)
            if "ground_truth/odom" in topics:
                motion = block.motion
                messages = odometry.encode(
                    block.true_t_ns,
                    motion.position,
                    motion.q_wb,
                    rotate_inverse(motion.q_wb, motion.velocity),
                    motion.angular_velocity,
                )
                writer.write(topics["ground_truth/odom"], block.true_t_ns, messages)
                counts["ground_truth/odom"] += len(messages)
    result = {
        "output": str(arguments.output),
        "messages": counts,
        "samples": simulation.total,
        "wall_s": time.perf_counter() - started,
        "bytes": sum(p.stat().st_size for p in _files(arguments.output)),
    }
    if arguments.json:
        common.print_json(result)
    elif not arguments.quiet:
        print(f"{arguments.output}: {counts}")


def _files(path: Path) -> list[Path]:
    return [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]


if __name__ == "__main__":
    sys.exit(main())
