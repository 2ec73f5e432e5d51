# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The public list, its documentation and what an import costs."""

import doctest
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import imu_sim_ros as ims

# What users rely on. A name that goes or comes needs a line in CHANGELOG.rst.
PUBLIC = [
    "ArgumentTypeError",
    "AttitudeEvaluation",
    "Calibrated",
    "Calibration",
    "Campaign",
    "Check",
    "ConfigurationError",
    "Converted",
    "ErrorModel",
    "ErrorModelBatch",
    "Estimated",
    "ErrorsAdded",
    "Evaluation",
    "Finding",
    "Flight",
    "Generated",
    "ImuSimError",
    "InputError",
    "Inspection",
    "MagneticReadings",
    "MissingDependencyError",
    "Motion",
    "NavigationState",
    "Noise",
    "Odometry",
    "Orientations",
    "PoseSequence",
    "Preintegration",
    "PressureReadings",
    "Readings",
    "ReadingsEvaluation",
    "RecordedSamples",
    "Report",
    "States",
    "Track",
    "TriadCalibration",
    "TriadNoise",
    "Truth",
    "Twin",
    "add_errors",
    "add_errors_to_file",
    "allan",
    "blocks",
    "calibrate_magnetometer",
    "calibrate_six_position",
    "calibrate_temperature",
    "calibrate_turntable",
    "camera",
    "campaign",
    "convert",
    "dead_reckon",
    "evaluate",
    "from_sdf",
    "generate",
    "inspect",
    "preintegrate",
    "presets",
    "read_images",
    "read_imu",
    "read_magnetometer",
    "read_odometry",
    "read_orientation",
    "read_points",
    "read_pressure",
    "read_readings",
    "read_states",
    "register_sensor",
    "report",
    "simulate",
    "twin",
]
PACKAGE = Path(ims.__file__).parent
MODULES = sorted(
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
    for path in PACKAGE.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


def test_the_public_list_is_what_it_was():
    assert sorted(ims.__all__) == sorted(PUBLIC)
    assert dir(ims) == sorted([*PUBLIC, "__version__"])


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_documented_with_its_arguments_and_errors(name):
    value = getattr(ims, name)
    assert value.__doc__
    assert not value.__doc__.startswith(value.__name__ + "(")  # what dataclasses write
    if inspect.isfunction(value):
        for argument in inspect.signature(value).parameters:
            assert f":param {argument}:" in value.__doc__ or "other arguments" in value.__doc__
        gives_nothing = inspect.signature(value).return_annotation in (None, "None")
        assert ":returns:" in value.__doc__ or gives_nothing
        assert ":raises" in value.__doc__ or "errors are those of" in value.__doc__


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_in_the_manual(name):
    """All names that api.md lists keep the promises of docs/how_to/python.md."""
    page = Path(__file__).parents[2] / "docs" / "reference" / "api.md"
    manual = page.read_text(encoding="utf-8")
    assert re.search(rf"^\.\. (auto\w+|currentmodule):: (imu_sim_ros\.)?{name}\b", manual, re.M)


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_in_the_docstrings_run(module, tmp_path):
    doctest_results = doctest.testmod(
        importlib.import_module(module),
        extraglobs={"folder": tmp_path},
        optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE,
    )
    assert doctest_results.attempted > 0
    assert doctest_results.failed == 0


def test_every_public_function_has_an_example():
    functions = [getattr(ims, name) for name in PUBLIC if inspect.isfunction(getattr(ims, name))]
    functions += [getattr(ims.camera, name) for name in ("project", "tracks", "frames", "depths")]
    assert len(functions) > 25
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


@pytest.mark.parametrize("name", ["project", "tracks", "frames", "depths"])
def test_what_cameras_give_is_documented(name):
    function = getattr(ims.camera, name)
    for argument in inspect.signature(function).parameters:
        assert f":param {argument}:" in function.__doc__
    assert ":raises ConfigurationError:" in function.__doc__


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = ims.simulat


def test_the_import_loads_nothing_that_it_does_not_need():
    """Not even NumPy: names are looked up when they are first used."""
    code = (
        "import sys; before = set(sys.modules); import imu_sim_ros;"
        "print(*sorted({m.split('.')[0] for m in set(sys.modules) - before}))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(out.stdout.split())
    assert not loaded & {
        "numpy",
        "scipy",
        "matplotlib",
        "yaml",
        "rosbags",
        "mcap",
        "rich",
        "pandas",
    }
    assert len(loaded) < 12


def test_the_first_simulation_loads_what_it_needs():
    """No bags, no sections of nodes: that is where the time of a first call went."""
    code = (
        "import sys, imu_sim_ros as ims;"
        "ims.simulate(imu='adis16448', trajectory='figure_eight', duration=1);"
        "print(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(out.stdout.split())
    assert "imu_sim_ros.simulation.engine" in loaded
    assert not loaded & {
        "imu_sim_ros.bags",
        "imu_sim_ros.navigation.parameters",
        "scipy",
        "rosbags",
    }
    assert not loaded & {"mcap", "rich", "matplotlib", "cv2", "numba", "pandas"}


def test_names_of_functions_stay_theirs_after_any_import():
    """A package of a function's name would take its place once something in it is imported."""
    folders = {path.stem for path in Path(ims.__file__).parent.iterdir()}
    assert {name for name in ims.__all__ if name in folders} == {"camera"}
