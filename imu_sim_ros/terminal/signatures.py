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
from typing import Annotated, TypeVar, get_args, get_origin

from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.spelling import spelled_for
from imu_sim_ros.parameters.yaml_text import parse_yaml


class Text(str):
    """Help text of an argument that several jobs share, or that lists names."""


class Heading(str):
    """Heading of a group of arguments in ``--help``."""


Result = TypeVar("Result")
_NONE: Mapping[str, object] = {}
_REST = inspect.Parameter.VAR_KEYWORD


def arguments_of(job: Callable[..., object]) -> dict[str, dict[str, object]]:
    """Return the arguments of a job's program, as ``add_options`` of the programs takes them.

    A value that is not given is None, so that the job's own default holds.
    """
    texts = _texts(job)
    return {
        _written(parameter): _keywords(parameter, texts.get(parameter.name, ""))
        for parameter in _parameters(job)
    }


def call(
    job: Callable[..., Result],
    arguments: Namespace,
    defaults: Mapping[str, object] = _NONE,
    overrides: Mapping[str, object] = _NONE,
) -> Result:
    """Return the result of a job, called with the arguments of its program.

    :param defaults: parameters by name, such as those of files, over which the arguments win.
    :param overrides: parameters that win over the arguments, such as those of ``--set``.
    :raises ImuSimError: of the job; its lines name the options.
    """
    job_parameters = list(_parameters(job))
    options_and_inputs = vars(arguments)
    values = {parameter.name: options_and_inputs[parameter.name] for parameter in job_parameters}
    values |= {
        parameter.name: dict(values[parameter.name] or ())
        for parameter in job_parameters
        if _has_pairs(parameter)
    }
    arguments_by_name = {name: value for name, value in values.items() if value not in (None, {})}
    options = {
        parameter.name: [word for word in _written(parameter).split() if word[:2] == "--"][-1]
        for parameter in job_parameters
        if _is_option(parameter)
    }
    # A parameter of ROS has the name of the option: initial_state for --initial-state.
    names = {option.strip("-").replace("-", "_"): name for name, option in options.items()}
    defaults, overrides = (
        {names.get(name, name): value for name, value in layer.items()}
        for layer in (defaults, overrides)
    )
    overridden = {
        *overrides,
        *(
            name
            for parameter in job_parameters
            if parameter.kind is _REST
            for name in values[parameter.name]
        ),
    }
    typed = (arguments_by_name.keys() & options.keys()) - overridden
    with spelled_for("program", options, typed):
        return job(**{**defaults, **arguments_by_name, **overrides})


def assignment(text: str) -> tuple[str, object]:
    """Return name and value of ``key=value``; the value is YAML, none an empty string.

    :raises ValueError: for anything else.
    """
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"{text!r} is not of the form key=value")
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
    descriptions = re.findall(
        r"^:param (\w+): (.*?)(?=^:|^$|\Z)", inspect.getdoc(job) or "", re.MULTILINE | re.DOTALL
    )
    return {name: " ".join(text.replace("``", "").split()) for name, text in descriptions}


def _is_option(parameter: inspect.Parameter) -> bool:
    """Return whether an argument begins with dashes."""
    return parameter.default is not parameter.empty or _mark(parameter).startswith("-")


def _mark(parameter: inspect.Parameter) -> str:
    """Return the form of an argument on the command line, from its annotation."""
    return next((m for m in parameter.annotation.__metadata__ if type(m) is str), "")


def _written(parameter: inspect.Parameter) -> str:
    """Return names and metavariable: ``estimate ESTIMATE``, ``-o --output FILE``, ``--json``."""
    form = _mark(parameter)
    if form.startswith("-"):
        return form
    name = parameter.name.replace("_", "-")
    return f"--{name} {form}" if _is_option(parameter) else f"{parameter.name} {form}"


def _has_pairs(parameter: inspect.Parameter) -> bool:
    """Return whether an argument is a dictionary, written ``NAME=VALUE``."""
    return "=" in _mark(parameter)


def _keywords(parameter: inspect.Parameter, text: str) -> dict[str, object]:
    """Return the keywords of argparse for a parameter.

    :param text: description of the parameter in the docstring.
    """
    hint, *marks = get_args(parameter.annotation)
    default, option = parameter.default, _is_option(parameter)
    metavar = _written(parameter).split()[-1]
    keywords: dict[str, object] = {"dest": parameter.name} if option else {}
    if (group := next((m for m in marks if isinstance(m, Heading)), None)) is not None:
        keywords["group"] = group
    text = next((m for m in marks if isinstance(m, Text)), text)
    if isinstance(default, bool):
        action = "store_false" if default else "store_true"
        return {**keywords, "action": action, "default": None, "help": _help(text)}
    if option and default is parameter.empty and parameter.kind is not _REST:
        keywords["required"] = True
    in_one = metavar.endswith(",...")
    several = (
        any(get_origin(annotation) is Sequence for annotation in (hint, *get_args(hint)))
        and not in_one
    )
    if several or _has_pairs(parameter):
        keywords |= {"action": "append"} if option else {"nargs": "+"}
    if (choices := next((m for m in marks if isinstance(m, tuple | list)), None)) is not None:
        keywords |= {"choices": choices, "metavar": None}
    else:
        convert = _words if in_one else next((m for m in marks if callable(m)), None)
        keywords["type"] = reader(convert or _kind(hint, metavar))
    if isinstance(default, str | int | float) and default != "" and "default" not in text:
        number = "" if isinstance(default, str) else f"{default:g}"
        unit = "s" if number and metavar == "TIME" else ""
        text = f"{text.removesuffix(' [s]')} (default: {number or default}{unit})"
    return {**keywords, "help": _help(text)}


def _words(text: str) -> list[str]:
    """Return the names in ``NAME,...``.

    :raises ValueError: if there is none.
    """
    names = [name for name in map(str.strip, text.split(",")) if name]
    if not names:
        raise ValueError("must be at least one name")
    return names


def _help(text: str) -> str:
    """Return a docstring's text as argparse takes it."""
    return text.rstrip(".").replace("%", "%%")


def _kind(hint: object, metavar: str) -> Callable[[str], object]:
    """Return the function that parses an argument of a type."""
    kinds = [
        part
        for annotation in (hint, *get_args(hint))
        for part in (annotation, *get_args(annotation))
    ]
    if metavar == "TIME" and str not in kinds:  # a job that takes words reads them itself
        return timebase.parse_duration
    if Path in kinds and "NAME" not in metavar:
        return Path
    return next((kind for kind in (float, int) if kind in kinds and str not in kinds), str)


def reader(parse: Callable[[str], object]) -> Callable[[str], object]:
    """Return a parser whose errors argparse prints."""
    if parse in (str, int, float, Path):
        return parse

    def convert(text: str) -> object:
        try:
            return parse(text)
        except (ValueError, ImuSimError) as error:
            raise ArgumentTypeError(str(error)) from None

    return convert
