# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A program's arguments from the signature and the docstring of its job, and the call of the job.

A parameter of a job is an argument of its program if its annotation says how it is written::

    def job(
        bag: Annotated[str | Path, "BAG"],  # a positional argument
        *,
        skip: Annotated[float, "TIME"] = 0.0,  # --skip TIME, in seconds or as 20s, 10min, 4h
        out: Annotated[str | None, "-o --output FILE"] = None,  # names of its own
        align: Annotated[str, ALIGNMENTS] = "none",  # one of several words
        rpe: Annotated[Sequence[Delta], "DELTA", delta] = (),  # repeatable, read by a function
        topics: Annotated[Sequence[str], "NAME,..."] = (),  # several words in one
        rename: Annotated[Mapping[str, str], "OLD=NEW", pair] = {},  # repeatable, a dictionary
        robust: Annotated[bool, "--robust"] = False,  # a switch
        **parameters: Annotated[Any, "--set KEY=VALUE", assignment],  # as parameters={...}
    ) -> Result:

Its help is the text of ``:param``, its default that of the signature. What several jobs share is a
type of its own, with a :class:`Text`; a :class:`Heading` puts arguments together in ``--help``.
"""

import inspect
import re
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

from imu_sim_ros import timebase
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.parameters.yaml_text import parse_yaml


class Text(str):
    """The help of an argument that several jobs have, or that lists what the program knows."""


class Heading(str):
    """The heading in ``--help`` under which an argument stands."""


Found = TypeVar("Found")
_NONE: Mapping[str, object] = {}
_REST = inspect.Parameter.VAR_KEYWORD


def arguments_of(job: Callable[..., object]) -> dict[str, dict[str, Any]]:
    """Return the arguments of a job's program, as :func:`imu_sim_ros.program.add_options` has them.

    A value that is not given is None, so that the job's own default holds.
    """
    texts = _texts(job)
    return {_written(one): _keywords(one, texts.get(one.name, "")) for one in _parameters(job)}


def call(
    job: Callable[..., Found],
    arguments: Namespace,
    below: Mapping[str, object] = _NONE,
    above: Mapping[str, object] = _NONE,
) -> Found:
    """Return the result of a job with the arguments that are given.

    :param below: parameters by name, such as those of files, over which the arguments win.
    :param above: parameters that win over the arguments, such as those of ``--set``.
    :raises ImuSimError: of the job; its lines name the options.
    """
    every = list(_parameters(job))
    values = {one.name: getattr(arguments, one.name) for one in every}
    values |= {one.name: dict(values[one.name] or ()) for one in every if _has_pairs(one)}
    given = {name: value for name, value in values.items() if value not in (None, {})}
    options = {
        one.name: [word for word in _written(one).split() if word[:2] == "--"][-1]
        for one in every
        if _is_option(one)
    }
    # A parameter of ROS has the name of the option: initial_state for --initial-state.
    names = {option.strip("-").replace("-", "_"): name for name, option in options.items()}
    below, above = (
        {names.get(name, name): value for name, value in layer.items()} for layer in (below, above)
    )
    last = {*above, *(name for one in every if one.kind is _REST for name in values[one.name])}
    try:
        return job(**{**below, **given, **above})
    except ImuSimError as error:
        lines = []
        for line in error.problems:
            name, sign, rest = re.split("( = |: |$)", line, maxsplit=1)
            own = sign and name in given and name in options and name not in last
            between = ": " if sign == ": " else " "
            lines.append(f"{options[name]}{between}{rest}" if own else line)
        raise type(error)(lines) from None


def assignment(words: str) -> tuple[str, object]:
    """Return name and value of ``key=value``; the value is YAML, none an empty string.

    :raises ValueError: for anything else.
    """
    name, equals, value = words.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"{words!r} is not of the form key=value")
    try:
        return name.strip(), parse_yaml(value) if value.strip() else ""
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _parameters(job: Callable[..., object]) -> Iterator[inspect.Parameter]:
    """Yield the parameters of a job that are arguments of its program."""
    for parameter in inspect.signature(job, eval_str=True).parameters.values():
        if get_origin(parameter.annotation) is Annotated:
            yield parameter


def _texts(job: Callable[..., object]) -> dict[str, str]:
    """Return the texts of a docstring by the names of its parameters, each in a line."""
    found = re.findall(
        r"^:param (\w+): (.*?)(?=^:|^$|\Z)", inspect.getdoc(job) or "", re.MULTILINE | re.DOTALL
    )
    return {name: " ".join(text.replace("``", "").split()) for name, text in found}


def _is_option(parameter: inspect.Parameter) -> bool:
    """Return whether an argument begins with dashes."""
    return parameter.default is not parameter.empty or _mark(parameter).startswith("-")


def _mark(parameter: inspect.Parameter) -> str:
    """Return how an argument is written, as its annotation says."""
    return next((m for m in parameter.annotation.__metadata__ if type(m) is str), "")


def _written(parameter: inspect.Parameter) -> str:
    """Return names and metavariable: ``estimate ESTIMATE``, ``-o --output FILE``, ``--json``."""
    words = _mark(parameter)
    if words.startswith("-"):
        return words
    name = parameter.name.replace("_", "-")
    return f"--{name} {words}" if _is_option(parameter) else f"{parameter.name} {words}"


def _has_pairs(parameter: inspect.Parameter) -> bool:
    """Return whether an argument is a dictionary, written ``NAME=VALUE``."""
    return "=" in _mark(parameter)


def _keywords(parameter: inspect.Parameter, text: str) -> dict[str, Any]:
    """Return what argparse is told about a parameter.

    :param text: of the docstring.
    """
    hint, *marks = get_args(parameter.annotation)
    default, option = parameter.default, _is_option(parameter)
    metavar = _written(parameter).split()[-1]
    found: dict[str, Any] = {"dest": parameter.name} if option else {}
    if (group := next((m for m in marks if isinstance(m, Heading)), None)) is not None:
        found["group"] = group
    text = next((m for m in marks if isinstance(m, Text)), text)
    if isinstance(default, bool):
        action = "store_false" if default else "store_true"
        return {**found, "action": action, "default": None, "help": _help(text)}
    if option and default is parameter.empty and parameter.kind is not _REST:
        found["required"] = True
    in_one = metavar.endswith(",...")
    several = any(get_origin(one) is Sequence for one in (hint, *get_args(hint))) and not in_one
    if several or _has_pairs(parameter):
        found |= {"action": "append"} if option else {"nargs": "+"}
    if (words := next((m for m in marks if isinstance(m, tuple | list)), None)) is not None:
        found |= {"choices": words, "metavar": None}
    else:
        read = _words if in_one else next((m for m in marks if callable(m)), None)
        found["type"] = reader(read or _kind(hint, metavar))
    if isinstance(default, str | int | float) and default != "" and "default" not in text:
        number = "" if isinstance(default, str) else f"{default:g}"
        unit = "s" if number and metavar == "TIME" else ""
        text = f"{text.removesuffix(' [s]')} (default: {number or default}{unit})"
    return {**found, "help": _help(text)}


def _words(words: str) -> list[str]:
    """Return the names in ``NAME,...``.

    :raises ValueError: if there is none.
    """
    names = [name for name in map(str.strip, words.split(",")) if name]
    if not names:
        raise ValueError("must be at least one name")
    return names


def _help(text: str) -> str:
    return text.rstrip(".").replace("%", "%%")


def _kind(hint: object, metavar: str) -> Callable[[str], object]:
    """Return what reads an argument of a type."""
    kinds = [one for part in (hint, *get_args(hint)) for one in (part, *get_args(part))]
    if metavar == "TIME" and str not in kinds:  # a job that takes words reads them itself
        return timebase.parse_duration
    if Path in kinds and "NAME" not in metavar:
        return Path
    return next((kind for kind in (float, int) if kind in kinds and str not in kinds), str)


def reader(read: Callable[[str], object]) -> Callable[[str], object]:
    """Return a reader whose complaint argparse prints."""
    if read in (str, int, float, Path):
        return read

    def convert(words: str) -> object:
        try:
            return read(words)
        except (ValueError, ImuSimError) as error:
            raise ArgumentTypeError(str(error)) from None

    return convert
