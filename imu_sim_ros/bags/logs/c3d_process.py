# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Process that reads a C3D file with ezc3d and writes its arrays to a folder.

ezc3d ends its process on some malformed files (``std::terminate``), so it has one of its own:
``python -m imu_sim_ros.bags.logs.c3d_process FILE FOLDER``. It prints why a file is not read.
"""

import resource
import sys
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.terminal.json_text import json_text

ARRAYS: Final = ("points", "rotations")
"""Names of the arrays, NAME.npy each: (4, m, n) and (4, 4, m, n)."""
PARAMETERS: Final = "parameters.json"
"""Name of the file of parameters: lists of values by group and name."""
_GROUPS: Final = ("POINT", "ROTATION")
MEMORY = 24
"""Memory that reading takes, in sizes of the file."""
_LEAST_MEMORY: Final = 2 << 30
"""Memory that the process may have for small files [bytes]."""


def main(path: str, folder: str) -> int:
    """Write arrays and parameters; return 2 after a line if the file cannot be read."""
    import ezc3d

    # A malformed file may state any number of frames.
    limit = _LEAST_MEMORY + 2 * MEMORY * Path(path).stat().st_size
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
    try:
        file = ezc3d.c3d(path)
        parameters = {
            group: {
                name: np.ravel(entry["value"]).tolist()
                for name, entry in file["parameters"].get(group, {}).items()
                if "value" in entry
            }
            for group in _GROUPS
        }
        for name in ARRAYS:
            np.save(Path(folder, f"{name}.npy"), np.asarray(file["data"][name], np.float64))
    except Exception as error:  # whatever the library raises for malformed bytes
        print(" ".join(str(error).split()) or type(error).__name__)
        return 2
    Path(folder, PARAMETERS).write_text(json_text(parameters), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
