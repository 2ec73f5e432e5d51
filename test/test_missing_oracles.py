# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An oracle that is missing is a failure in CI, and a skip elsewhere; the order of the files."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

# The run on the oldest versions has no oracles on purpose.
pytestmark = pytest.mark.ros

CONFTEST = Path(__file__).with_name("conftest.py")
TESTS = """
import pytest

def test_oracle():
    pytest.importorskip("an_oracle_that_is_not_there")

def test_flight():
    pytest.skip("no recorded poses in euroc.csv")

@pytest.mark.xfail(strict=True)
def test_known():
    assert False
"""


@pytest.mark.parametrize(
    ("ci", "line"), [("1", "1 failed, 1 skipped, 1 xfailed"), ("", "2 skipped, 1 xfailed")]
)
def test_a_missing_oracle_fails_in_ci(ci, line, tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text(encoding="utf-8"))
    (tmp_path / "test_it.py").write_text(TESTS)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_it.py"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "IMU_SIM_CI": ci},
    )
    assert line in done.stdout
    left_out = re.findall("Not tested here: .*", done.stdout)
    flights = "flights of EuRoC and KAIST (1 test; test/data/recorded/README.md)"
    libraries = "other libraries' judgement (1 test; pip install -r .ci/requirements-test.txt)"
    assert left_out == ["Not tested here: " + ", ".join([flights] if ci else [libraries, flights])]
    assert ("an_oracle_that_is_not_there" in done.stdout) == bool(ci)


def test_the_files_that_begin_first_exist(pytestconfig):
    longest = pytestconfig.pluginmanager.get_plugin(str(CONFTEST)).LONGEST
    assert longest
    assert not [path for path in longest if not (CONFTEST.parents[1] / path).is_file()]
