# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all pictures have in common."""

import pytest

from imu_sim_ros.plots import style


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.0, 3.0], ["1", "2"]),
        ([0.01, 0.3], ["0.01", "0.02", "0.05", "0.1", "0.2"]),
        ([1e-5, 1.0], [f"$\\mathdefault{{10^{{{power}}}}}$" for power in range(-5, 1)]),
    ],
)
def test_numbers_of_a_narrow_logarithmic_axis_are_plain(values, expected):
    figure, (axes,) = style.panels(1, 1)
    axes.plot([1.0, 2.0], values)
    style.log_values(axes)
    figure.canvas.draw()
    low, high = axes.get_ylim()
    ticks = [*axes.yaxis.get_major_ticks(), *axes.yaxis.get_minor_ticks()]
    shown = sorted(
        (tick.get_loc(), tick.label1.get_text())
        for tick in ticks
        if low <= tick.get_loc() <= high and tick.label1.get_text()
    )
    assert [text for _, text in shown] == expected
