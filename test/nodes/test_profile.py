# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes' profile of Fast DDS is in the dialect of the version that is installed."""

import os
from xml.etree import ElementTree

import pytest

from imu_sim_ros.nodes import fast_dds

NAMES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


@pytest.mark.parametrize(
    ("version", "variable", "element"),
    [("8.4.3", NAMES[0], "throughputController"), ("9.3.3", NAMES[1], "flow_controller_name")],
)
def test_the_profile_fits_the_middleware(tmp_path, monkeypatch, version, variable, element):
    share = tmp_path / "share/rmw_fastrtps_shared_cpp"
    share.mkdir(parents=True)
    (share / "package.xml").write_text(f"<package><version>{version}</version></package>")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    fast_dds.set_profile(tmp_path)
    assert [name in os.environ for name in NAMES] == [name == variable for name in NAMES]
    root = ElementTree.parse(os.environ[variable]).getroot()
    tags = {xml_element.tag.rpartition("}")[2] for xml_element in root.iter()}
    assert element in tags
    assert ("heartbeat_period" in tags) == (version > "9")
    monkeypatch.delenv(variable)


def test_a_profile_of_the_user_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv(NAMES[1], "mine.xml")
    fast_dds.set_profile(tmp_path)
    assert os.environ[NAMES[1]] == "mine.xml"
    assert not list(tmp_path.iterdir())
