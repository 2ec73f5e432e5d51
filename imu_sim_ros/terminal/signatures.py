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
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, TypeVar, get_args, get_origin

from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.spelling import use_spelling
from imu_sim_ros.parameters.yaml_text import parse_yaml


class Text(str):
    """Help text of an argument that several jobs share, or that lists names."""


class Heading(str):
    """Heading of a group of arguments in ``--help``."""


Result = TypeVar("Result")
_NONE: Mapping[str, object] = {}
_PARAM: Final = re.compile(r"^:param (\w+): (.*?)(?=^:|^$|\Z)", re.MULTILINE | re.DOTALL)
"""Description of a parameter in the docstring of a job."""
_LITERAL: Final = re.compile(r"``(.*?)``")
"""Literal text in a description; the name of a parameter becomes its option."""


def arguments_of(job: Callable[..., object]) -> dict[str, dict[str, object]]:
    """Return the arguments of a job's program, as ``add_options`` of the programs takes them.

    A value that is not given is None, so that the job's own default holds.
    """
    arguments = _arguments(job)
    options = _options(arguments)
    descriptions = {
        name: _LITERAL.sub(lambda literal: options.get(literal[1], literal[1]), text)
        for name, text in _PARAM.findall(inspect.getdoc(job) or "")
    }
    return {
        argument.form: argument.keywords(" ".join(descriptions.get(argument.name, "").split()))
        for argument in arguments
    }


def call_job(
    job: Callable[..., Result],
    namespace: Namespace,
    defaults: Mapping[str, object] = _NONE,
    overrides: Mapping[str, object] = _NONE,
) -> Result:
    """Return the result of a job, called with the arguments of its program.

    :param namespace: values from the parser of the program.
    :param defaults: parameters by name, such as those of files, over which the arguments win.
    :param overrides: parameters that win over the arguments, such as those of ``--set``.
    :raises ImuSimError: of the job; its lines name the options.
    """
    arguments, values_by_name = _arguments(job), vars(namespace)
    options = _options(arguments)
    # A parameter of ROS has the name of the option: initial_state for --initial-state.
    names = {option.strip("-").replace("-", "_"): name for name, option in options.items()}
    defaults, overrides = (
        {names.get(name, name): value for name, value in layer.items()}
        for layer in (defaults, overrides)
    )
    values, overridden = dict[str, object](), set(overrides)
    for argument in arguments:
        value = values_by_name[argument.name]
        if argument.is_mapping:
            value = dict(value or ())
        if argument.is_rest:
            overridden |= value.keys()
        if value not in (None, {}):
            values[argument.name] = value
    typed = (values.keys() & options.keys()) - overridden
    with use_spelling("program", options, typed):
        return job(**{**defaults, **values, **overrides})


def parse_assignment(text: str) -> tuple[str, object]:
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


class _Argument:
    """Argument of a program, as a parameter of its job declares it."""

    def __init__(self, parameter: inspect.Parameter) -> None:
        """Read an annotated parameter."""
        self.name, self._default = parameter.name, parameter.default
        self._type, *self._marks = get_args(parameter.annotation)
        form = next((mark for mark in self._marks if type(mark) is str), "")
        self.is_option = form.startswith("-") or self._default is not parameter.empty
        """True if its name is written before its value: ``--skip 2s``."""
        if not form.startswith("-"):
            name = self.name.replace("_", "-")
            form = f"--{name} {form}" if self.is_option else f"{self.name} {form}"
        self.form = form
        """Names and metavariable: ``estimate ESTIMATE``, ``-o --output FILE``, ``--json``."""
        self._metavariable = form.split()[-1]
        self.is_mapping = "=" in form
        """True if its value is a dictionary, written ``NAME=VALUE``."""
        self.is_rest = parameter.kind is parameter.VAR_KEYWORD
        """True if its value is a dictionary of further parameters of the job."""
        self._is_required = self._default is parameter.empty and not self.is_rest

    @property
    def option(self) -> str:
        """The long name of an option: ``--output``."""
        return [name for name in self.form.split() if name.startswith("--")][-1]

    def keywords(self, description: str) -> dict[str, object]:
        """Return its keywords for argparse, and ``group``, the heading above it in the help.

        :param description: its description in the docstring of the job.
        """
        keywords: dict[str, object] = {"dest": self.name} if self.is_option else {}
        heading = next((mark for mark in self._marks if isinstance(mark, Heading)), None)
        if heading is not None:
            keywords["group"] = heading
        text = next((mark for mark in self._marks if isinstance(mark, Text)), description)
        if isinstance(self._default, bool):
            action = "store_false" if self._default else "store_true"
            keywords |= {"action": action, "default": None}
        else:
            keywords |= {**self._occurrence(), **self._values()}
            text = self._append_default(text)
        return {**keywords, "help": text.rstrip(".").replace("%", "%%")}

    def _occurrence(self) -> dict[str, object]:
        """Return the keywords for how often it occurs."""
        keywords: dict[str, object] = {}
        if self.is_option and self._is_required:
            keywords["required"] = True
        alternatives = (self._type, *get_args(self._type))
        is_sequence = any(get_origin(alternative) is Sequence for alternative in alternatives)
        if (is_sequence and not self._is_list) or self.is_mapping:
            keywords |= {"action": "append"} if self.is_option else {"nargs": "+"}
        return keywords

    def _values(self) -> dict[str, object]:
        """Return the keywords for the values that it takes."""
        for mark in self._marks:
            if isinstance(mark, tuple | list):
                return {"choices": mark, "metavar": None}
        functions = [mark for mark in self._marks if callable(mark)]
        parse = _names if self._is_list else functions[0] if functions else self._parser_of_type()
        return {"type": reader(parse)}

    @property
    def _is_list(self) -> bool:
        """True for several names in one value: ``--topics imu,gps``."""
        return self._metavariable.endswith(",...")

    def _parser_of_type(self) -> Callable[[str], object]:
        """Return the function that parses a value of its type."""
        types = [
            part
            for alternative in (self._type, *get_args(self._type))
            for part in (alternative, *get_args(alternative))
        ]
        if self._metavariable == "TIME" and str not in types:  # texts are left to the job
            return timebase.parse_duration
        if Path in types and "NAME" not in self._metavariable:
            return Path
        return next((kind for kind in (float, int) if kind in types and str not in types), str)

    def _append_default(self, text: str) -> str:
        """Return a help text with the default of the job's signature, unless it states one."""
        default = self._default
        if not isinstance(default, str | int | float) or default == "" or "default" in text:
            return text
        if not isinstance(default, str):
            default = f"{default:g}{'s' if self._metavariable == 'TIME' else ''}"
        return f"{text.removesuffix(' [s]')} (default: {default})"


def _arguments(job: Callable[..., object]) -> list[_Argument]:
    """Return the arguments of a job's program, in the order of the signature."""
    parameters = inspect.signature(job, eval_str=True).parameters.values()
    return [
        _Argument(parameter)
        for parameter in parameters
        if get_origin(parameter.annotation) is Annotated
    ]


def _options(arguments: Sequence[_Argument]) -> dict[str, str]:
    """Return the long names of options by the names of the job's parameters."""
    return {argument.name: argument.option for argument in arguments if argument.is_option}


def _names(text: str) -> list[str]:
    """Return the names in ``NAME,...``.

    :raises ValueError: if there is none.
    """
    names = [name for name in map(str.strip, text.split(",")) if name]
    if not names:
        raise ValueError("must be at least one name")
    return names


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
