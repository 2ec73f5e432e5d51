# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outputs: refused before any work, named when whole, parts of interrupted runs."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from imu_sim_ros.bags import outputs as outputs_module
from imu_sim_ros.bags.outputs import OutputFile, Outputs
from imu_sim_ros.core.errors import InputError, MachineError, explain, system_error
from imu_sim_ros.terminal import signals
from imu_sim_ros.terminal.progress import Watcher, watch


@pytest.fixture(autouse=True)
def _working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_an_output_has_its_name_only_when_it_is_whole(tmp_path):
    outputs = Outputs()
    table = outputs.add(tmp_path / "new" / "folder" / "table.csv").path
    with outputs.stage():
        table.write_text("half")
        assert not (tmp_path / "new/folder/table.csv").exists()
        table.write_text("whole")
    assert (tmp_path / "new/folder/table.csv").read_text() == "whole"
    assert os.listdir(tmp_path / "new/folder") == ["table.csv"]


def end_with(error: BaseException, outputs: Outputs, contents: dict[Path, str]) -> None:
    """Write some files of a run that then ends with an error."""
    with outputs.stage():
        for path, text in contents.items():
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        raise error


def end_in_an_empty_folder(outputs: Outputs, folder: Path) -> None:
    with outputs.stage():
        folder.mkdir()
        raise KeyboardInterrupt


def test_an_error_leaves_nothing_not_even_parents(tmp_path):
    outputs = Outputs()
    table, picture = outputs.add("a/b/table.csv").path, outputs.add("picture.png").path
    full = system_error(table, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    with pytest.raises(MachineError, match=r"^a/b/table\.csv: No space left"):
        end_with(full, outputs, {table: "half", picture: "torn"})
    assert os.listdir(tmp_path) == []


def test_everything_that_is_wrong_with_all_targets_is_said_at_once(tmp_path):
    (tmp_path / "there.csv").write_text("mine")
    (tmp_path / "file").write_text("mine")
    outputs = Outputs()
    names = ("there.csv", "file/x.csv", "new.csv", "./new.csv", "..", "n" * 250, "nul\0.csv")
    for name in names:
        outputs.add(name)
    with pytest.raises(InputError) as refused, outputs.stage():
        pytest.fail("the work began")
    lines = refused.value.problems
    assert [line.split(":")[0] for line in lines] == [
        "there.csv", "file/x.csv", "'..'", "n" * 40 + "...", "'nul\\x00.csv'", "new.csv"
    ]  # fmt: skip
    assert sorted(os.listdir(tmp_path)) == ["file", "there.csv"]


def test_force_replaces_files_links_and_folders_of_outputs(tmp_path):
    (tmp_path / "a.csv").write_text("old")
    (tmp_path / "other").write_text("mine")
    (tmp_path / "link.csv").symlink_to("other")
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "old.mcap").write_text("old")
    outputs = Outputs(force=True)
    paths = [outputs.add(name).path for name in ("a.csv", "link.csv", "bag")]
    with outputs.stage():
        paths[0].write_text("new")
        paths[1].write_text("new")
        paths[2].mkdir()
        (paths[2] / "new.mcap").write_text("new")
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "link.csv").read_text() == "new"
    assert (tmp_path / "other").read_text() == "mine"
    assert os.listdir(tmp_path / "bag") == ["new.mcap"]
    assert sorted(os.listdir(tmp_path)) == ["a.csv", "bag", "link.csv", "other"]


@pytest.mark.parametrize("name", [".", "home", "/dev/null"])
def test_force_does_not_replace_what_is_no_output(tmp_path, name):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("mine")
    outputs = Outputs(force=True)
    outputs.add(name)
    with pytest.raises(InputError), outputs.stage():
        pytest.fail("the work began")
    assert (tmp_path / "home" / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize(
    "name", ["x.mcap", "./x.mcap", "folder/../x.mcap", "symbolic.mcap", "hard.mcap", "back/x.mcap"]
)
@pytest.mark.parametrize("force", [False, True])
def test_an_input_is_never_written_to_whatever_it_is_called(tmp_path, name, force):
    (tmp_path / "x.mcap").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "symbolic.mcap").symlink_to("x.mcap")
    os.link("x.mcap", "hard.mcap")
    (tmp_path / "back").symlink_to(".")
    outputs = Outputs(inputs=["x.mcap", "not there"], force=force)
    outputs.add(name)
    with pytest.raises(InputError, match=r"is the input x\.mcap"), outputs.stage():
        pytest.fail("the work began")
    assert (tmp_path / "x.mcap").read_text() == "mine"


def test_a_folder_that_holds_an_input_is_not_replaced(tmp_path):
    (tmp_path / "MH_01" / "mav0").mkdir(parents=True)
    (tmp_path / "MH_01" / "mav0" / "data.csv").write_text("mine")
    for source, target, word in (
        ("MH_01/mav0", "MH_01", "holds"),
        ("MH_01", "MH_01/mav0", "lies in"),
    ):
        outputs = Outputs(inputs=[source], force=True)
        outputs.add(target)
        with pytest.raises(InputError, match=f"{word} the input"), outputs.stage():
            pytest.fail("the work began")


def test_files_go_into_a_folder_that_holds_others(tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "notes.md").write_text("mine")
    outputs = Outputs()
    folder = outputs.add_files("results", ["a.yaml", "b.png"])
    with outputs.stage():
        (folder / "a.yaml").write_text("a")
        (folder / "b.png").write_text("b")
    assert sorted(os.listdir(tmp_path / "results")) == ["a.yaml", "b.png", "notes.md"]
    again = Outputs()
    again.add_files("results", ["b.png", "c.png"])
    with pytest.raises(InputError, match=r"results/b\.png: already exists"), again.stage():
        pytest.fail("the work began")


def test_parts_of_a_split_output_are_refused_as_well(tmp_path):
    (tmp_path / "x_3.bag").write_text("mine")
    (tmp_path / "y_left.bag").write_text("mine")
    outputs = Outputs()
    outputs.add("x.bag")
    outputs.add("y.bag")
    with pytest.raises(InputError) as refused, outputs.stage():
        pytest.fail("the work began")
    assert refused.value.problems == ("x_3.bag: already exists; force=True replaces it",)


@pytest.mark.parametrize("discard", [False, True])
def test_an_interrupted_run_keeps_what_is_whole_as_a_part(tmp_path, discard):
    for count in range(2):
        outputs = Outputs(discard_partial=discard)
        bag, side = outputs.add("x.mcap", keep_partial=True), outputs.add("x_truth.yaml").path
        bag.summary = lambda: "12 messages up to stamp 1.2 s"
        with pytest.raises(KeyboardInterrupt) as stopped:
            end_with(
                KeyboardInterrupt(), outputs, {bag.path: f"whole so far {count}", side: "torn"}
            )
        number = "" if count == 0 else "2"
        line = f"x.partial{number}.mcap: 12 messages up to stamp 1.2 s"
        assert stopped.value.args == (() if discard else (line,))
    expected = [] if discard else ["x.partial.mcap", "x.partial2.mcap"]
    assert sorted(os.listdir(tmp_path)) == expected


def test_companions_are_written_with_their_output_and_no_part_of_it(tmp_path):
    def outputs() -> tuple[Outputs, list]:
        new_outputs = Outputs()
        bag = new_outputs.add("bag", keep_partial=True)
        bag.summary = lambda: "12 messages"
        return new_outputs, [bag.path, new_outputs.add("bag_truth.yaml", companion_of=bag).path]

    run, (bag, truth) = outputs()
    with run.stage():
        assert os.listdir(tmp_path) == ["bag.active"]  # what a kill would leave
        bag.mkdir()
        (bag / "bag_0.mcap").write_text("whole")
        truth.write_text("true")
    assert sorted(os.listdir(tmp_path)) == ["bag", "bag_truth.yaml"]
    (tmp_path / "bag_truth.yaml").unlink()
    (tmp_path / "bag").rename(tmp_path / "older")
    run, (bag, truth) = outputs()
    with pytest.raises(KeyboardInterrupt):
        end_with(KeyboardInterrupt(), run, {bag / "bag_0.mcap": "half", truth: "true"})
    assert sorted(os.listdir(tmp_path)) == ["bag.partial", "older"]
    run, (bag, _) = outputs()
    with pytest.raises(KeyboardInterrupt) as interrupted:
        end_in_an_empty_folder(run, bag)
    assert sorted(os.listdir(tmp_path)) == ["bag.partial", "older"]  # nothing of an empty folder
    assert interrupted.value.args == ()


def test_files_that_were_only_opened_are_no_part():
    outputs = Outputs()
    dataset = outputs.add("folder", keep_partial=True).path
    files = {dataset / "data.csv.active": "#timestamp [ns]\n"}
    with pytest.raises(KeyboardInterrupt) as stopped:
        end_with(KeyboardInterrupt(), outputs, files)
    assert stopped.value.args == ()
    assert os.listdir() == []


def test_two_runs_at_once_do_not_mix(tmp_path):
    run, rival = Outputs(), Outputs(force=True)
    path = run.add("x.mcap").path
    rival.add("x.mcap")
    with run.stage():
        # flock tells open files apart, so that this process stands for two
        with pytest.raises(InputError, match="another program is writing"), rival.stage():
            pytest.fail("the work began")
        path.write_text("whole")
    assert (tmp_path / "x.mcap").read_text() == "whole"


def test_a_folder_that_is_not_locked_yet_is_not_shared(tmp_path, monkeypatch):
    """Between making the staging folder and locking it, another run takes it for a stale one."""
    run, rival = Outputs(), Outputs(force=True)
    run.add("x.mcap")
    path = rival.add("x.mcap").path
    faster = ExitStack()
    opened = outputs_module._open

    def after_the_other(staging):
        monkeypatch.setattr(outputs_module, "_open", opened)
        faster.enter_context(rival.stage())
        return opened(staging)

    monkeypatch.setattr(outputs_module, "_open", after_the_other)
    with pytest.raises(InputError, match="another program is writing"), run.stage():
        pytest.fail("the work began")
    path.write_text("of the second")
    faster.close()
    assert os.listdir(tmp_path) == ["x.mcap"]
    assert (tmp_path / "x.mcap").read_text() == "of the second"


def test_a_run_that_only_looks_takes_no_folder_away(tmp_path, monkeypatch):
    """Another run holds the lock for a moment, to see whether a staging folder is stale."""
    outputs = Outputs()
    path = outputs.add("x.mcap").path
    looking = ExitStack()
    opened = outputs_module._open

    def looked_at(staging):
        descriptor = os.open(staging, os.O_RDONLY)
        looking.callback(os.close, descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return opened(staging)

    monkeypatch.setattr(outputs_module, "_open", looked_at)
    monkeypatch.setattr(outputs_module.time, "sleep", lambda _: looking.close())
    with outputs.stage():
        path.write_text("whole")
    assert (tmp_path / "x.mcap").read_text() == "whole"


def test_of_several_outputs_none_gets_its_name_if_one_is_taken(tmp_path):
    outputs = Outputs()
    paths = [outputs.add(name).path for name in ("a.mcap", "b.csv")]
    running = ExitStack()
    running.enter_context(outputs.stage())
    for path in paths:
        path.write_text("of the program")
    (tmp_path / "b.csv").write_text("of the user")
    with pytest.raises(InputError, match=r"^b\.csv: appeared in the meantime"):
        running.close()
    assert os.listdir(tmp_path) == ["b.csv"]
    assert (tmp_path / "b.csv").read_text() == "of the user"


def test_a_recording_replaces_nothing_that_got_its_name(tmp_path):
    path = tmp_path / "x.mcap"
    file = OutputFile(path)
    file.write(b"of the program")
    path.write_text("of the user")
    with pytest.raises(InputError, match="appeared in the meantime"):
        file.finish()
    file.abandon()
    assert path.read_text() == "of the user"
    assert (tmp_path / "x.mcap.active").read_text() == "of the program"


def test_a_signal_as_the_staging_folder_is_made_leaves_none(tmp_path, monkeypatch):
    opened = outputs_module._open

    def interrupted(staging):
        os.kill(os.getpid(), signal.SIGTERM)
        return opened(staging)

    monkeypatch.setattr(outputs_module, "_open", interrupted)
    outputs = Outputs()
    outputs.add("x.mcap")
    follower = Watcher(undisturbed=signals.delay_signals)
    with watch(follower), pytest.raises(KeyboardInterrupt), signals.raise_signals():  # noqa: SIM117
        with outputs.stage():
            pytest.fail("the work began")
    assert os.listdir(tmp_path) == []


def test_what_a_killed_run_left_is_told_and_replaced_with_force(tmp_path):
    (tmp_path / "x.mcap.active").mkdir()
    (tmp_path / "x.mcap.active" / "x.mcap.active").write_text("half")
    for force in (False, True):
        outputs = Outputs(force=force)
        path = outputs.add("x.mcap").path
        if not force:
            with pytest.raises(InputError, match="recover or delete"), outputs.stage():
                pytest.fail("the work began")
            continue
        with outputs.stage():
            path.write_text("whole")
    assert os.listdir(tmp_path) == ["x.mcap"]


def test_a_folder_that_no_longer_exists():
    script = (
        "import os, tempfile; from imu_sim_ros.bags.outputs import Outputs\n"
        "folder = tempfile.mkdtemp(); os.chdir(folder); os.rmdir(folder)\n"
        "outputs = Outputs(); outputs.add('x.csv'); outputs.stage().__enter__()"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "InputError: x.csv: No such file" in result.stderr


def test_errors_of_the_machine_end_with_status_1():
    assert explain(system_error("x", OSError(errno.ENOSPC, "full"))) == (("x: full",), 1)
    assert explain(system_error("x", OSError(errno.EACCES, "no"))) == (("x: no",), 2)
    assert explain(OSError(errno.EIO, "broken", "x")) == (("x: broken",), 1)
    line = "unexpected: KeyError: 'what'; run with --debug for the traceback"
    assert explain(KeyError("what")) == ((line,), 1)


def test_the_parts_of_a_split_output_are_one_line():
    outputs = Outputs()
    target = outputs.add("x.mcap", keep_partial=True)
    target.summary = lambda: "12 messages"
    bag = target.path
    parts = {bag.with_name(f"x_{k}.mcap"): "" for k in range(100)}
    with pytest.raises(KeyboardInterrupt) as stopped:
        end_with(KeyboardInterrupt(), outputs, parts)
    line = "x_0.partial.mcap and 99 more files: 12 messages"
    assert stopped.value.args == (line,)
    assert len(os.listdir()) == 100


def test_a_full_disk_is_told_with_the_name_of_the_output():
    """The system tells no name where a write fails; a read that fails has nothing to do with it."""
    for number, has_name in ((errno.ENOSPC, True), (errno.EIO, False)):
        outputs = Outputs()
        outputs.add("x.csv")
        with pytest.raises(OSError, match=os.strerror(number)) as failed, outputs.stage():
            raise OSError(number, os.strerror(number))
        expected = f"x.csv: {os.strerror(number)}" if has_name else os.strerror(number)
        assert explain(failed.value) == ((expected,), 1)


@pytest.mark.parametrize("harm", ["truncated", "deleted"])
def test_a_file_that_another_program_harms_while_it_grows_is_an_error(tmp_path, harm):
    file = OutputFile(tmp_path / "a.bin")
    file.write(b"x" * 1000)
    if harm == "truncated":
        os.truncate(file.current, 500)
    else:
        file.current.unlink()
    with pytest.raises(MachineError, match=f"another program has {harm} it"):
        file.write(b"y")
    with pytest.raises(MachineError, match=harm):
        file.finish()
