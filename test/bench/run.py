# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run every benchmark below this folder, one after another, each in a process of its own.

make bench                                    all of them
.venv/bin/python test/bench/run.py bags live  some of them
"""

import argparse
import os
import platform
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def main() -> int:
    """Run the named benchmarks, or all; return the number that failed."""
    found = sorted(FOLDER.rglob("bench_*.py"))
    scripts = {path.stem.removeprefix("bench_"): path for path in found}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"out of {', '.join(scripts)}")
    names = parser.parse_args().names or list(scripts)
    unknown = [name for name in names if name not in scripts]
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(scripts)}")
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores", flush=True)
    root = FOLDER.parents[1]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    failed = 0
    for name in names:
        print(f"\n=== {name}", flush=True)
        command = [sys.executable, str(scripts[name])]
        failed += bool(subprocess.run(command, cwd=root, env=environment, check=False).returncode)
    return failed


if __name__ == "__main__":
    sys.exit(main())
