# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Python files that no package holds, as modules: examples, launch files, benchmarks."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any


def load_script(path: Path, name: str | None = None) -> Any:
    """Return a Python file as a new module, run but not as the main program.

    As for a script, the files next to it can be imported while it runs.

    :param name: name of the module, under which it also stands in ``sys.modules``, where data
        classes look for it; default the file's.
    """
    spec = spec_from_file_location(name or path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module: ModuleType = module_from_spec(spec)
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module
