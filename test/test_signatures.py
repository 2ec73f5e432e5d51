# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A program's arguments from the signature and the docstring of a job."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import pytest

from imu_sim_ros.commands import program
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.jobs.evaluate import parse_delta
from imu_sim_ros.terminal.signatures import Heading, Text, arguments_of, call_job, parse_assignment


def job(
    bags: Annotated[Sequence[str | Path], "BAG", Path],
    *,
    gap: Annotated[float, "TIME"] = 0.5,
    strength: Annotated[float | None, "--field T"] = None,
    count: Annotated[int, "N"] = 3,
    align: Annotated[str, ("none", "yaw")] = "none",
    rpe: Annotated[Sequence[Any], "DELTA", parse_delta] = (),
    robust: Annotated[bool, "--robust"] = False,
    page: Annotated[bool, "--no-page"] = True,
    imu: Annotated[str | Path | None, "NAME|FILE"] = None,
    hidden: int = 7,
) -> dict[str, Any]:
    """Do something.

    :param bags: the bags
    :param gap: longest gap of ``5 %``, which
        goes on [s]
    :param strength: a field [T]
    :param count: a number
    :param align: a word
    :param rpe: repeatable
    :param robust: a switch
    :param page: write no page, with ``strength`` or ``none``
    :param imu: a name
    :param hidden: not an argument
    """
    if gap <= 0.0 or strength == 0.0:
        option_names = (
            argument_prefix("gap", f"{gap:g}"),
            argument_prefix("strength", str(strength)),
        )
        raise ConfigurationError([f"{option_names[0]}: too short", f"{option_names[1]}: none"])
    return dict(locals())


def parsed(command_line: str) -> dict[str, Any]:
    return call_job(
        job, program.Parser("job", arguments=arguments_of(job)).parse_every(command_line.split())
    )


def test_defaults_are_those_of_the_signature() -> None:
    assert parsed("a b") == {
        "bags": [Path("a"), Path("b")],
        "gap": 0.5,
        "strength": None,
        "count": 3,
        "align": "none",
        "rpe": (),
        "robust": False,
        "page": True,
        "imu": None,
        "hidden": 7,
    }


def test_values_have_their_types() -> None:
    command_line = (
        "a --gap 2min --field 5e-5 --count 4 --align yaw --rpe 1km --rpe 5frames --robust"
    )
    parsed_values = parsed(f"{command_line} --no-page --imu mpu6000")
    assert parsed_values["gap"] == 120.0
    assert parsed_values["strength"] == 5e-5
    assert (parsed_values["count"], parsed_values["align"], parsed_values["imu"]) == (
        4,
        "yaw",
        "mpu6000",
    )
    assert parsed_values["rpe"] == [(1000.0, "m"), (5.0, "frames")]
    assert (parsed_values["robust"], parsed_values["page"]) == (True, False)


def test_help_has_the_texts_and_defaults() -> None:
    text = " ".join(program.Parser("job", arguments=arguments_of(job)).format_help().split())
    assert "--gap TIME longest gap of 5 %, which goes on (default: 0.5s)" in text
    assert "--count N a number (default: 3)" in text
    assert "--align {none,yaw} a word (default: none)" in text
    assert "--field T a field [T] --count" in text
    assert "--no-page write no page, with --field or none" in text
    assert "hidden" not in text


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ("--gap soon", "argument --gap: 'soon' is not a duration such as 20s"),
        ("--rpe 3miles", "argument --rpe: '3miles' is not a delta"),
        ("--align ywa", "unknown --align 'ywa'"),
        ("--gpa 1s", "unknown option '--gpa'; did you mean --gap"),
    ],
)
def test_bad_words_are_one_line(options: str, line: str, capsys: Any) -> None:
    with pytest.raises(SystemExit):
        parsed(f"a {options}")
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1


def test_defaults_and_overrides_of_the_arguments() -> None:
    arguments = program.Parser("job", arguments=arguments_of(job)).parse_every(
        ["a", "--gap", "2s", "--count", "4"]
    )
    job_arguments = call_job(
        job, arguments, defaults={"gap": 1.0, "field": 3.0}, overrides={"count": 5}
    )
    assert (job_arguments["gap"], job_arguments["strength"], job_arguments["count"]) == (
        2.0,
        3.0,
        5,
    )


def test_problems_name_the_options() -> None:
    with pytest.raises(ConfigurationError) as caught:
        parsed("a --gap 0s --field 0")
    assert caught.value.problems == ("--gap 0: too short", "--field 0.0: none")


def pair(text: str) -> tuple[str, str]:
    source, _, target = text.partition("=")
    return source, target


SHARED = Annotated[str | Path, "-o --output PATH", Text("where to"), Heading("output")]


def writer(
    source: Annotated[str | Path, "INPUT"],
    output: SHARED,
    *,
    topics: Annotated[str | Sequence[str], "NAME,..."] = (),
    rename: Annotated[Mapping[str, str] | None, "--topic OLD=NEW", pair, Heading("output")] = None,
    rate: Annotated[float | None, "HZ"] = None,
    cameras: Annotated[Sequence[str], "--camera NAME"] = (),
    **parameters: Annotated[Any, "--set KEY=VALUE", parse_assignment, Text("a parameter")],
) -> dict[str, Any]:
    """Write something.

    :param source: what is read
    :param output: in other words for Python
    :param topics: names (default: all)
    :param rename: new names
    :param rate: samples
    :param cameras: names
    """
    node_parameters = parameters.get("parameters", {})
    if (used := node_parameters.get("rate", rate)) == 0.0:
        problems = [
            f"{argument_prefix('rate', str(used))}: too low",
            f"{argument_prefix('topics')}: none of them",
        ]
        raise ConfigurationError(problems)
    return dict(locals())


def call_with(command_line: str) -> dict[str, Any]:
    parser = program.Parser("writer", arguments=arguments_of(writer))
    return call_job(writer, parser.parse_every(command_line.split()))


def test_names_in_one_word_pairs_and_parameters() -> None:
    written_values = call_with(
        "a -o b --topics x,y --topic x=u --topic y=v --set rate=3 --set cameras=[c]"
    )
    assert (written_values["source"], written_values["output"]) == (Path("a"), Path("b"))
    assert written_values["topics"] == ["x", "y"]
    assert written_values["rename"] == {"x": "u", "y": "v"}
    # Parameters never become arguments of the job that have the same name.
    assert (written_values["rate"], written_values["cameras"]) == (None, ())
    assert written_values["parameters"] == {"parameters": {"rate": 3, "cameras": ["c"]}}
    bare = call_with("a -o b")
    assert (bare["topics"], bare["rename"], bare["parameters"]) == ((), None, {})


def test_an_option_without_a_default_is_required(capsys: Any) -> None:
    with pytest.raises(SystemExit):
        call_with("a")
    assert "-o/--output" in capsys.readouterr().err


def test_headings_and_shared_texts_stand_in_the_help() -> None:
    text = program.Parser("writer", arguments=arguments_of(writer)).format_help()
    general, output = text.split("\noutput:\n")
    assert "where to" in output
    assert "--topic OLD=NEW" in output
    assert "other words" not in text
    assert "a parameter" in general
    assert "default: ()" not in text


def test_only_what_was_given_as_an_option_is_named_as_one() -> None:
    for options, message in (
        ("--rate 0", "--rate 0.0: too low"),
        ("--set rate=0.0", "rate = 0.0: "),
    ):
        with pytest.raises(ConfigurationError) as caught:
            call_with(f"a -o b --topics x {options}")
        assert caught.value.problems[0].startswith(message)
        assert caught.value.problems[1] == "--topics: none of them"
