# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A GNSS receiver live: what the simulation gives, bit for bit, and where its antenna is."""

import importlib.util
import io
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import until

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.nodes.simulator.serial_line import PseudoTerminal
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

GIVEN: dict[str, Any] = {
    "trajectory.type": "figure_eight",
    "duration": 2.0,
    "start_time": 1234.5,
    "seed": 7,
    "latitude_deg": 48.0,
    "gnss.preset": "zed_f9p",
    "gnss.lever_arm": [0.3, 0.0, 0.1],
    "gnss.outages": [1.0, 0.35],
    "gnss.latency": 0.05,
}


def test_live_fixes_are_those_of_the_simulation(start: Any, listener: Any) -> None:
    from geometry_msgs.msg import TwistWithCovarianceStamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, NavSatFix

    kinds = {"imu/data_raw": Imu, "ground_truth/odom": Odometry, "gps/fix": NavSatFix}
    for topic, kind in {**kinds, "gps/velocity": TwistWithCovarianceStamped}.items():
        listener.listen(topic, kind)
    listener.listen("ground_truth/gps_fix", NavSatFix)
    chosen = {name.replace(".", "__"): value for name, value in GIVEN.items()}
    waiting = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}
    node = start("simulator", "--sensors", "[gnss]", "--ros-args", **chosen, **waiting)
    assert listener.wait_for_end(node) == 0, node.output
    run = Body(load_simulation({**GIVEN, "sensors": ["gnss"]}), sensors={"gnss"})
    gnss_block = run.next(10**6)["gnss"]
    fixes, rows = listener.messages("gps/fix"), gnss_block.delivered
    assert len(fixes) == len(rows) == 16
    places = [[m.latitude, m.longitude, m.altitude] for m in fixes]
    assert np.array_equal(places, gnss_block.geodetic[rows])
    assert {(m.header.frame_id, m.status.status) for m in fixes} == {("gps_link", 2)}
    assert np.array_equal([m.position_covariance[::4] for m in fixes], gnss_block.variance[rows])
    velocity = [m.twist.twist.linear for m in listener.messages("gps/velocity")]
    assert np.array_equal([[v.x, v.y, v.z] for v in velocity], gnss_block.velocity[rows])
    assert len(listener.messages("ground_truth/gps_fix")) == 20
    missing = importlib.util.find_spec("gps_msgs") is None
    assert ("gps/extended_fix is not published: gps_msgs" in node.output) == missing


class Reader(threading.Thread):
    """Reads a terminal until it is gone."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(daemon=True)
        self._fd = os.open(path, os.O_RDONLY | os.O_NOCTTY)
        self.content = b""
        self.start()

    def run(self) -> None:
        try:
            while part := os.read(self._fd, 4096):
                self.content += part
        except OSError:  # how a terminal ends
            pass
        os.close(self._fd)


def test_nmea_comes_from_a_terminal(start: Any, listener: Any, tmp_path: Path) -> None:
    """All fixes that pynmeagps reads from the terminal equal those of the simulation."""
    from sensor_msgs.msg import Imu

    pynmeagps = pytest.importorskip("pynmeagps")
    link = tmp_path / "gps0"
    chosen = {name.replace(".", "__"): value for name, value in GIVEN.items()}
    nmea_arguments = ("--sensors", "[gnss]", "--nmea", str(link))
    node = start("simulator", *nmea_arguments, "--ros-args", **chosen, wait_for_subscribers=1)
    until(link.is_symlink, "the link")
    assert os.readlink(link).startswith("/dev/pts/")
    reader = Reader(link)
    listener.listen("imu/data_raw", Imu)
    assert listener.wait_for_end(node) == 0, node.output
    reader.join(10.0)
    assert not reader.is_alive()
    assert not link.is_symlink()
    assert f"serial line on {link} (/dev/pts/" in node.output
    assert f"wrote 16 messages to {link}" in node.output
    run = Body(load_simulation({**GIVEN, "sensors": ["gnss"]}), sensors={"gnss"})
    gnss_block = run.next(10**6)["gnss"]
    stream = pynmeagps.NMEAReader(io.BytesIO(reader.content), quitonerror=2)
    messages = [parsed for _, parsed in stream]
    assert [m.msgID for m in messages] == ["GGA", "GSA", "RMC", "VTG"] * 16
    shown = np.array([[m.lat, m.lon, m.alt] for m in messages[::4]])
    np.testing.assert_allclose(shown, gnss_block.geodetic[gnss_block.delivered], rtol=0, atol=1e-4)


def test_a_terminal_never_waits_for_its_reader(tmp_path: Path) -> None:
    """Nobody reads, somebody reads nothing, somebody reads again: whole messages, in order."""
    terminal = PseudoTerminal(str(tmp_path / "gps0"))
    lines = [f"${k:06d}{'x' * 240}\r\n".encode() for k in range(20_000)]
    for line in lines[:100]:
        terminal.send(line)
    assert (terminal.written, terminal.lost) == (0, 0)
    slow = os.open(tmp_path / "gps0", os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    for line in lines[100:10_000]:  # 2.5 MB, more than any terminal holds
        terminal.send(line)
    assert terminal.lost > 0
    assert terminal.written + terminal.lost == 9_900

    def drain() -> bytes:
        content = b""
        while True:
            try:
                content += os.read(slow, 65536)
            except BlockingIOError:
                return content

    content, stop = drain(), threading.Event()
    terminal.send(lines[10_000])
    until_all = 0
    while not content.endswith(lines[10_000]) and until_all < 1000:
        content += drain()
        stop.wait(0.01)
        until_all += 1
    got = content.splitlines(keepends=True)
    assert got[0] == lines[100]
    assert got[-1] == lines[10_000]
    assert len(got) == terminal.written
    assert set(got) <= set(lines)
    assert got == sorted(got)
    os.close(slow)
    for line in lines[10_001:]:
        terminal.send(line)
    reader = Reader(tmp_path / "gps0")
    terminal.send(lines[0])
    terminal.close()
    reader.join(10.0)
    assert reader.content in (lines[0], b"")  # a hang-up may overtake what is on its way
    assert not (tmp_path / "gps0").is_symlink()


def test_a_link_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "gps0").write_text("mine")
    with pytest.raises(InputError, match=r"gps0: no link can be made here: File exists"):
        PseudoTerminal(str(tmp_path / "gps0"))
    assert (tmp_path / "gps0").read_text() == "mine"
    (tmp_path / "gps1").symlink_to("/dev/pts/gone")
    again = PseudoTerminal(str(tmp_path / "gps1"))
    assert os.readlink(tmp_path / "gps1") == again.path
    again.close()
