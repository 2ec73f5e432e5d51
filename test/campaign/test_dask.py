# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real Dask cluster on this machine: scheduler and workers in their own processes, over TCP."""

import contextlib
import gc
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor

import pytest
from programs import PATIENCE, until

from imu_sim_ros.campaigns import engine
from imu_sim_ros.campaigns.results import read_log, read_results
from imu_sim_ros.core.errors import InputError

# Not part of the run on the oldest versions, which has no Dask.
pytestmark = pytest.mark.ros


@contextlib.contextmanager
def another_dashboard():
    """Keep the port of Dask's dashboard busy, unless somebody's already does."""
    with socket.socket() as other_socket:
        with contextlib.suppress(OSError):
            other_socket.bind(("127.0.0.1", 8787))
            other_socket.listen()
        yield


@pytest.fixture
def cluster(tmp_path):
    """Return a function that starts a scheduler and workers; all end with the test."""
    pytest.importorskip("distributed")
    processes = []

    def begin(*arguments):
        log = (tmp_path / f"dask_{len(processes)}.log").open("w")
        process = subprocess.Popen(
            [sys.executable, "-m", *map(str, arguments)],
            stdout=log,
            stderr=subprocess.STDOUT,
            cwd=tmp_path,
            start_new_session=True,
        )
        processes.append(process)
        return process

    def start(workers):
        file = tmp_path / f"scheduler_{len(processes)}.json"
        scheduler = begin(
            *("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", 0),
            *("--no-dashboard", "--scheduler-file", file),
        )
        single_thread = ("--nthreads", 1, "--nworkers", 1, "--no-nanny", "--no-dashboard")
        worker_processes = [
            begin("distributed.cli.dask_worker", "--scheduler-file", file, *single_thread)
            for _ in range(workers)
        ]
        until(lambda: file.exists() and file.stat().st_size)
        return json.loads(file.read_text())["address"], scheduler, worker_processes

    yield start
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def wait_for(path, rows):
    until(lambda: path.exists() and path.read_bytes().count(b"\n") >= rows, f"{rows} rows")


def test_killed_workers_and_schedulers_lose_nothing(plan_file, start, campaign, cluster, tmp_path):
    """The campaign is killed, then a worker, the scheduler: resumed, all runs once, bit for bit."""
    grid = {"trajectory": ["lecture", "circle"]}
    path = plan_file(grid=grid, seeds=5000)
    folder, log = tmp_path / "dask", tmp_path / "dask" / "runs.jsonl"
    address, scheduler, workers = cluster(2)
    options = ("--scheduler", address, "--batch", 5, "--quiet", "--no-report")
    process = start(path, "-o", folder, *options)
    wait_for(log, 10)
    process.kill()
    process.wait()
    lines_before = log.read_bytes().count(b"\n")
    process = start(path, "-o", folder, "--resume", *options)
    wait_for(log, lines_before + 10)
    os.killpg(workers[0].pid, signal.SIGKILL)
    wait_for(log, lines_before + 20)
    os.killpg(scheduler.pid, signal.SIGKILL)
    _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert stderr == (
        "campaign: the connection to the scheduler was lost; continue with --resume\n"
    )
    done = log.read_bytes().count(b"\n")
    assert done >= lines_before + 20
    # A shorter campaign, which has all that is done.
    seeds = max(row["seed"] for row in read_log(log)) + 4
    path = plan_file(grid=grid, seeds=seeds)
    status, result, _ = campaign(path, "-o", folder, "--resume")
    assert (status, result["runs"], result["done"]) == (0, 2 * seeds, 2 * seeds)
    assert log.read_bytes().count(b"\n") == 2 * seeds > done
    embedded = tmp_path / "embedded"
    assert campaign(path, "-o", embedded)[0] == 0
    assert (folder / "results.csv").read_bytes() == (embedded / "results.csv").read_bytes()


def test_a_cluster_that_has_lost_all_its_workers_is_not_waited_for(
    plan_file, campaign, cluster, tmp_path
):
    """The scheduler keeps the tasks; what is done is kept, too."""
    path = plan_file(seeds=5000)
    log = tmp_path / "out" / "runs.jsonl"
    address, _, workers = cluster(1)
    options = ("--scheduler", address, "--worker-timeout", 2, "--batch", 5, "--quiet")

    def kill():
        wait_for(log, 5)
        os.killpg(workers[0].pid, signal.SIGKILL)

    with ThreadPoolExecutor(1) as pool:
        killed = pool.submit(kill)
        status, _, lines = campaign(path, "-o", tmp_path / "out", *options)
        killed.result()
    assert status == 1
    assert lines == ["campaign: the cluster has had no worker for 2 s; continue with --resume"]
    assert log.read_bytes().count(b"\n") >= 5


def test_one_seed_that_kills_its_worker_costs_no_other(plan_file, start, tmp_path):
    """Three seeds in one task: the scheduler blames them all."""
    pytest.importorskip("distributed")
    killer = """sh -c '
if [ {seed} = 1 ]; then kill -KILL $PPID; fi
for t in 1 2 3; do echo "$t 0 0 0 0 0 0 1"; done > estimate.txt
'"""
    estimator = {"command": killer, "align": "none", "coverage": 0.0}
    path = plan_file(seeds=3, estimators={"killer": estimator})
    folder = tmp_path / "out"
    with another_dashboard():
        process = start(
            *(path, "-o", folder, "--dask", "--workers", 1, "--batch", 3, "--quiet", "--no-report"),
            env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
        )
        assert process.communicate(timeout=PATIENCE) == ("", "")
    statuses = [row["status"] for row in read_results(folder)]
    assert statuses.pop(1) == "failed: the worker process died"
    assert statuses == ["done"] * 2


def test_no_scheduler_is_said_in_a_line_and_leaves_nothing(plan_file, campaign, tmp_path):
    pytest.importorskip("distributed")
    status, _, lines = campaign(
        plan_file(), "-o", tmp_path / "a" / "b", "--scheduler", "tcp://127.0.0.1:9"
    )
    assert status == 2
    assert len(lines) == 1
    assert lines[0].startswith("campaign: --scheduler tcp://127.0.0.1:9: ")
    assert not (tmp_path / "a").exists()


WITHOUT = """
import sys
sys.path.append(sys.argv.pop(1))
from distributed.cli.dask_worker import main
main()
"""


def test_workers_that_cannot_run_anything_are_told_before_the_first_run(
    plan_file, campaign, cluster, tmp_path, monkeypatch
):
    """None at all, one without the package, one with another version, one without the program."""
    address, _, _ = cluster(0)
    (file,) = tmp_path.glob("scheduler_*.json")
    options = ("--scheduler-file", file, "--nthreads", "1", "--nworkers", "1", "--no-nanny")
    programs, fake = tmp_path / "bin", tmp_path / "fake" / "imu_sim_ros"
    programs.mkdir()
    fake.mkdir(parents=True)
    (fake / "__init__.py").write_text("__version__ = '0.0.1'")
    program = programs / "my_program"
    program.write_text("#!/bin/sh\nprintf '1 0 0 0 0 0 0 1\\n2 1 0 0 0 0 0 1\\n' > $1\n")
    program.chmod(0o755)
    estimator = {"command": "my_program {estimate}", "coverage": 0.0}
    path = plan_file(seeds=1, align="none", estimators={"a": estimator})
    elsewhere = os.environ["PATH"]

    def complaint(*worker, **environment):
        process = worker and subprocess.Popen(
            [sys.executable, *map(str, worker), *map(str, options)],
            env={**os.environ, "PATH": elsewhere, **environment},
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        folder = tmp_path / f"out_{len(worker)}_{len(environment)}"
        timeout = 300 if worker else 1
        scheduler_options = ("--scheduler", address, "--worker-timeout", timeout, "--quiet")
        complaint_text = "\n".join(campaign(path, "-o", folder, *scheduler_options)[2])
        if process:
            process.kill()
            process.wait()
        assert not folder.exists() or complaint_text == ""
        return complaint_text

    monkeypatch.setenv("PATH", f"{programs}:{elsewhere}")  # of this process, not of the workers
    assert complaint().endswith(f"{address}: no worker has joined within 1 s")
    packages = sysconfig.get_path("purelib")
    assert "imu_sim_ros is not installed there" in complaint("-S", "-c", WITHOUT, packages)
    worker = ("-m", "distributed.cli.dask_worker")
    assert "has imu_sim_ros 0.0.1; this is" in complaint(*worker, PYTHONPATH=str(fake.parent))
    assert "estimators.a.command: my_program: no such program" in complaint(*worker)
    shutil.copy(program, path.parent / "my_program")  # next to the plan, which all machines see
    assert complaint(*worker, LANG="C") == ""


def test_a_client_that_could_not_connect_is_gone_before_another_begins():
    """A client that was collected while the next one began used to wait for ever for a lock."""
    distributed = pytest.importorskip("distributed")
    gc.disable()
    try:
        with pytest.raises(InputError, match="missing port"), engine.client("nowhere", 1):
            pass
        assert not any(isinstance(tracked, distributed.Client) for tracked in gc.get_objects())
    finally:
        gc.enable()
