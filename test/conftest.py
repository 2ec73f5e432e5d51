# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distribution of the tests over processes, and tests that a run of CI may skip."""

import gc
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

MAY_BE_MISSING = {
    "no recorded poses in": ("flights of EuRoC and KAIST", "test/data/recorded/README.md"),
    "the launch package comes with": ("launch files with ROS 2's launch", "source ROS 2"),
    "could not import 'rerun'": ("views", "Python 3.11 or later"),
    "REAL ROS 1 NOT TESTED": ("bags in real ROS 1", "apt install python3-rosbag and its messages"),
}
"""Requirements that CI cannot meet, by a phrase of the skip's reason: (untested part, remedy).
Anything else that a test skips for, an oracle above all, makes it fail where IMU_SIM_CI is set, as
.ci/run does."""
CAN_BE_INSTALLED = {
    "no browser": ("pages in a browser", "apt install chromium chromium-driver"),
    "rnx2rtkp": ("raw GNSS in RTKLIB", "apt install rtklib"),
    "could not import": ("other libraries' judgement", "pip install -r .ci/requirements-test.txt"),
    "pymcap-cli": ("MCAP files in pymcap-cli", "pip install pymcap-cli"),
}
LONGEST = tuple(
    Path("test", name)
    for name in (
        *("test_lint.py", "nodes/simulator/test_cameras.py"),
        *("calibration/test_analysis.py", "test_tutorials.py"),
        *("camera/test_images.py", "test_examples.py"),
        *("nodes/simulator/test_control.py", "recordings/test_policy.py"),
        *("campaign/test_commands.py", "nodes/live/test_recorder_node.py"),
        *("campaign/test_runs.py", "campaign/test_dask.py", "commands/test_allan.py"),
        *("simulation/test_error_model.py", "api/test_twin.py"),
        *("camera/test_bodies.py", "nodes/live/test_integrator_node.py"),
        *("report/test_browser.py", "campaign/test_command_cameras.py"),
        *("campaign/test_common_time.py", "camera/test_places.py"),
        *("calibration/test_estimate.py", "test_recipes.py"),
        *("nodes/integrator/test_sensor.py", "api/test_formats.py"),
        *("nodes/test_error_model_node.py", "bags/test_containers.py"),
        *("report/test_page.py", "api/test_results.py"),
        *("nodes/simulator/test_stream.py", "camera/test_mesh.py"),
        *("commands/generate/test_interrupted_cameras.py",),
        *("examples/test_gtsam_image_vio.py", "nodes/simulator/test_transforms.py"),
        *("test_platforms.py", "nodes/test_launch_handover.py"),
        *("calibration/test_slow_signals.py", "sensor/lidar/test_estimators.py"),
        *("commands/test_view.py", "navigation/test_pyins_filter.py"),
        *("commands/test_library_lines.py",),
    )
)
"""Files that take longest, the longest first."""
_REAL_PROCESSES = (Path("test/nodes"), Path("test/commands/test_demo.py"))
_LAST_WAITING = 0.7
"""The part of all files after which none with real nodes begins."""
_RARE = (20_000, 20, 20)
"""Thresholds of the search for garbage while tests run; Python's are 700, 10, 10."""


def pytest_configure() -> None:
    """Let the programs that tests start be hung up, also if the tests run under nohup.

    A signal that is ignored stays so in them; one with a handler does not. A RuntimeWarning ends
    them, as it ends a test (pyproject.toml): NumPy tells of overflows and invalid values so.
    """
    os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for no garbage meanwhile: a look goes through all tests so far, and finds little.

    Tests and modules live to the end of the run: later looks leave them out. They are rare: cycles
    are few, and a look through all libraries that tests have imported since takes a tenth of a
    second.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(*_RARE)
        gc.enable()


@pytest.fixture
def uncollected() -> Iterator[None]:
    """Leave the garbage collector off while sources are parsed: trees have no cycles."""
    gc.disable()
    yield
    gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Spread files with real nodes, which mostly wait, among those that compute.

    Files go to the processes one by one in this order: all the time some wait and some compute.
    The last part only computes, and in each kind the longest files come first, then those with
    most tests, so that the processes end together.
    """
    tests: dict[Path, list[pytest.Item]] = {}
    for item in items:
        tests.setdefault(item.path, []).append(item)
    kinds: dict[bool, dict[Path, list[pytest.Item]]] = {True: {}, False: {}}
    for full_path, tests_of_file in tests.items():
        path = full_path.relative_to(config.rootpath)
        waits = any(path.is_relative_to(place) for place in _REAL_PROCESSES)
        kinds[waits][path] = tests_of_file
    placed: list[tuple[float, list[pytest.Item]]] = []
    for waits, files in kinds.items():
        share = _LAST_WAITING if waits else 1.0
        ordered = sorted(files, key=lambda path: (_length(path), len(files[path])), reverse=True)
        placed += [
            ((k + 0.5) / len(ordered) * share, files[path]) for k, path in enumerate(ordered)
        ]
    placed.sort(key=lambda entry: entry[0])
    items[:] = [item for _, tests in placed for item in tests]


def _length(path: Path) -> int:
    """Return a number that is larger for a longer one of the longest files; 0 for all others."""
    return len(LONGEST) - LONGEST.index(path) if path in LONGEST else 0


@pytest.fixture(autouse=True)
def signals_as_before() -> Iterator[None]:
    """Give a test's processes the signals that the next test's should find."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def not_tested(reasons: Iterable[str]) -> str:
    """Return a line on what the skipped tests left out, and how to get it; "" if nothing."""
    excused = {**MAY_BE_MISSING, **CAN_BE_INSTALLED}
    counts: dict[tuple[str, str], int] = {}
    for reason in reasons:
        phrase = next((phrase for phrase in excused if phrase in reason), "")
        left_out = excused.get(phrase, ("other", "pytest's summary has the reasons"))
        counts[left_out] = counts.get(left_out, 0) + 1
    parts = [
        f"{what} ({count} test{'s' * (count > 1)}; {how})" for (what, how), count in counts.items()
    ]
    return f"Not tested here: {', '.join(parts)}" if parts else ""


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    return str(report.longrepr[2]) if isinstance(report.longrepr, tuple) else ""


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> Iterator[None]:
    """Say in the last line of a run, below pytest's own, what it left out."""
    yield
    terminal = session.config.pluginmanager.get_plugin("terminalreporter")
    if terminal and (line := not_tested(map(_reason, terminal.stats.get("skipped", [])))):
        terminal.write_line(line)


def may_be_missing(reason: str) -> bool:
    """Return whether a test may be skipped in CI for this reason."""
    return any(phrase in reason for phrase in MAY_BE_MISSING)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Fail a test in CI that is skipped because something is missing that CI can have.

    The run on the oldest supported versions has no oracles on purpose.
    """
    outcome = yield
    report = outcome.get_result()
    enforced = os.environ.get("IMU_SIM_CI") and not sys.prefix.endswith(".venv-floor")
    if enforced and report.skipped and not hasattr(report, "wasxfail"):
        reason = _reason(report)
        if not may_be_missing(reason):
            report.outcome = "failed"
            report.longrepr = f"{item.nodeid} is skipped in CI: {reason}"
