# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Warnings in configurations for VIO stacks about a flight that they initialise badly from."""

import pytest
import yaml

from imu_sim_ros.commands import generate

VIO = [
    *("--format", "tracks", "--trajectory", "figure_eight", "--duration", "8s", "--seed", "12"),
    *("--camera", "euroc_cam0", "--set", "camera.body_axes=flu", "--with-configs", "--quiet"),
]
REST = "OpenVINS: starts late or wrongly"
TILT = "OpenVINS: the accelerometer's bias of this run tilts its first attitude by 0.153 rad"
MONO = "VINS-Mono: the accelerometer's bias of this run, 1.50 m/s^2"
FUSION = "VINS-Fusion: the accelerometer's bias of this run, 1.50 m/s^2"


@pytest.mark.parametrize(
    ("rest", "bias", "starts"),
    [
        (0, 0.0, [REST]),
        (2, 0.0, []),
        (2, 1.5, [TILT, MONO, FUSION]),
        (2, 0.7, ["OpenVINS: the accelerometer's bias", "VINS-Fusion: the accelerometer's bias"]),
    ],
)
def test_a_bad_start_is_said_in_the_files_and_on_standard_error(
    tmp_path, capsys, rest, bias, starts
):
    """atan and sine of a bias of 1.5 m/s^2 across 9.81 m/s^2 are 0.153 rad to three digits."""
    settings = [f"trajectory.lead_in.rest={rest}", f"imu.accelerometer_bias=[{bias},0,0]"]
    options = [word for value in settings for word in ("--set", value)]
    assert generate.main(["-o", str(tmp_path / "x"), "--imu", "perfect", *VIO, *options]) == 0
    lines = [
        line.removeprefix("generate: warning: ")
        for line in capsys.readouterr().err.splitlines()
        if "OpenVINS" in line or "VINS-" in line
    ]
    assert len(lines) == len(starts)
    for line, start in zip(lines, starts, strict=True):
        assert line.startswith(start)
    folder = tmp_path / "x_configs"
    files = {"OpenVINS": "estimator_config.yaml", "VINS-Mono": "vins_mono.yaml"}
    for stack, name in {**files, "VINS-Fusion": "vins_fusion.yaml"}.items():
        text = (folder / name).read_text(encoding="utf-8")
        head = " ".join(row.lstrip("# ") for row in text.splitlines() if row.startswith("#"))
        warnings = [line for line in lines if line.startswith(stack)]
        assert head.count("WARNING") == len(warnings)
        for line in warnings:
            assert line in head
        assert yaml.safe_load(text.removeprefix("%YAML:1.0\n").replace("!!opencv-matrix", ""))
