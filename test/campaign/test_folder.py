# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a campaign: nothing else is overwritten; what cannot begin leaves nothing."""

import os
import shutil
from pathlib import Path

import pytest

from imu_sim_ros.campaigns.results import read_results
from imu_sim_ros.commands import report
from imu_sim_ros.core.errors import InputError


@pytest.mark.parametrize("option", [[], ["--force"], ["--resume"]])
@pytest.mark.parametrize("name", ["thesis.txt", "results.xlsx", "data/x.csv"])
def test_a_folder_with_anything_else_is_refused(plan_file, campaign, tmp_path, name, option):
    folder = tmp_path / "out"
    (folder / name).parent.mkdir(parents=True)
    (folder / name).write_text("mine")
    status, _, lines = campaign(plan_file(), "-o", folder, *option)
    assert status == 2
    shown = name.partition("/")[0]
    assert lines == [
        f"campaign: {folder}: contains {shown}, which is not from a campaign; name another folder"
    ]
    assert [path.name for path in folder.iterdir()] == [shown]


def test_tables_without_their_rows_are_not_replaced_unasked(plan_file, campaign, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "results.csv").write_text("cell,seed\n")
    status, _, (line,) = campaign(plan_file(), "-o", folder)
    assert status == 2
    assert "contains results.csv without the runs.jsonl" in line
    assert (folder / "results.csv").read_text() == "cell,seed\n"
    assert campaign(plan_file(), "-o", folder, "--force")[1]["runs"] == 3


def test_force_begins_again_and_resume_leaves_notes_alone(plan_file, campaign, tmp_path):
    folder = tmp_path / "out"
    assert campaign(plan_file(), "-o", folder)[0] == 0
    assert campaign(plan_file(seeds=1), "-o", folder, "--force")[1]["runs"] == 1
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 1
    (folder / "notes.md").write_text("mine")
    assert campaign(plan_file(seeds=2), "-o", folder, "--resume")[1]["runs"] == 2
    assert (folder / "notes.md").read_text() == "mine"
    # Forced it would have to go, and is not a campaign's.
    assert campaign(plan_file(), "-o", folder, "--force")[0] == 2


def test_an_earlier_plan_is_kept(plan_file, campaign, tmp_path):
    """The folder may hold the only copy of the plan."""
    folder = tmp_path / "out"
    assert campaign(plan_file(seeds=1), "-o", folder)[0] == 0
    first_plan = (folder / "plan.yaml").read_bytes()
    assert campaign(plan_file(seeds=2), "-o", folder, "--resume")[0] == 0
    assert (folder / "plan.1.yaml").read_bytes() == first_plan
    assert (folder / "plan.yaml").read_bytes() == plan_file(seeds=2).read_bytes()


def test_the_plan_may_lie_in_the_folder(plan_file, campaign, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    plan = shutil.copyfile(plan_file(seeds=1), folder / "plan.yaml")
    assert campaign(plan, "-o", folder)[0] == 0
    assert sorted(path.name for path in folder.glob("plan*")) == ["plan.yaml"]


def test_a_file_is_no_folder_of_results(plan_file, campaign, tmp_path):
    (tmp_path / "file").write_text("mine")
    status, _, (line,) = campaign(plan_file(), "-o", tmp_path / "file")
    assert (status, line) == (2, f"campaign: {tmp_path}/file: exists and is not a folder")


@pytest.mark.parametrize("name", ["out", "out/results.csv"])
def test_a_baseline_is_not_what_is_written(plan_file, campaign, tmp_path, name):
    assert campaign(plan_file(seeds=1), "-o", tmp_path / "out")[0] == 0
    table_before = (tmp_path / "out" / "results.csv").read_bytes()
    options = ["--resume", "--baseline", tmp_path / name]
    status, _, (line,) = campaign(plan_file(seeds=2), "-o", tmp_path / "out", *options)
    assert status == 2
    assert line.endswith("is written by this campaign")
    assert (tmp_path / "out" / "results.csv").read_bytes() == table_before


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/full"])
def test_a_device_is_no_table_of_results(path):
    with pytest.raises(InputError, match="is a device"):
        read_results(Path(path))


def _make_obstacle(kind, path):
    if kind == "broken link":
        path.symlink_to("nowhere")
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")


@pytest.mark.parametrize("name", ["runs.jsonl", "plan.yaml", ".lock"])
@pytest.mark.parametrize("kind", ["broken link", "loop", "pipe", "folder", "device"])
def test_what_stands_in_a_file_of_a_campaign_is_named(plan_file, campaign, tmp_path, kind, name):
    """Only what does not exist is absent; nothing is waited for, and nothing removed unasked."""
    folder = tmp_path / "out"
    folder.mkdir()
    _make_obstacle(kind, folder / name)
    for option in ([], ["--resume"]):
        status, _, lines = campaign(plan_file(), "-o", folder, *option)
        assert status == 2
        assert len(lines) == 1
        assert lines[0].startswith(f"campaign: {folder / name}: ")
        assert {path.name for path in folder.iterdir()} <= {name, ".lock"}


@pytest.mark.parametrize("name", ["runs.jsonl", "versions.json"])
@pytest.mark.parametrize("kind", ["broken link", "loop", "pipe", "folder", "device"])
def test_a_report_names_it_too(plan_file, campaign, tmp_path, capsys, kind, name):
    folder = tmp_path / "out"
    assert campaign(plan_file(), "-o", folder)[0] == 0
    (folder / name).unlink(missing_ok=True)
    _make_obstacle(kind, folder / name)
    assert report.main([str(folder), "-o", str(tmp_path / "page.html"), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"report: {folder / name}: ")


@pytest.mark.parametrize("kind", ["broken link", "loop", "pipe", "device"])
def test_a_plan_names_the_file_of_poses_that_is_none(plan_file, campaign, tmp_path, kind):
    _make_obstacle(kind, tmp_path / "poses.txt")
    poses_parameters = {"trajectory.type": "poses", "trajectory.file": str(tmp_path / "poses.txt")}
    status, _, lines = campaign(plan_file(parameters=poses_parameters), "-o", tmp_path / "out")
    assert status == 2
    assert len(lines) == 1
    assert f"{tmp_path / 'poses.txt'}: " in lines[0]
    assert "does not exist" not in lines[0]
