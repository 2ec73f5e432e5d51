# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robustness figures of the manual, measured with real nodes.

``python test/fuzz/held.py [ROUNDS]`` kills recorders, sets every parameter of a running simulator
to hostile values, and ends programs by signals; it says what each cost. Exit status 1: a value
ended the simulator, a program showed a traceback, or something was left behind.
"""

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parent))
import processes

CONTAINERS: Final = (("mcap", "x"), ("sqlite3", "x"), ("ros1", "x.bag"))
VALUES: Final = (
    *(float("nan"), float("inf"), -1e308, 1e308, -1.0, 0.0, 10**15, -1, True, "", "x", "nan"),
    *([], [float("nan")] * 3, [1e308] * 3, [1.0], ["x"], [True]),
)
DELAYS: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0)


def start(program: str, arguments: list[str], place: Path, environment: dict[str, str]) -> Any:
    """Start a program in a group of its own."""
    return subprocess.Popen(
        [*processes._start_of(program), *arguments],
        cwd=place,
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        preexec_fn=processes._limit,
    )


def killed_recorders(rounds: int, place: Path) -> dict[str, float]:
    """Kill recorders of every container; return by how much [s] the recovered bag is too short."""
    domain, dice = processes.Domain(), random.Random(1)
    environment = domain.environment()
    simulator = start("simulator", ["--rate", "400"], place, environment)
    lost: dict[str, float] = {}
    try:
        for k in range(rounds):
            for storage, name in CONTAINERS:
                folder = place / f"{storage}_{k}"
                folder.mkdir()
                recorder = start(
                    "recorder", ["-o", name, "--storage", storage], folder, environment
                )
                time.sleep(4.0 + 2.0 * dice.random())
                recorder.kill()
                at_s = time.time()
                recorder.wait()
                files = sorted(path.name for path in folder.iterdir())
                done = subprocess.run(
                    [*processes._start_of("convert_bag"), "--recover", files[0], "-o", "whole.mcap",
                     "--json"],
                    cwd=folder, capture_output=True, text=True, check=True,
                )  # fmt: skip
                last_s = json.loads(done.stdout)["last_stamp_ns"] * 1e-9
                lost[storage] = max(lost.get(storage, 0.0), at_s - last_s)
    finally:
        simulator.terminate()
        simulator.wait()
    return lost


def hostile_parameters() -> dict[str, int]:
    """Set every parameter of a simulator to every value; count refusals, and samples after it."""
    simulator = processes.Simulator()
    os.environ.update(simulator.domain.environment())
    import rclpy
    from rcl_interfaces.srv import ListParameters, SetParameters
    from rclpy.parameter import Parameter
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("held")
    came = [0]
    node.create_subscription(Imu, "imu/data_raw", lambda _: came.__setitem__(0, came[0] + 1), 100)

    def called(kind: Any, name: str, request: Any) -> Any:
        client = node.create_client(kind, f"simulator/{name}")
        assert client.wait_for_service(60.0)
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=60.0)
        node.destroy_client(client)
        return future.result()

    names = called(ListParameters, "list_parameters", ListParameters.Request()).result.names
    counts = Counter(parameters=len(names))
    for name in names:
        if name == "autostart":
            continue
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg() for value in VALUES]
        )
        results = called(SetParameters, "set_parameters", request).results
        counts["values"] += len(results)
        counts["refused"] += sum(not response.successful for response in results)
    came[0], end = 0, time.monotonic() + 60.0
    while came[0] < 50 and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    counts["samples after all of them"] = came[0]
    rclpy.shutdown()
    counts["status"] = simulator.end()
    return dict(counts)


def signals(rounds: int, place: Path) -> dict[str, int]:
    """End programs by signals to their groups at any time; count what they leave."""
    folder = place / "inputs"
    folder.mkdir()
    (folder / "plan.yaml").write_text(
        "name: plan\nseeds: 50\nparameters: {rate: 50.0, duration: 5.0, imu: perfect}\n"
    )
    subprocess.run(
        [*processes._start_of("generate"), "-o", str(folder / "none.mcap"), "--duration", "60s",
         "--quiet"],
        check=True,
    )  # fmt: skip
    dice, counts = random.Random(2), Counter()
    environment = processes.Domain().environment()
    programs = [
        startable_program
        for startable_program in processes.startable(folder)
        if "cameras" not in " ".join(startable_program[1])
    ]
    for k in range(rounds):
        program, arguments = programs[k % len(programs)]
        sent, delay = dice.choice(processes.SIGNALS), dice.choice(DELAYS)
        with tempfile.TemporaryDirectory() as name:
            process = start(program, arguments, Path(name), environment)
            time.sleep(delay)
            if process.poll() is None:
                os.killpg(process.pid, sent)
                counts["ended by a signal"] += 1
            output = process.communicate(timeout=processes.LONGEST_S)[0].decode("utf-8", "replace")
            ours, of_python = processes.told(output)
            counts["tracebacks"] += ours
            counts["tracebacks of the interpreter's own start"] += of_python
            time.sleep(0.5)
            survivors = _group(process.pid)
            counts["processes left"] += bool(survivors)
            parts = [path.name for path in Path(name).rglob(".*") if path.name != ".lock"]
            counts["files left"] += len(parts)
            if parts or survivors or ours:
                print(program, sent.name, delay, parts, survivors, output[-300:])
    return {"runs": rounds, **counts}


def _group(group: int) -> list[str]:
    """Return the command lines of the processes of a group."""
    members = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            line = (place / "cmdline").read_text().replace("\0", " ")
            if line and os.getpgid(int(place.name)) == group:  # a zombie has none
                members.append(line)
        except (OSError, ProcessLookupError):
            continue
    return members


def main(rounds: int = 5) -> int:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        for storage, lost in killed_recorders(rounds, place).items():
            print(f"kill -9 of a recorder, {storage}: at most {lost:.2f} s of {rounds} lost")
        of_signals = signals(20 * rounds, place)
    of_parameters = hostile_parameters()
    for what, counts in (("parameters", of_parameters), ("signals", of_signals)):
        print(what + ": " + ", ".join(f"{value} {key}" for key, value in counts.items()))
    bad = [of_signals["tracebacks"], of_signals["processes left"], of_signals["files left"]]
    return int(
        any(bad) or of_parameters["status"] != 0 or not of_parameters["samples after all of them"]
    )


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
