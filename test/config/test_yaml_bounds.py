# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML from anywhere is bounded in size and in the work that it makes."""

import shutil

import pytest

from imu_sim_ros.commands import campaign, convert_bag, generate
from imu_sim_ros.parameters import yaml_loader
from imu_sim_ros.parameters.yaml_text import parse_yaml

DIGITS = "1" * 200_000
"""A pattern whose work grows with the square of the length would take an hour."""


@pytest.mark.parametrize(
    "word", [f"{DIGITS}x", f".{DIGITS}x", f"-{DIGITS}.{DIGITS}e", f"1e{DIGITS}x", "1111.." * 99]
)
def test_words_that_are_nearly_numbers_are_words(word):
    assert parse_yaml(f"a: {word}") == {"a": word}


def test_long_numbers_are_refused():
    for word in (DIGITS, f"{DIGITS}.5", f"{DIGITS}e5"):
        with pytest.raises(ValueError, match=r"a number of 20000\d letters, line 1, column 4"):
            parse_yaml(f"a: {word}")


def test_the_number_of_values_is_bounded():
    with pytest.raises(ValueError, match="over 200,000 values"):
        parse_yaml("- 1\n" * 200_001)


@pytest.mark.parametrize("row", ["- 1\n", "? a\n", "- {a: 1, b: 2}\n", "- - - -\n"])
def test_values_are_counted_whatever_holds_them(row, monkeypatch):
    monkeypatch.setattr(yaml_loader, "_MAX_VALUES", 2_000)
    with pytest.raises(ValueError, match="over 2,000 values"):
        parse_yaml(row * 2_001)
    assert parse_yaml("- 1\n" * 1_900) == [1] * 1_900


def test_what_a_bag_of_ten_thousand_files_needs_is_read():
    file = (
        "{path: recording_9999.mcap, starting_time: {nanoseconds_since_epoch: 1500000000000000000},"
        " duration: {nanoseconds: 600000000000}, message_count: 123456}"
    )
    text = f"files: [{', '.join([file] * 10_000)}]"
    assert len(parse_yaml(text)["files"]) == 10_000


@pytest.mark.parametrize("loader", yaml_loader.LOADERS)
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{" * 50_000, "(nested over 32 deep|maximum nesting depth), line 1, column"),
        ("a: &a [*a]", "contains itself"),
        ("a: 1\na: 2", "'a' is given twice, line 2, column 1"),
        ("a: [1", "line 1"),
        ("a: b: c", "mapping values are not allowed"),
        ("a: \0", "x0000"),
    ],
)
def test_the_same_is_refused_with_libyaml_and_without(monkeypatch, text, reason, loader):
    monkeypatch.setattr(yaml_loader, "LOADERS", [loader])
    yaml_loader.content.cache_clear()
    with pytest.raises(ValueError, match=reason):
        parse_yaml(text)
    assert parse_yaml("a: [5e-4, -.2, !!python/tuple [1]]") == {"a": [5e-4, -0.2, [1]]}


LARGE = "# comment\n" * 500_000
WORDS = "more than 4 MiB of YAML"


@pytest.mark.parametrize("door", ["--params-file", "--imu", "--camera", "--trajectory", "campaign"])
def test_every_command_says_so(tmp_path, capsys, door):
    path = tmp_path / "large.yaml"
    path.write_text(LARGE)
    if door == "campaign":
        assert campaign.main([str(path), "-o", str(tmp_path / "out")]) == 2
    else:
        output = str(tmp_path / "x.mcap")
        assert generate.main([door, str(path), "-o", output, "--duration", "1s"]) == 2
    assert WORDS in capsys.readouterr().err


def test_every_reader_of_datasets_and_bags_says_so(tmp_path, capsys):
    bag = tmp_path / "bag"
    assert generate.main(["-o", str(bag), "--duration", "1s", "--quiet"]) == 0
    (bag / "metadata.yaml").write_text(LARGE)
    folder = tmp_path / "set"
    arguments = ["-o", str(folder), "--format", "euroc", "--duration", "1s", "--quiet"]
    assert generate.main(arguments) == 0
    (folder / "cam0").mkdir()
    (folder / "cam0" / "data.csv").write_text("#timestamp [ns],filename\n")
    (folder / "cam0" / "sensor.yaml").write_text(LARGE)
    (tmp_path / "chain" / "dso").mkdir(parents=True)
    shutil.copytree(folder, tmp_path / "chain" / "mav0")
    (tmp_path / "chain" / "mav0" / "cam0" / "sensor.yaml").unlink()
    (tmp_path / "chain" / "dso" / "camchain.yaml").write_text(LARGE)
    for path in (bag, folder, tmp_path / "chain"):
        assert convert_bag.main([str(path), "-o", str(tmp_path / "out.mcap")]) == 2
        assert WORDS in capsys.readouterr().err
