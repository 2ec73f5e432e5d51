# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stray stamps live and in a file."""

import numpy as np
import pytest

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveValue
from imu_sim_ros.recordings import live_strays
from imu_sim_ros.recordings.findings.live import StampWatch
from imu_sim_ros.recordings.live_order import Gaps
from imu_sim_ros.recordings.live_strays import LiveStrays
from imu_sim_ros.recordings.order import order_stamps

T0 = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def pass_on(t_ns) -> tuple[list[int], list[str]]:
    """Return the stamps that come out one by one and at the end, and the lines."""
    lines: list[str] = []
    strays = LiveStrays[LiveValue](lines.append)
    passed = [m for stamp in t_ns.tolist() for m in strays.apply([LiveValue(stamp, ())])]
    return [message.t_ns for message in [*passed, *strays.finish()]], lines


def even(rate: float, count: int = 300) -> np.ndarray:
    return T0 + np.round(np.arange(count) * 1e9 / rate).astype(np.int64)


@pytest.mark.parametrize("number", [1, 2, 4])
@pytest.mark.parametrize("shift", [None, 3600, -3600, 30_000_000, -1_600_000_000, 5, -5])
@pytest.mark.parametrize("rate", [1.0, 10.0, 200.0, 2000.0])
def test_stray_stamps_are_left_out_live_as_in_a_file(rate, shift, number):
    """Zero (None), or some seconds away; at the start, in the middle, at the end."""
    for row in (0, 100, 300 - number):
        t_ns = even(rate)
        rows = slice(row, row + number)
        t_ns[rows] = 0 if shift is None else t_ns[rows] + shift * SECOND
        order = order_stamps(t_ns)
        assert not len(order.resets)
        # A pause behind the first of a recording or before the last of it is possible.
        pause = {0: (-3600, -5), 100: ()}.get(row, (3600, 5))
        if shift not in pause:
            assert order.strays.tolist() == list(range(row, row + number))
        passed, lines = pass_on(t_ns)
        assert passed == t_ns[np.sort(np.concatenate(order.pieces))].tolist()
        assert len(lines) == min(len(order.strays), 3)


@pytest.mark.parametrize("ahead", [0.3, 0.9])
def test_a_stamp_that_is_ahead_by_less_than_a_loss_is_no_reset(ahead):
    t_ns = even(200.0)
    t_ns[150] += round(ahead * 1e9)
    order = order_stamps(t_ns)
    assert (order.strays.tolist(), order.resets.tolist()) == ([150], [])
    assert pass_on(t_ns)[0] == np.delete(t_ns, 150).tolist()


@pytest.mark.parametrize("step", [3600.0, -30.0, 0.3])
def test_another_time_goes_on_after_five_messages(step):
    t_ns = even(200.0)
    t_ns[150:] += round(step * 1e9)
    strays = LiveStrays[LiveValue](lambda line: pytest.fail(line))
    counts = [len(strays.apply([LiveValue(stamp, ())])) for stamp in t_ns.tolist()]
    assert counts[148:157] == [1, 1, 0, 0, 0, 0, 5, 1, 1]
    assert sum(counts) == 300


def test_a_source_that_waits_for_an_answer_gets_one(monkeypatch):
    time_s = 0.0
    monkeypatch.setattr(live_strays.time, "monotonic", lambda: time_s)
    strays = LiveStrays[LiveValue](lambda line: pytest.fail(line))
    message = LiveValue(T0, ())
    assert strays.apply([message]) == strays.release() == []
    time_s = 0.6
    assert strays.release() == [message]
    assert strays.release() == []


@pytest.mark.parametrize(("divisor", "unit"), [(1000, "us"), (1_000_000, "ms")])
def test_stamps_in_another_unit_are_refused_until_they_are_nanoseconds(divisor, unit):
    watch = StampWatch()
    for k, stamp in enumerate((even(200.0) // divisor).tolist()):
        if k < 31:
            watch.add(stamp)
            continue
        with pytest.raises(InputError, match=f"they are in {unit}: 200 Hz"):
            watch.add(stamp)
    passed = 0
    for stamp in even(200.0).tolist():
        try:
            watch.add(stamp)
            passed += 1
        except InputError:
            assert not watch.done
    assert watch.done
    assert passed > 200


def test_equal_stamps_are_refused_behind_another_until_they_differ():
    watch = StampWatch()
    for stamp in [5, *[0] * 1023]:
        watch.add(stamp)
    with pytest.raises(InputError, match="all 1,024 stamps are 0 ns"):
        watch.add(0)
    for stamp in even(200.0)[:32].tolist():
        watch.add(stamp)
    assert watch.done


@pytest.mark.parametrize("rate", [300.7, 700.0, 950.0, 997.0, 1003.0, 1700.0])
def test_whole_milliseconds_are_no_losses(rate):
    t_ns = np.unique(even(rate, 4000) // 1_000_000 * 1_000_000)
    gaps = Gaps(1e9 / min(rate, 1000.0), 10.0 * SECOND)
    parts = [part for begin in range(0, len(t_ns), 7) for part in gaps.parts(t_ns[begin:][:7])]
    assert {missing for _, missing, _ in parts} == {0}


@pytest.mark.parametrize("rate", [300.7, 700.0, 950.0])
def test_losses_among_whole_milliseconds_are_counted(rate):
    t_ns = np.delete(even(rate, 2000), [*range(100, 1900, 100), 1950, 1951])
    gaps = Gaps(1e9 / rate, 10.0 * SECOND)
    parts = gaps.parts(t_ns // 1_000_000 * 1_000_000)
    # A loss is told unless rounding hides it.
    assert 17 <= sum(missing for _, missing, _ in parts) <= 20
