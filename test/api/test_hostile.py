# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every public function with every argument replaced by what nobody should give.

Only a documented error, or a result, may come of it.
"""

import inspect
import itertools
import math
import signal
import warnings
from decimal import Decimal
from functools import cached_property
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros import sensors
from imu_sim_ros.commands import generate

NAN = float("nan")
PATIENCE = 60.0
"""[s of processor time] A call that takes longer hangs."""


def itself():
    """Return a list that contains itself."""
    result = []
    result.append(result)
    return result


# Made anew for each call: a generator is used up.
VALUES = {
    **{repr(v): lambda v=v: v for v in (None, True, 0, -1, 2.5, NAN, -float("inf"), 1e300, 10**40)},
    **{repr(v): lambda v=v: v for v in ("", "x", "\0", "none.mcap", b"x", Decimal("NaN"), 1j, int)},
    **{repr(v): lambda v=v: v for v in ([], {}, (), set(), [1, 2], [[1], [1, 2]], {1: 2})},
    **{repr(v): lambda v=v: v for v in ({"type": None}, {"preset": []}, {"a": {"b": {}}})},
    "a name of 5000 letters": lambda: "a" * 5000,
    "a missing file": lambda: Path("nowhere") / "none.mcap",
    "a folder": lambda: Path(),
    "an object": object,
    "a function": lambda: lambda t: t,
    "a generator": lambda: (k for k in range(3)),
    "a list of itself": itself,
    "0-d": lambda: np.array(1.0),
    "NaN (3,)": lambda: np.full(3, NAN),
    "NaN (9, 3)": lambda: np.full((9, 3), NAN),
    "NaN (9, 8)": lambda: np.full((9, 8), NAN),
    "zeros (9, 3)": lambda: np.zeros((9, 3)),
    "zeros (9, 8)": lambda: np.zeros((9, 8)),
    "1e300 (9, 4)": lambda: np.full((9, 4), 1e300),
    "empty (0,)": lambda: np.zeros(0),
    "empty (0, 3)": lambda: np.zeros((0, 3)),
    "shape (2, 2, 2)": lambda: np.zeros((2, 2, 2)),
    "stamps in seconds": lambda: np.arange(9) * 0.1,
    "stamps out of order": lambda: np.array([3, 1, 2, 5, 4, 6, 7, 8, 9]),
    "stamps without sign": lambda: np.array([2**63 + 5, 2**64 - 1], dtype=np.uint64),
    "words": lambda: np.array(["x", "y"]),
    "objects": lambda: np.array([None, {}], dtype=object),
    "complex": lambda: np.zeros((9, 3), dtype=complex),
    "dates": lambda: np.array(["2026-01-01"], dtype="datetime64[ns]"),
}


class World:
    """Sound inputs, made once, and a new path for each output."""

    def __init__(self):
        field = {"sensors": ["magnetic_field", "pressure", "orientation"]}
        still = {"imu": "lecture", "trajectory": "static", "rate": 20}
        soak = {"profile": [0, 0, 40, 20, 80, 40, 120, 60], "interpolation": "steps"}
        turns = {"imu": "adis16448", "trajectory": "figure_eight", "duration": 12, "rate": 55}
        self.flight = ims.simulate(trajectory="circle", duration=0.5, rate=40, **field)
        self.rest = ims.simulate(**still, duration=60)
        self.six = ims.simulate(imu="lecture", trajectory="six_position", rate=20)
        self.table = ims.simulate(imu="lecture", trajectory="turntable", rate=20)
        self.tumble = ims.simulate(trajectory="tumble", duration=20, rate=20, **field)
        self.soaked = ims.simulate(**still, duration=160, temperature=soak)
        self.moved = ims.simulate(**turns)
        topics = ("imu/data_raw", "ground_truth/odom", "imu/mag", "imu/data", "imu/pressure")
        self.file = self.flight.save("flight.mcap", topics=topics)
        self.seen = Path("seen.mcap")
        generate_arguments = [
            "--duration",
            "0.1s",
            "--camera",
            "euroc_cam0",
            "--lidar",
            "perfect",
            "--quiet",
        ]
        assert generate.main(["-o", str(self.seen), *generate_arguments]) == 0
        self.stamps = np.arange(9) * 10_000_000
        self.rows = np.arange(27.0).reshape(9, 3)
        self.q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (9, 1))
        self._places = itertools.count()
        self.sdf = Path("model.sdf")
        self.sdf.write_text("<sdf><sensor name='a' type='imu'/></sdf>")
        self.plan = Path("plan.yaml")
        self.plan.write_text(
            "parameters: {rate: 50.0, duration: 0.5, imu: perfect, trajectory: circle}\nseeds: 1\n"
        )

    @cached_property
    def sensor(self):
        return import_module("own_sensor").SENSOR

    @cached_property
    def track(self):
        return ims.dead_reckon(self.flight)

    @property
    def truth(self):
        return self.flight.truth

    @cached_property
    def evaluation(self):
        return ims.evaluate(self.track, self.flight.truth)

    @cached_property
    def inspection(self):
        return ims.inspect(self.file)

    @cached_property
    def noise(self):
        return ims.allan(self.rest, force=True)

    @cached_property
    def calibration(self):
        return ims.calibrate_six_position(self.six)

    @cached_property
    def twin(self):
        return ims.twin(self.moved, self.moved.truth)

    @property
    def model(self):
        return ims.ErrorModel(rate=100)

    @property
    def errormodelbatch(self):
        return ims.ErrorModel(rate=100, count=3)

    @property
    def place(self):
        return {"path": f"out{next(self._places)}"}


SHORT = {"imu": "perfect", "duration": 0.1, "rate": 100.0}
SMALL = {"preset": "euroc_cam0", "width": 32, "height": 24, "intrinsics": [20.0, 20.0, 16.0, 12.0]}
OF_SIMULATION = ["gravity", "start_time", "world_frame", "temperature", "nonsense"]
OF_INTEGRATOR = ["gravity", "level_time", "max_gap", "gyroscope_bias", "nonsense"]
# For each public name a call that is valid, and parameters by name that it takes besides.
VALID = {
    "simulate": (lambda w: SHORT, OF_SIMULATION),
    "blocks": (lambda w: SHORT, OF_SIMULATION),
    "generate": (lambda w: {"output": w.place["path"], **SHORT}, OF_SIMULATION),
    "convert": (lambda w: {"source": w.file, "output": w.place["path"]}, []),
    "read_imu": (lambda w: {"path": w.file}, []),
    "read_odometry": (lambda w: {"path": w.file}, []),
    "read_images": (lambda w: {"path": w.seen}, []),
    "read_points": (lambda w: {"path": w.seen}, []),
    "read_magnetometer": (lambda w: {"path": w.file}, []),
    "read_orientation": (lambda w: {"path": w.file}, []),
    "read_pressure": (lambda w: {"path": w.file}, []),
    "add_errors": (
        lambda w: {"t_ns": w.stamps, "gyro": w.rows, "accel": w.rows, "rate": 100},
        OF_SIMULATION,
    ),
    "add_errors_to_file": (
        lambda w: {"source": w.file, "output": w.place["path"], "rate": 100, "seed": 1},
        OF_SIMULATION,
    ),
    "ErrorModel": (lambda w: {"rate": 100}, OF_SIMULATION),
    "ErrorModelBatch": (lambda w: {"count": 3, "rate": 100}, OF_SIMULATION),
    "errormodelbatch.read": (lambda w: {"t_ns": 5, "gyro": w.rows[:3], "accel": w.rows[:3]}, []),
    "errormodelbatch.read_magnetic_field": (
        lambda w: {"t_ns": 5, "field": np.full((3, 3), 2e-5)},
        [],
    ),
    "errormodelbatch.read_pressure": (lambda w: {"t_ns": 5, "pressure": np.full(3, 1e5)}, []),
    "errormodelbatch.reset": (lambda w: {"mask": [True, False, True]}, []),
    "errormodelbatch.unit": (lambda w: {"k": 1}, []),
    "model.read": (lambda w: {"t_ns": 5, "gyro": w.rows[0], "accel": w.rows[0]}, []),
    "model.read_magnetic_field": (lambda w: {"t_ns": 5, "field": [2e-5, 0.0, -4e-5]}, []),
    "model.read_pressure": (lambda w: {"t_ns": 5, "pressure": 1e5}, []),
    "model.inject": (lambda w: {"kind": "dropout", "value": 0.5}, []),
    "model.update": (lambda w: {}, ["imu", "gravity", "nonsense"]),
    "from_sdf": (lambda w: {"file": w.sdf}, []),
    "dead_reckon": (lambda w: {"readings": w.flight}, OF_INTEGRATOR),
    "evaluate": (lambda w: {"estimate": w.track, "truth": w.flight.truth}, []),
    "allan": (lambda w: {"source": w.rest, "force": True}, []),
    "calibrate_six_position": (lambda w: {"readings": w.six}, []),
    "calibrate_turntable": (lambda w: {"readings": w.table}, []),
    "calibrate_temperature": (lambda w: {"readings": w.soaked}, []),
    "calibrate_magnetometer": (lambda w: {"readings": w.tumble}, []),
    "campaign": (lambda w: {"plan": w.plan, "output": w.place["path"]}, []),
    "register_sensor": (lambda w: {"sensor": w.sensor}, []),
    "report": (lambda w: {"inputs": w.file, "output": w.place["path"]}, []),
    "twin": (lambda w: {"recording": w.moved, "truth": w.moved.truth}, []),
    "preintegrate": (lambda w: {"readings": w.flight, "every": 0.1}, []),
    "inspect": (lambda w: {"inputs": w.file}, []),
    "presets": (lambda w: {"kind": "imu"}, []),
    "read_readings": (lambda w: {"path": w.file}, []),
    "read_states": (lambda w: {"path": w.file}, []),
    "Readings": (lambda w: {"t_ns": w.stamps, "gyro": w.rows, "accel": w.rows}, []),
    "PoseSequence": (lambda w: {"t_ns": w.stamps, "position": w.rows, "q_wb": w.q_wb}, []),
    "States": (lambda w: {"t_ns": w.stamps, "position": w.rows, "q_wb": w.q_wb}, []),
    "NavigationState": (
        lambda w: {"position": w.rows[0], "velocity": w.rows[0], "q_wb": w.q_wb[0]},
        [],
    ),
    "Odometry": (
        lambda w: {
            "t_ns": w.stamps,
            "q_wb": w.q_wb,
            **dict.fromkeys(("position", "velocity", "angular_velocity"), w.rows),
        },
        [],
    ),
    "camera.project": (lambda w: {"points": w.rows}, []),
    "camera.tracks": (lambda w: {"flight": w.flight, "scene": "house", "camera": SMALL}, []),
    "camera.frames": (lambda w: {"flight": w.flight, "scene": "room", "camera": SMALL}, []),
    "camera.depths": (lambda w: {"flight": w.flight, "scene": "room", "camera": SMALL}, []),
    "camera.flows": (lambda w: {"flight": w.flight, "scene": "room", "camera": SMALL}, []),
    "flight.save": (lambda w: w.place, []),
    "track.between": (lambda w: {"t0": 0.0, "t1": 0.1}, []),
    "track.rows": (lambda w: {"selection": slice(0, 5)}, []),
    "truth.between": (lambda w: {"t0": 0.0, "t1": 0.1}, []),
    "truth.rows": (lambda w: {"selection": slice(0, 5)}, []),
    "track.save": (lambda w: w.place, []),
    "inspection.save": (lambda w: w.place, []),
    "inspection.select": (lambda w: {"kinds": ["error"]}, []),
    "noise.save": (lambda w: w.place, []),
    "noise.compare": (lambda w: {"imu": "lecture"}, []),
    "calibration.save": (lambda w: w.place, []),
    "calibration.to_dict": (lambda w: {"imu": "perfect"}, []),
    "calibration.true_values": (lambda w: {"imu": "perfect"}, []),
    "twin.save": (lambda w: w.place, []),
    "twin.write": (lambda w: w.place, []),
    "twin.flown": (lambda w: {}, []),
    "twin.simulate": (lambda w: {}, []),
    "evaluation.relative": (lambda w: {"delta": 0.1}, []),
    "evaluation.to_dict": (lambda w: {}, []),
    "evaluation.save": (lambda w: w.place, []),
    "evaluation.plot": (lambda w: {}, []),
}
# What only the package makes.
RESULTS = {
    *(
        "AttitudeEvaluation",
        "Calibrated",
        "Calibration",
        "Campaign",
        "Check",
        "Converted",
        "ErrorsAdded",
        "Estimated",
        "Evaluation",
        "Finding",
        "Flight",
        "Generated",
        "Inspection",
        "Noise",
        "ReadingsEvaluation",
        "Report",
        "Track",
    ),
    *("MagneticReadings", "Orientations", "Preintegration", "PressureReadings", "RecordedSamples"),
    "TriadCalibration",
    *("TriadNoise", "Truth", "Twin"),
}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("hostile"))
        patch.setattr(sensors, "_REGISTERED", {})
        patch.syspath_prepend(Path(__file__).parents[2] / "examples")
        yield World()


def function_of(world, name):
    """Return what a name of the table stands for."""
    owner, _, method = name.partition(".")
    if owner == "camera" or not method:
        return getattr(getattr(ims, owner), method) if method else getattr(ims, name)
    return getattr(getattr(world, owner), method)


class Hang(BaseException):
    """The processor time is used up."""


def _hang(*_):
    raise Hang


def outcome(function, arguments):
    """Call it: "result", the class of a documented error, or what else came."""
    signal.signal(signal.SIGPROF, _hang)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            result = function(**arguments)
            if inspect.isgenerator(result):
                next(result, None)
    except ims.ImuSimError as error:
        return type(error).__name__ if all(map(_is_a_line, error.problems)) else f"{error!r}"
    except (Exception, Hang) as error:
        return f"undocumented {error!r:.150}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return "result"


def _is_a_line(problem):
    return bool(problem) and "\n" not in problem and len(problem) < 600


def outcomes(world, name, step):
    """Yield the replaced argument with its value, and the outcome, of every ``step``-th case."""
    function = function_of(world, name)
    valid, parameters = VALID[name]
    defaults = {
        parameter.name: parameter.default
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is not parameter.VAR_KEYWORD
    }
    all_parameters = dict.fromkeys(parameters, inspect.Parameter.empty) | defaults
    for argument, (value_text, make) in itertools.islice(
        itertools.product(all_parameters, VALUES.items()), None, None, step
    ):
        if all_parameters[argument] is None and value_text == "None":
            continue  # the valid call once more
        yield f"{argument}={value_text}", outcome(function, {**valid(world), argument: make()})


@pytest.mark.parametrize("name", VALID)
def test_a_valid_call_gives_a_result(world, name):
    valid, _ = VALID[name]
    assert outcome(function_of(world, name), valid(world)) == "result"


# 7 is prime to the number of values: every value and every argument has its turn.
@pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", VALID)
def test_any_argument_gives_a_result_or_a_documented_error(world, name, step):
    assert math.gcd(step, len(VALUES)) == 1
    documented = {"ConfigurationError", "ArgumentTypeError", "InputError", "result"}
    outcome_by_case = dict(outcomes(world, name, step))
    assert len(outcome_by_case) >= len(VALUES) // step - 1
    assert {case: came for case, came in outcome_by_case.items() if came not in documented} == {}


def test_every_public_name_has_a_valid_call():
    """A new one needs a line in the table above."""
    errors = {name for name in ims.__all__ if name.endswith("Error")}
    # A Motion is checked where a trajectory returns it (test/trajectory/test_given.py).
    assert {*ims.__all__} - errors - RESULTS - {"camera", "Motion"} == {
        n for n in VALID if "." not in n
    }
    cameras = {"project", "tracks", "frames", "depths", "flows"}  # those of docs/reference/api.md
    assert cameras == {name.partition(".")[2] for name in VALID if name.startswith("camera.")}


def test_every_method_that_takes_something_has_a_valid_call():
    for name in RESULTS | {"ErrorModelBatch"}:
        for method, function in inspect.getmembers(getattr(ims, name), inspect.isfunction):
            if method == "lines":  # the text of a program
                continue
            if not method.startswith("_") and len(inspect.signature(function).parameters) > 1:
                assert f"{name.lower()}.{method}" in VALID
