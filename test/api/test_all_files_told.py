# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every file that cannot be read has its line, whichever argument names it."""

import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.errors import ConfigurationError


@pytest.fixture
def bad(tmp_path):
    """Return the paths of files without any content of use, by name."""
    texts = {f"{name}.yaml": f"a: [{name}" for name in ("imu", "first", "second", "camera")}
    texts |= {"poses.tum": "hello", "readings.csv": "hello"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return {name: str(tmp_path / name) for name in texts}


def names_in_error(error, bad):
    return [name for name, path in bad.items() if f"{path}: " in str(error)]


def test_generate_and_simulate_name_the_poses_next_to_other_files(bad, tmp_path):
    arguments = {"imu": bad["imu.yaml"], "trajectory": bad["poses.tum"]}
    with pytest.raises(ConfigurationError) as refused:
        ims.generate(tmp_path / "run.mcap", cameras=bad["camera.yaml"], **arguments)
    assert names_in_error(refused.value, bad) == ["imu.yaml", "camera.yaml", "poses.tum"]
    with pytest.raises(ConfigurationError) as refused:
        ims.simulate(params_file=bad["first.yaml"], duration=1, **arguments)
    assert names_in_error(refused.value, bad) == ["imu.yaml", "first.yaml", "poses.tum"]


def test_add_errors_names_preset_parameter_files_and_source(bad, tmp_path):
    files, output = [bad["first.yaml"], bad["second.yaml"]], tmp_path / "noisy.csv"
    with pytest.raises(ConfigurationError) as refused:
        ims.add_errors([0, 1], [[0] * 3] * 2, [[0] * 3] * 2, imu=bad["imu.yaml"], params_file=files)
    assert names_in_error(refused.value, bad) == ["imu.yaml", "first.yaml", "second.yaml"]
    with pytest.raises(ConfigurationError) as refused:
        ims.add_errors_to_file(bad["readings.csv"], output, imu=bad["imu.yaml"], params_file=files)
    expected = ["imu.yaml", "first.yaml", "second.yaml", "readings.csv"]
    assert names_in_error(refused.value, bad) == expected
    with pytest.raises(ConfigurationError) as refused:
        ims.add_errors_to_file(bad["readings.csv"], output, imu=bad["imu.yaml"])
    assert names_in_error(refused.value, bad) == ["imu.yaml", "readings.csv"]
