# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the tests are shared out where pytest-xdist runs them in two processes."""

from pathlib import Path

import pytest

_REAL_PROCESSES = (Path("test/nodes"), Path("test/commands/test_demo.py"))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests with real nodes mostly wait: they come first, one after the other, beside the others.

    All others stay together by file, whose fixtures they share.
    """

    def group(item: pytest.Item) -> str:
        path = item.path.relative_to(config.rootpath)
        waits = any(path.is_relative_to(place) for place in _REAL_PROCESSES)
        return "" if waits else str(path)

    items.sort(key=lambda item: group(item) != "")
    for item in items:
        item.add_marker(pytest.mark.xdist_group(group(item) or "nodes"))
