# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bridge between a section of parameters and the parameters of a ROS node."""

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar
from weakref import WeakSet

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.random_streams import seed_of_node
from imu_sim_ros.nodes.help import parameters_of_other_nodes
from imu_sim_ros.nodes.lifetime import Lifetime
from imu_sim_ros.parameters.files import Layering, build_from_layers
from imu_sim_ros.parameters.kinds import Parameter, Value
from imu_sim_ros.parameters.sections import (
    build,
    flatten,
    is_of_ros,
    parameters,
    unknown_parameter_line,
)

_TYPES = {
    "number": RosParameter.Type.DOUBLE,
    "integer": RosParameter.Type.INTEGER,
    "flag": RosParameter.Type.BOOL,
    "text": RosParameter.Type.STRING,
    "choice": RosParameter.Type.STRING,
    "vector": RosParameter.Type.DOUBLE_ARRAY,
    "gravity": RosParameter.Type.DOUBLE_ARRAY,
    "matrix": RosParameter.Type.DOUBLE_ARRAY,
    "numbers": RosParameter.Type.DOUBLE_ARRAY,
    "texts": RosParameter.Type.STRING_ARRAY,
}


_Section = TypeVar("_Section")
_seeded: "WeakSet[ConfiguredNode[Any]]" = WeakSet()
"""The nodes of this process that have a seed."""

_TYPES_OF_ROS = frozenset(parameter_type.value for parameter_type in RosParameter.Type)


class ConfiguredNode(Node, Generic[_Section]):
    """A node whose parameters are those of a section, described and checked in one place.

    Values come from ``--ros-args`` (``-p``, ``--params-file``) as ROS matches them to the node.
    Types are those of the section, not of ROS: an integer is accepted for a float, a number for a
    vector, and a list as a string, to which ``ros2 param set`` converts ``[0.1, 0, 0]``. The
    parameter always holds the section's own type. Parameters that are not ``live`` are read-only.
    A change is checked as a whole and takes effect as a whole, through :meth:`apply`.
    """

    def __init__(
        self,
        name: str,
        section: type[_Section],
        layering: Layering = lambda values, _: values,
        **arguments: Any,
    ) -> None:
        """Declare all parameters.

        :param name: the node's name, which a remapping may change.
        :param section: frozen dataclass made of the functions in ``parameters.kinds``.
        :param layering: layers the given values over others, such as those of a preset.
        :raises ConfigurationError: with a line for every unknown name and every bad value.
        """
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **arguments)
        overrides = self._take_overrides()
        self.section = section
        if "seed" in parameters(self.section):  # no two nodes of a graph have the same noise
            overrides.setdefault("seed", seed_of_node(self.get_fully_qualified_name()))
        # Arguments such as -p seed:=3 are those of all nodes in a process.
        for other_name in parameters_of_other_nodes(self.section, overrides):
            del overrides[other_name]
            self.get_logger().warning(
                f"{other_name}: is a parameter of another node; no effect here"
            )
        self.changed: frozenset[str] = frozenset()
        self.lifetime = Lifetime(self)
        self.overrides: dict[str, object] = overrides
        self.parameters = build_from_layers(self.section, layering, overrides)
        if "seed" in overrides:
            self._warn_of_the_same_seed(overrides["seed"])
        values = flatten(self.parameters)
        self._known = parameters(self.section, values)
        self._declare(values)
        self.add_on_set_parameters_callback(self._on_set)

    def close(self) -> None:
        """End threads and close files; called once, at any end."""

    def destroy_node(self) -> None:
        """Destroy the node, as ``rclpy.node.Node.destroy_node``."""
        _seeded.discard(self)
        super().destroy_node()  # type: ignore[no-untyped-call]

    def _warn_of_the_same_seed(self, seed: object) -> None:
        """Warn of nodes of this process with the same noise, as with ``-p seed:=3`` for all."""
        sharers = [
            node.get_fully_qualified_name() for node in _seeded if node.overrides["seed"] == seed
        ]
        _seeded.add(self)
        if sharers:
            self.get_logger().warning(
                f"seed = {seed}: {', '.join(sorted(sharers))} in this process has it, too: the "
                "same sensors have identical noise; without seed, each node has one of its own"
            )

    def get_logger(self) -> Any:
        """Return the node's logger; rclpy's own method has no type annotation."""
        return super().get_logger()  # type: ignore[no-untyped-call]

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any], **options: Any
    ) -> Any:
        """Create a service; those of rclpy that set parameters refuse values of unknown types.

        An exception of a callback would end the node.
        """
        if srv_type is SetParameters:
            callback = functools.partial(_set_each, callback)
        elif srv_type is SetParametersAtomically:
            callback = functools.partial(_set_all, callback)
        return super().create_service(srv_type, srv_name, callback, **options)

    def apply(self, parameters: _Section) -> None:
        """Apply new valid parameters; a subclass may still refuse them.

        ``self.changed`` holds the names that were set, even to the value that they had.

        :raises ConfigurationError: for errors that only the running node can detect; nothing is
            changed.
        """

    def replace(self, section: _Section) -> None:
        """Set parameters that the node has determined itself, read-only ones as well."""
        previous = flatten(self.parameters)
        self.parameters = section
        for name, value in flatten(section).items():
            if name in self._known and value != previous[name]:
                self._parameters[name] = RosParameter(name, value=_to_ros(value))

    def _take_overrides(self) -> dict[str, object]:
        """Return the command line's values, and undeclare the parameters of them."""
        overrides: dict[str, object] = {}
        for name, parameter in self.get_parameters_by_prefix("").items():
            if not is_of_ros(name):
                overrides[name] = python_value(parameter)  # type: ignore[arg-type]  # rclpy says: of values
                self.undeclare_parameter(name)
        return overrides

    def _declare(self, values: Mapping[str, Value]) -> None:
        """Declare the parameters that the node has not declared yet."""
        declared = self._known
        empty = [name for name, value in values.items() if value == ()]
        self.declare_parameters(
            "",
            [
                (name, _to_ros(values[name]), describe(parameter))
                for name, parameter in declared.items()
                if name not in empty
            ],
            ignore_override=True,
        )
        for name in empty:  # ROS could not infer their type
            self.declare_parameter(
                name, "", ParameterDescriptor(dynamic_typing=True), ignore_override=True
            )
            super().set_parameters_atomically([to_ros(name, declared[name], ())])
            self.set_descriptor(name, describe(declared[name]))

    def set_parameters_atomically(
        self, parameter_list: Iterable[RosParameter]
    ) -> SetParametersResult:
        """Set parameters in their own types; a refusal gives every reason, not only the first."""
        changes, problems = [], Problems()
        for change in parameter_list:
            parameter = self._known.get(change.name)
            with problems.collect():
                if parameter is None and not self.has_parameter(change.name):
                    problems.append(unknown_parameter_line(change.name, self._known))
                elif parameter is None:
                    changes.append(change)
                elif not parameter.live:
                    problems.append(f"{change.name} is read-only: it is fixed when the node starts")
                else:
                    value = parameter.parse(change.name, python_value(change))
                    changes.append(to_ros(change.name, parameter, value))
        if problems:
            return SetParametersResult(successful=False, reason="; ".join(problems))
        return super().set_parameters_atomically(changes)

    def _on_set(self, changes: list[RosParameter]) -> SetParametersResult:
        """Check parameters that are set at run time, and apply them if all are valid."""
        values = {
            change.name: python_value(change) for change in changes if change.name in self._known
        }
        if not values:
            return SetParametersResult(successful=True)
        try:
            self.changed = frozenset(values)
            section = build(self.section, {**flatten(self.parameters), **values})
            self.apply(section)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason="; ".join(error.problems))
        self.parameters = section
        return SetParametersResult(successful=True)


def _set_each(
    callback: Callable[[SetParameters.Request, SetParameters.Response], SetParameters.Response],
    request: SetParameters.Request,
    response: SetParameters.Response,
) -> SetParameters.Response:
    """Answer SetParameters: one result for each parameter."""
    for parameter in request.parameters:
        refused = _refuse_unknown_types([parameter])
        if refused is not None:
            response.results.append(refused)
        else:
            single = SetParameters.Request(parameters=[parameter])
            response.results += callback(single, SetParameters.Response()).results
    return response


def _set_all(
    callback: Callable[
        [SetParametersAtomically.Request, SetParametersAtomically.Response],
        SetParametersAtomically.Response,
    ],
    request: SetParametersAtomically.Request,
    response: SetParametersAtomically.Response,
) -> SetParametersAtomically.Response:
    """Answer SetParametersAtomically: one result for all."""
    refused = _refuse_unknown_types(request.parameters)
    if refused is None:
        return callback(request, response)
    response.result = refused
    return response


def _refuse_unknown_types(messages: Iterable[ParameterMessage]) -> SetParametersResult | None:
    """Return the refusal of values whose type is none of ROS; None: there are none."""
    bad = [message for message in messages if message.value.type not in _TYPES_OF_ROS]
    reasons = [
        f"{message.name}: a value of the unknown type {message.value.type}" for message in bad
    ]
    return SetParametersResult(successful=False, reason="; ".join(reasons)) if bad else None


def python_value(parameter: RosParameter) -> object:
    """Return a ROS parameter's value in plain Python; for ROS an empty list is one of bytes."""
    value = parameter.value
    return tuple(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value


def to_ros(name: str, parameter: Parameter, value: Value) -> RosParameter:
    """Return a value as a ROS parameter of its declared type, also if it is an empty list."""
    return RosParameter(name, _TYPES[parameter.kind], _to_ros(value))


def _to_ros(value: Value) -> object:
    """Return a value as ROS takes it: lists, no tuples."""
    return list(value) if isinstance(value, tuple) else value


def describe(parameter: Parameter) -> ParameterDescriptor:
    """Return the descriptor that `ros2 param describe` and rqt show."""
    return ParameterDescriptor(
        type=_TYPES[parameter.kind].value,
        description=f"{parameter.text} [{parameter.unit}]" if parameter.unit else parameter.text,
        additional_constraints=parameter.allowed_text()
        + ("" if parameter.live else "; fixed when the node starts"),
        read_only=not parameter.live,
    )
