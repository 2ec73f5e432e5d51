# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans and runs of campaigns, in this process and in others."""

import json
import os
import subprocess

import pytest
import yaml
from programs import program

from imu_sim_ros.commands.campaign import main


@pytest.fixture
def plan_file(tmp_path):
    """Return a function that writes a plan and returns its path."""

    def write(name="plan.yaml", **content):
        base = {"parameters": {"rate": 100.0, "duration": 2.0, "imu": "adis16448"}, "seeds": 3}
        path = tmp_path / name
        path.write_text(yaml.safe_dump({**base, **content}), encoding="utf-8")
        return path

    return write


@pytest.fixture
def start():
    """Return a function that starts the command in a process of its own."""
    started = []

    def begin(*arguments, **options):
        process = subprocess.Popen(
            [*program("campaign"), *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **{"env": {**os.environ, "COLUMNS": "160"}, **options},
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait()


@pytest.fixture
def campaign(capsys):
    """Return a function that runs the command to its end: status, result, lines of complaint.

    With one worker all is done in this process, unless the arguments say otherwise.
    """

    def run(*arguments):
        capsys.readouterr()
        workers = () if {"--workers", "--scheduler"} & set(arguments) else ("--workers", "1")
        status = main([*map(str, arguments), *map(str, workers), "--json", "--no-report"])
        stdout, stderr = capsys.readouterr()
        return status, json.loads(stdout) if stdout else None, stderr.splitlines()

    return run
