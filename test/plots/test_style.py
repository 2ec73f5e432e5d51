# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Properties common to all pictures."""

import numpy as np
import pytest
from matplotlib.legend import Legend
from matplotlib.text import Text

import imu_sim_ros as ims
from imu_sim_ros.plots import calibration, style


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


def pixels(own_ticks: bool, top: float) -> np.ndarray:
    figure, (axes,) = style.panels(1, 1)
    axes.loglog([0.005, 3000.0], [1e-4, top])
    if own_ticks:
        axes.grid(True, which="minor", color="#EEEEEE", linewidth=0.4)
    else:
        style.small_ticks(axes)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba()).astype(int)


@pytest.mark.parametrize("top", [2e-4, 3e-1])
def test_small_ticks_look_like_those_of_matplotlib(top):
    """Below a decade they are; above, lines of a few grey levels cross in another order."""
    difference = np.abs(pixels(True, top) - pixels(False, top)).max(axis=2)
    assert difference.max() <= 16
    assert np.count_nonzero(difference) < 0.01 * difference.size


def test_a_saved_picture_is_as_savefig_writes_it(tmp_path):
    paths = tmp_path / "own.png", tmp_path / "theirs.png"
    for path in paths:
        figure, (axes,) = style.panels(1, 1)
        axes.plot([1.0, 2.0], label="line")
        axes.legend()
        if path is paths[0]:
            style.save(figure, path)
            assert figure.dpi == 100.0
        else:
            figure.savefig(path, dpi=130)
    saved, expected = (path.read_bytes() for path in paths)
    assert saved == expected


@pytest.mark.parametrize("ending", ["svg", "pdf", "png"])
def test_an_evaluation_hides_no_curve_and_its_truth_is_thin(tmp_path, ending):
    """Legends lie outside the axes, and no title lies over them."""
    flight = ims.simulate(imu="adis16448", trajectory="circle", duration=5)
    picture = ims.evaluate(ims.dead_reckon(flight), flight.truth, align="yaw").plot("circle")
    assert "aligned in yaw" in picture._suptitle.get_text()
    style.save(picture, tmp_path / f"picture.{ending}")
    renderer = picture.canvas.get_renderer()
    legends = [axes for axes in picture.axes if axes.get_legend() is not None]
    assert len(legends) == 3
    for axes in legends:
        legend = axes.get_legend().get_window_extent(renderer)
        assert not legend.overlaps(axes.patch.get_window_extent(renderer).padded(-1.0))
        if axes.get_title(loc="left"):
            titles = [text for text in axes.get_children() if isinstance(text, Text)]
            shown = [text.get_window_extent(renderer) for text in titles if text.get_text()]
            assert shown
            assert not any(legend.overlaps(box) for box in shown)
    truth = next(line for line in picture.axes[0].get_lines() if line.get_label() == "truth")
    assert truth.get_linewidth() < 1.0
    assert picture.axes[2].get_ylabel() == "position, estimate - truth [m]"


def pictures():
    """Yield the picture of each analysis by name, from short records."""
    rest = ims.simulate(imu="lecture", trajectory="static", duration=120.0, seed=1)
    yield "allan", ims.allan(rest).plot()
    for name, trajectory, options in (
        ("six_position", "six_position", {}),
        ("turntable", "turntable", {"rates": [0.5, 1.0, 2.0]}),
        ("temperature", "temperature_soak", {"rates": [1.0], "reference": 25.0}),
        ("magnetometer", "tumble", {}),
    ):
        magnetic = {"sensors": ["magnetic_field"], "duration": 20.0}
        record = ims.simulate(
            imu="mpu9250",
            trajectory=trajectory,
            rate=50.0,
            seed=1,
            **(magnetic if name == "magnetometer" else {}),
        )
        yield name, getattr(ims, f"calibrate_{name}")(record, **options).plot()
    rng = np.random.default_rng(1)
    t = np.arange(2000) / 200.0
    series = [(t, rng.normal(size=(2000, 6))) for _ in range(2)]
    yield "twin", calibration.draw_spectra(*series, 200.0, "flight.bag")


def test_no_legend_lies_over_a_curve_or_a_title():
    for name, picture in pictures():
        picture.canvas.draw()
        renderer = picture.canvas.get_renderer()
        titles = [text for axes in picture.axes for text in axes.get_children()]
        titles = [text for text in titles if isinstance(text, Text) and text.get_text()]
        boxes = [text.get_window_extent(renderer) for text in (*titles, picture._suptitle)]
        panels = [axes.patch.get_window_extent(renderer).padded(-1.0) for axes in picture.axes]
        legends = [
            child.get_window_extent(renderer)
            for axes in picture.axes
            for child in axes.get_children()
            if isinstance(child, Legend)
        ]
        assert legends, name
        for legend in legends:
            assert not any(legend.overlaps(box) for box in (*boxes, *panels)), name
