"""What all tests share."""

import pytest


def pytest_collection_modifyitems(items):
    """Give tests with real processes a second try; the closing line counts it as a rerun.

    Discovery and scheduling on a busy machine are not the nodes' own; what is wrong in the nodes
    themselves fails twice.
    """
    for item in items:
        if "nodes" in item.path.parts or item.path.name == "test_demo.py":
            item.add_marker(pytest.mark.flaky(reruns=1))
