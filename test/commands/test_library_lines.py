# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines that libraries write to standard error never reach a user."""

import re
import shutil
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

from imu_sim_ros.commands import generate

CAMERA = [
    *("--camera", "euroc_cam0", "--duration", "0.2s", "--quiet", "--format", "euroc"),
    *("--set", "camera.width=64", "--set", "camera.height=48"),
    *("--set", "camera.intrinsics=[40,40,31.5,23.5]"),
]
START = "import sys; from imu_sim_ros.commands.start import {0}; sys.exit({0}())"


def ran(program, *arguments, code=""):
    """Run a program in a process of its own; return its status and its lines of errors."""
    done = subprocess.run(
        [sys.executable, "-c", code + START.format(program), *map(str, arguments)],
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stderr.splitlines()


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def damaged_image(data, how):
    """Return a PNG of libpng's warnings, or a JPEG of libjpeg's, or what OpenCV logs."""
    cv2 = pytest.importorskip("cv2")
    if how == "profile":
        return data[:33] + chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no profile")) + data[33:]
    if how == "pixels":
        return data[:33] + chunk(b"IDAT", b"x") + data[33:]
    if how == "tiff":
        return b"II*\0" + struct.pack("<IH", 8, 2) + struct.pack("<HHII", 256, 4, 1, 64) + (
            struct.pack("<HHII", 257, 4, 1, 48) + bytes(40)
        )  # fmt: skip
    noise = np.random.default_rng(1).integers(0, 256, (48, 64), dtype=np.uint8)
    jpeg = cv2.imencode(".jpg", noise)[1].tobytes()
    return jpeg[:-2] + bytes(9) + jpeg[-2:] if how == "superfluous" else jpeg[:900] + jpeg[-2:]


@pytest.fixture(name="images", scope="module")
def images_fixture(tmp_path_factory):
    """Return a folder with images."""
    path = tmp_path_factory.mktemp("images") / "set"
    assert generate.main(["-o", str(path), *CAMERA]) == 0
    return path


EACH = """
import shlex, sys
from imu_sim_ros.commands.start import imu_sim
for line in sys.stdin:
    sys.argv[1:] = shlex.split(line)
    print(f"status {imu_sim()}", file=sys.stderr, flush=True)
"""


@pytest.mark.parametrize("output", ["o.mcap", "o"])
def test_images_that_libraries_complain_about(tmp_path, images, output):
    """One process converts a set of each kind, and says the status after what came of it."""
    statuses = {"profile": 0, "superfluous": 0, "pixels": 2, "tiff": 2, "cut": 2}
    for how in statuses:
        shutil.copytree(images, tmp_path / how / "set")
        for path in (tmp_path / how / "set").glob("cam0/data/*"):
            path.write_bytes(damaged_image(path.read_bytes(), how))
    form = "--format euroc" if output == "o" else ""
    calls = [f"convert_bag {how}/set -o {how}/{output} {form}\n" for how in statuses]
    done = subprocess.run(
        [sys.executable, "-c", EACH],
        input="".join(calls),
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    *parts, end = re.split(r"^status (\d)\n", done.stderr, flags=re.MULTILINE)
    assert (done.returncode, end) == (0, "")
    assert dict(zip(statuses, map(int, parts[1::2]), strict=True)) == statuses
    for (how, status), printed in zip(statuses.items(), parts[::2], strict=True):
        lines = printed.splitlines()
        assert len(lines) == (1 if status else 0), (how, lines)
        assert all(line.startswith("convert_bag: ") for line in lines), (how, lines)


WARNING = """
import importlib.abc, sys
class Loud(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "imu_sim_ros.navigation.evaluation":
            import warnings
            warnings.warn("invalid value encountered in divide", RuntimeWarning)
sys.meta_path.insert(0, Loud())
"""


def test_warnings_of_python(tmp_path, monkeypatch):
    """Warnings name lines of source; developers ask for them by PYTHONWARNINGS, as the tests do."""
    monkeypatch.delenv("PYTHONWARNINGS")
    bag = tmp_path / "flight.mcap"
    assert generate.main(["-o", str(bag), "--duration", "1s", "--quiet"]) == 0
    assert ran("dead_reckon", bag, "--json", code=WARNING) == (0, [])
    loud = "import warnings; warnings.simplefilter('default'); sys.warnoptions[:] = ['default']; "
    _, lines = ran("dead_reckon", bag, "--json", code=f"{WARNING}\n{loud}")
    assert any("RuntimeWarning: invalid value" in line for line in lines)
