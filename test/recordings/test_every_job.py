# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every kind of recording through every job that reads: all name the same kinds for one file.

What a job has to name follows from its declaration and from what ``inspect`` finds in the file.
"""

import re
import shlex
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from faults import FAULTS, POSES, STAMPS, saturated

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.records import replace_fields
from imu_sim_ros.inputs.poses import write_tum
from imu_sim_ros.recordings.findings.catalogue import KINDS
from imu_sim_ros.recordings.findings.policy import JOBS, FindingPolicy

RATE, SEED = 240.0, 3
START_S = 1_050_000_000
"""Start of a recording in 2003 [s]: files take its stamps also decades earlier and later."""
ALL_TOLD = FindingPolicy(tells=tuple(KINDS))
TAG = re.compile(r"\[(\w+)\]")


def coarse(readings):
    accel = readings.accel.copy()
    accel[:, 0] = np.random.default_rng(1).choice([-1.0, 1.0], len(readings))
    return replace_fields(readings, accel=accel)


def jittered(readings):
    late = 0.1e9 / RATE * np.random.default_rng(1).standard_normal(len(readings))
    return replace_fields(readings, t_ns=readings.t_ns + late.astype(np.int64))


def paused(readings):
    hour = np.where(np.arange(len(readings)) < len(readings) // 2, 0, 3600 * 10**9)
    return replace_fields(readings, t_ns=readings.t_ns + hour)


MORE = {
    "axis_saturated": saturated,
    "steps_coarse": coarse,
    "stamps_jitter": jittered,
    "samples_lost": lambda r: r.rows(np.r_[0:300, 305 : len(r)]),
    "clock_pause": paused,
    "clean": lambda r: r,
}
READINGS = {**FAULTS, **STAMPS, **MORE}


def write_table(path, readings):
    triads = {"g": readings.gyro, "a": readings.accel}
    names = [f"{letter}{axis}" for letter in triads if triads[letter] is not None for axis in "xyz"]
    rows = np.column_stack([values for values in triads.values() if values is not None])
    lines = [f"{t_ns},{','.join(map(repr, row))}" for t_ns, row in
             zip(readings.t_ns.tolist(), rows.tolist(), strict=True)]  # fmt: skip
    path.write_text("\n".join([",".join(["timestamp", *names]), *lines]) + "\n")


def write_bag(path, readings, truth):
    """Write readings and odometry; a triad that is None is marked as absent."""
    absent, zeros = np.diag([-1.0, 0.0, 0.0]), np.zeros((len(readings), 3))
    with open_writer(path, BagOptions()) as writer:
        topics = (
            writer.add_topic("/imu/data_raw", IMU),
            writer.add_topic("/ground_truth/odom", ODOMETRY),
        )
        covariances = {
            f"{name}_covariance": absent
            for name, values in (("gyro", readings.gyro), ("accel", readings.accel))
            if values is None
        }
        encoder = ImuEncoder("imu_link", writer.encoding, **covariances)
        triads = [zeros if x is None else x for x in (readings.gyro, readings.accel)]
        twist = rotation.rotate_inverse(truth.q_wb, truth.velocity), truth.angular_velocity
        states = OdometryEncoder("odom", "base_link", writer.encoding).encode(
            truth.t_ns, truth.position, truth.q_wb, *twist
        )
        recorded_ns = truth.t_ns[0] + np.arange(len(readings)) * round(1e9 / RATE)
        rows = encoder.pattern(readings.t_ns, *triads)
        writer.write_blocks(
            [Block(topics[0], recorded_ns, rows), Block(topics[1], truth.t_ns, states)]
        )


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", rate=RATE, duration=10, seed=SEED,
        start_time=START_S,
    )  # fmt: skip


def outcome(job):
    """Return whether a job refuses, and the kinds that its lines name."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        refused, lines = False, []
        try:
            lines += getattr(job(), "warnings", ())
        except (ConfigurationError, InputError) as error:
            refused, lines = True, [*error.problems]
    lines += [str(entry.message) for entry in caught]
    return refused, {kind for line in lines for kind in TAG.findall(line) if kind in KINDS}


def page(path, folder):
    """Return the kinds in the findings of a page."""
    text = ims.report(path, folder / "page.html", force=True).output.read_text()
    return SimpleNamespace(warnings=[f"[{kind}]" for kind in KINDS if f'"{kind}"' in text])


def of_table(path):
    return path.suffix == ".csv"


def jobs_of_readings(flight, folder):
    """Return policy and call by job; each takes a path."""
    count = len(flight.readings)
    degrees = np.linspace(20.0, 40.0, count)

    def temperature(path):
        rows = len(ims.read_readings(path))
        return ims.calibrate_temperature(path, rates=[1.0], temperature=degrees[:rows])

    def dead_reckon(path):
        return ims.dead_reckon(path, initial="level" if of_table(path) else "truth")

    noisy, converted = folder / "noisy.mcap", folder / "converted"
    return {
        "allan": ("allan", lambda path: ims.allan(path)),
        "six_position": ("calibrate", ims.calibrate_six_position),
        "turntable": ("calibrate", lambda path: ims.calibrate_turntable(path, rates=[1.0])),
        "temperature": ("calibrate temperature", temperature),
        "dead_reckon": ("dead_reckon", dead_reckon),
        "preintegrate": ("preintegrate", lambda path: ims.preintegrate(path, every=0.5)),
        "twin": ("twin", lambda path: ims.twin(path, flight.truth.rows(slice(400)))),
        "add_errors": (
            "add_errors, error_model",
            lambda path: ims.add_errors_to_file(path, noisy, imu="perfect", force=True),
        ),
        "convert": (
            "convert_bag",
            lambda path: ims.convert(
                path, converted.with_suffix(".mcap" if of_table(path) else ".csv"), force=True
            ),
        ),
        "report": (None, lambda path: page(path, folder)),
        "copy": (
            "convert_bag, bag to bag",
            lambda path: ims.convert(path, folder / "copy.bag", force=True),
        ),
    }


def wrong_outcomes(path, sources, jobs):
    """Return the jobs that name other kinds than ``inspect`` and their declarations."""
    inspected = [finding.kind for finding in ims.inspect(path).findings if sources(finding.source)]
    wrong = []
    for name, (declared, job) in jobs.items():
        policy = ALL_TOLD if declared is None else JOBS[declared]
        refusals = {kind for kind in inspected if policy.action(kind) == "refuses"}
        expected = refusals or {kind for kind in inspected if policy.action(kind)}
        refused, kinds = outcome(lambda job=job: job(path))
        if name == "allan":  # the body moves
            kinds -= {"motion_at_rest"}
        if name == "evaluate, estimate":  # it is compared at its stamps, however few they are
            expected -= {"poses_sparse"}
        if kinds != expected or (refusals and not refused):
            wrong.append((name, sorted(kinds), sorted(expected), refused))
    return inspected, wrong


@pytest.mark.parametrize("kind", READINGS)
def test_all_jobs_name_the_same_kinds_of_readings_in_a_file(flight, tmp_path, kind):
    readings = READINGS[kind](flight.readings)
    # Each job sees tables and bags, of different kinds.
    path = tmp_path / f"imu.{('csv', 'mcap')[list(READINGS).index(kind) % 2]}"
    if of_table(path):
        write_table(path, readings)
    else:
        write_bag(path, readings, flight.truth)
    jobs = jobs_of_readings(flight, tmp_path)
    if list(READINGS).index(kind) % 4:
        del jobs["report"]  # which inspects the file itself
    if of_table(path):
        del jobs["copy"]  # which is one from bag to bag
    kinds, wrong = wrong_outcomes(path, lambda source: "odom" not in source, jobs)
    assert not wrong, wrong
    assert (kind in kinds) == (kind != "clean")


def test_all_jobs_refuse_two_frames_on_a_topic(flight, tmp_path):
    path, readings = tmp_path / "two.mcap", flight.readings
    with open_writer(path, BagOptions()) as writer:
        topic = writer.add_topic("/imu/data_raw", IMU)
        for frame in ("left", "right"):
            encoder = ImuEncoder(frame, writer.encoding)
            rows = encoder.pattern(readings.t_ns, readings.gyro, readings.accel)
            writer.write_blocks([Block(topic, readings.t_ns, rows)])
    jobs = jobs_of_readings(flight, tmp_path)
    del jobs["report"], jobs["copy"]  # the first tells it, the second keeps the messages
    del jobs["temperature"]  # which counts the readings
    for name, (_, job) in jobs.items():
        assert outcome(lambda job=job: job(path)) == (True, {"frames_mixed"}), name


TRACKS = {
    **POSES,
    "poses_jump": lambda s: replace_fields(
        s, position=s.position + np.where(np.arange(len(s)) < 1200, 0.0, 1.0)[:, None]
    ),
    "poses_outlying": lambda s: replace_fields(
        s, position=s.position + np.where(np.arange(len(s)) == 700, 0.5, 0.0)[:, None]
    ),
    **{
        kind: STAMPS[kind]
        for kind in ("clock_reset", "clock_change", "stamps_stray", "stamps_late")
    },
    "messages_repeated": STAMPS["messages_repeated"],
    "clean": lambda s: s,
}
"""Poses with a fault, by the kind of its finding."""


def jobs_of_tracks(flight, folder, truth):
    """Return policy and call by job; each takes the path of poses.

    :param truth: path of the true poses.
    """
    written = folder / "converted.txt"
    return {
        "read_states": ("read_states", ims.read_states),
        "evaluate, estimate": ("evaluate", lambda path: ims.evaluate(path, truth, max_gap=5.0)),
        "evaluate, truth": ("evaluate", lambda path: ims.evaluate(truth, path, max_gap=5.0)),
        "simulate": (
            "generate, simulator",
            lambda path: ims.simulate(trajectory=path, rate=50, duration=1),
        ),
        "twin": ("twin", lambda path: ims.twin(flight.readings.rows(slice(500)), path)),
        "convert": ("convert_bag", lambda path: ims.convert(path, written, force=True)),
        "campaign": ("campaign", lambda path: run_of_campaign(path, folder)),
        "report": (None, lambda path: page(path, folder)),
    }


def run_of_campaign(path, folder):
    """Return the findings of a run whose estimate is a file."""
    parameters = {"trajectory.type": "circle", "rate": 100.0, "duration": 30.0}
    plan_path = folder / "plan.yaml"
    plan_path.write_text(
        yaml.safe_dump(
            {
                "parameters": {**parameters, "imu": "bmi088", "start_time": float(START_S)},
                "seeds": 1,
                "estimators": {"copy": {"command": f"cp {shlex.quote(str(path))} {{estimate}}"}},
            }
        ),
        encoding="utf-8",
    )
    plan = load_plan(plan_path)
    (row,) = CellRuns(plan, next(plan.cells())).rows([SEED], ["copy"], folder / "campaign")
    if row["status"] != "done":
        raise InputError(row["status"])
    return SimpleNamespace(warnings=[row["findings"] or ""])


@pytest.fixture(scope="module")
def circle():
    """Return a flight with all directions of travel."""
    return ims.simulate(
        imu="bmi088", trajectory="circle", rate=100, duration=30, seed=SEED, start_time=START_S
    )


@pytest.mark.parametrize("kind", TRACKS)
def test_all_jobs_name_the_same_kinds_of_poses_in_a_file(circle, tmp_path, kind):
    path, truth = tmp_path / "poses.tum", tmp_path / "truth.tum"
    poses = replace_fields(circle.truth, velocity=None, angular_velocity=None)
    write_tum(path, TRACKS[kind](replace_fields(poses, position=poses.position + 0.01)))
    write_tum(truth, poses)
    jobs = jobs_of_tracks(circle, tmp_path, truth)
    kinds, wrong = wrong_outcomes(path, lambda source: True, jobs)
    assert not wrong, wrong
    assert (kind in kinds) == (kind != "clean")
