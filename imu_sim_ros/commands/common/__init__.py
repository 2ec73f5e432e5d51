# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every command does: read its arguments, run, end with a status, print tables and JSON.

Sees every room. What is exported is imported when it is first used: ``signals`` costs nothing else.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.commands.common import completion as completion
    from imu_sim_ros.commands.common import loading as loading
    from imu_sim_ros.commands.common import signals as signals
    from imu_sim_ros.commands.common.arguments import add_output_arguments as add_output_arguments
    from imu_sim_ros.commands.common.arguments import (
        add_parameter_arguments as add_parameter_arguments,
    )
    from imu_sim_ros.commands.common.arguments import (
        add_simulation_arguments as add_simulation_arguments,
    )
    from imu_sim_ros.commands.common.arguments import assignment as assignment
    from imu_sim_ros.commands.common.arguments import duration as duration
    from imu_sim_ros.commands.common.arguments import parameter_layers as parameter_layers
    from imu_sim_ros.commands.common.arguments import simulation_layers as simulation_layers
    from imu_sim_ros.commands.common.printing import print_json as print_json
    from imu_sim_ros.commands.common.printing import print_table as print_table
    from imu_sim_ros.commands.common.printing import progress as progress
    from imu_sim_ros.commands.common.printing import stacked as stacked
    from imu_sim_ros.commands.common.program import Formatter as Formatter
    from imu_sim_ros.commands.common.program import Parser as Parser
    from imu_sim_ros.commands.common.program import examples_of as examples_of
    from imu_sim_ros.commands.common.program import main as main
    from imu_sim_ros.commands.common.program import run as run
    from imu_sim_ros.commands.common.streams import open_standard_streams as open_standard_streams
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["completion", "loading", "signals"],
            "arguments": [
                "add_output_arguments",
                "add_parameter_arguments",
                "add_simulation_arguments",
                "assignment",
                "duration",
                "parameter_layers",
                "simulation_layers",
            ],
            "printing": ["print_json", "print_table", "progress", "stacked"],
            "program": [
                "Formatter",
                "Parser",
                "examples_of",
                "main",
                "run",
            ],
            "streams": ["open_standard_streams"],
        },
    )
