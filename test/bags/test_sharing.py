# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that the parts of a program share: each is open once, and reads the same for all of them."""

import shutil

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.files import open_bag
from imu_sim_ros.bags.sharing import bags_opened_once


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Two seconds in each kind of bag."""
    folder = tmp_path_factory.mktemp("bags")
    flight = ims.simulate(imu="lecture", trajectory="figure_eight", rate=500, duration=2.0, seed=1)
    for name in ("a.mcap", "b.bag", "c"):
        flight.save(folder / name)
    ims.convert(folder / "a.mcap", folder / "d", storage="sqlite3")
    return folder


def stamps(bag):
    """Record times of all messages, group by group."""
    return [np.concatenate([block.t_ns for block in group]) for group in bag.groups()]


@pytest.mark.parametrize("name", ["a.mcap", "b.bag", "c", "d"])
def test_readers_do_not_disturb_each_other(bags, name):
    with open_bag(bags / name) as bag:
        expected = np.concatenate(stamps(bag))
    with bags_opened_once():
        with open_bag(bags / name) as outer:
            groups = outer.groups()
            first_times = [np.concatenate([block.t_ns for block in next(groups)])]
            with open_bag(bags / name) as inner:
                assert inner is outer
                np.testing.assert_array_equal(np.concatenate(stamps(inner)), expected)
            first_times += [np.concatenate([block.t_ns for block in group]) for group in groups]
        np.testing.assert_array_equal(np.concatenate(first_times), expected)
        with open_bag(bags / name) as again:
            assert again is outer
    with open_bag(bags / name) as bag:
        assert bag is not outer


def test_a_file_that_changed_is_opened_anew(bags, tmp_path):
    path = tmp_path / "x.mcap"
    shutil.copy(bags / "a.mcap", path)
    with bags_opened_once():
        with open_bag(path) as bag:
            topics = {topic.name: topic.count for topic in bag.topics}
        ims.simulate(imu="lecture", rate=100, duration=0.5).save(path, force=True)
        with open_bag(path) as bag:
            assert {topic.name: topic.count for topic in bag.topics} != topics


def test_a_bag_in_use_stays_open_behind_many_others(bags, tmp_path):
    paths = [tmp_path / f"{k}.mcap" for k in range(40)]
    for path in paths:
        shutil.copy(bags / "a.mcap", path)
    with bags_opened_once(), open_bag(paths[0]) as bag:
        expected = np.concatenate(stamps(bag))
        for path in paths[1:]:
            with open_bag(path):
                pass
        np.testing.assert_array_equal(np.concatenate(stamps(bag)), expected)
        with open_bag(paths[0]) as another:
            assert another is not bag
