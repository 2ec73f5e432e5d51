# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a parameter is described once and read from anywhere.

A section is a frozen dataclass whose fields are made by the functions of ``kinds``; each field
carries its unit, range and text. From that one description come the checks, the declaration of ROS
parameters, the arguments' help and the reference in the documentation. Sections nest, see
``sections``; names are joined by dots. Imports errors, and inputs where a list comes as a string.
"""

from imu_sim_ros.config.parameter.kinds import (
    EMPTY_LIST,
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Parameter,
    Value,
    Vector,
    choice,
    entries,
    flag,
    integer,
    matrix,
    number,
    numbers,
    text,
    texts,
    vector,
)
from imu_sim_ros.config.parameter.sections import (
    OF_EVERY_NODE,
    bad_values,
    build,
    flatten,
    is_of_ros,
    parameters,
    parse,
    section,
    section_names,
    unknown,
    variant,
)

__all__ = [
    "EMPTY_LIST",
    "IDENTITY_MATRIX",
    "OF_EVERY_NODE",
    "ZERO_MATRIX",
    "ZERO_VECTOR",
    "Matrix",
    "Parameter",
    "Value",
    "Vector",
    "bad_values",
    "build",
    "choice",
    "entries",
    "flag",
    "flatten",
    "integer",
    "is_of_ros",
    "matrix",
    "number",
    "numbers",
    "parameters",
    "parse",
    "section",
    "section_names",
    "text",
    "texts",
    "unknown",
    "variant",
    "vector",
]
