# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors that a user can cause; everything else is a bug and shows its traceback."""

from collections.abc import Iterable


class ImuSimError(Exception):
    """Root of the package's own errors; ``problems`` has one line for each thing that is wrong."""

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (
            (problems,) if isinstance(problems, str) else tuple(problems)
        )
        super().__init__("\n".join(self.problems))


class ConfigurationError(ImuSimError):
    """Parameters that cannot be used: unknown names, wrong types, values out of range."""


class InputError(ImuSimError):
    """Input data or an output place that cannot be used: a bag, a trajectory file, a folder."""


class MissingDependencyError(ImuSimError):
    """An optional library that is wanted and not installed; the text says how to get it."""
