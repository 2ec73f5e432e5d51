# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Entry points of the nodes: signals are watched before anything slow is imported."""

import sys
from functools import partial

from imu_sim_ros.nodes import signals
from imu_sim_ros.terminal import startup


def _run(name: str) -> int:
    """Run a node and end the process with its status."""
    startup.open_standard_streams()  # else the watch's pipe would take the place of a closed one
    signals.watch(is_final=True)
    status: int | None = startup.load("imu_sim_ros.nodes.help").answer_requests(name, sys.argv[1:])
    if status is not None:
        return status
    try:
        node = startup.load(f"imu_sim_ros.nodes.{name}.node")
    except ModuleNotFoundError as error:
        print(f"{name}: {startup.needs_ros(error)}", file=sys.stderr)
        return 2
    return int(node.main())


simulator = partial(_run, "simulator")
integrator = partial(_run, "integrator")
error_model = partial(_run, "error_model")
recorder = partial(_run, "recorder")
