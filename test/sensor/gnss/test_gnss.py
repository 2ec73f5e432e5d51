# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The receiver against theory, pymap3d, pynmeagps and rosbags.

What holds for every sensor is in test_every_sensor.py.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_messages import stamps_ns

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gravity import geodetic
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PERFECT = {
    "horizontal_sigma": [0.0] * 4,
    "vertical_sigma": [0.0] * 4,
    "velocity_sigma": 0.0,
}
STILL = {"imu": "perfect", "trajectory": "static", "rate": 20, "sensors": ["gnss"]}


def read_gnss(**gnss: Any) -> Any:
    return ims.simulate(**STILL, duration=gnss.pop("duration", 100), seed=5, gnss=gnss).gnss


@pytest.mark.parametrize("latitude", [-70.0, 0.0, 48.0, 89.9])
def test_a_flat_world_is_the_tangent_plane_of_wgs84(latitude: float) -> None:
    """To 1 mm over 100 km and up to 20 km high, against pymap3d's ENU and ECEF."""
    pymap3d = pytest.importorskip("pymap3d")
    origin = {"latitude_deg": latitude, "longitude_deg": 179.5, "height": 250.0}
    places = np.random.default_rng(1).uniform(-1e5, 1e5, (500, 3))
    places[:, 2] = places[:, 2] / 1e5 * 1e4 + 1e4
    coordinates = geodetic(EnvironmentParameters(**origin), places)
    expected = pymap3d.enu2ecef(*places.T, *origin.values())
    off = np.array(pymap3d.geodetic2ecef(*coordinates)) - np.array(expected)
    assert np.linalg.norm(off, axis=0).max() < 1e-3
    assert (np.abs(coordinates[1]) <= 180.0).all()


def test_a_curved_world_is_that_of_the_truth(tmp_path: Path) -> None:
    """Fixes without error at the body's origin are ground_truth/fix, bit for bit."""
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    argv = [
        *("--imu", "perfect", "--duration", "5s", "--rate", "50", "--quiet", "--trajectory"),
        *("figure_eight", "--topics", "ground_truth/fix,gps/fix,gps/velocity", "--gnss", "zed_f9p"),
        *("--set", "curved_earth=true", "--set", "gravity_model=wgs84"),
        *("--set", "latitude_deg=48", "--set", "gnss.rate=50", "--set", "gnss.frame=base_link"),
        *(w for k, v in PERFECT.items() for w in ("--set", f"gnss.{k}={v}")),
    ]
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 0
    messages: dict[str, list[Any]] = {}
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        for connection, _, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            messages.setdefault(connection.topic, []).append(message)
    truth, fixes = messages["/ground_truth/fix"], messages["/gps/fix"]
    assert len(truth) == len(fixes) == len(messages["/gps/velocity"]) == 250
    for true_fix, fix in zip(truth, fixes, strict=True):
        assert true_fix.latitude == fix.latitude
        assert true_fix.longitude == fix.longitude
        assert true_fix.altitude == fix.altitude
    assert (fixes[0].status.status, fixes[0].position_covariance_type) == (2, 2)
    assert fixes[0].header.frame_id == "base_link"


def test_the_antenna_has_its_place_and_its_velocity() -> None:
    """Against the derivative of its place: 1e-6 m/s is the rounding of 0.1 s differences."""
    settings = {**STILL, "trajectory": "figure_eight"}
    arm = {**PERFECT, "lever_arm": [0.5, -0.3, 0.2], "rate": 20.0}
    flight = ims.simulate(**settings, duration=10, gnss=arm)
    gnss = flight.gnss
    h = 1e-4
    t = (gnss.true_t_ns - flight.t0_ns)[1:-1] * 1e-9

    def place(t: Any) -> Any:
        motion = flight.trajectory.sample(t)
        return motion.position + rotation.rotate(motion.q_wb, np.array([[0.5, -0.3, 0.2]]))

    np.testing.assert_allclose(gnss.position[1:-1], place(t), rtol=0, atol=1e-12)
    slope = (place(t + h) - place(t - h)) / (2.0 * h)
    np.testing.assert_allclose(gnss.velocity[1:-1], slope, rtol=0, atol=1e-6)


def test_errors_have_the_stated_size_and_time() -> None:
    """4 h with 20 s have 720 independent values, the deviation is known to 2.6 %; five of these.

    Between fixes 20 s apart the correlation is (1 - white share) / e, known to 1 / sqrt(720).
    """
    gnss = read_gnss(
        duration=14400, rate=1.0, mode="dgps", correlation_time=20.0, white_share=0.2,
        sky="constant",
        horizontal_sigma=[9.0, 0.6, 9.0, 9.0], vertical_sigma=[9.0, 1.2, 9.0, 9.0],
    )  # fmt: skip
    np.testing.assert_allclose(gnss.error.std(axis=0), [0.6, 0.6, 1.2], rtol=0.13)
    np.testing.assert_allclose(gnss.variance[0], [0.36, 0.36, 1.44], rtol=1e-12)
    e = gnss.error / gnss.error.std(axis=0)
    correlation = (e[20:] * e[:-20]).mean(axis=0)
    np.testing.assert_allclose(correlation, 0.8 / np.e, rtol=0, atol=5.0 / np.sqrt(720.0))
    speed = gnss.velocity - gnss.ideal_velocity
    np.testing.assert_allclose(speed.std(axis=0), 0.05, rtol=0.03)  # 5 / sqrt(2 * 14400)


def test_the_stated_covariance_may_lie() -> None:
    honest, proud = read_gnss(), read_gnss(covariance_factor=0.25)
    assert np.array_equal(honest.error, proud.error)
    assert np.array_equal(0.25 * honest.variance, proud.variance)
    assert np.array_equal(0.25 * honest.velocity_variance, proud.velocity_variance)


def test_modes_change_accuracy_and_status() -> None:
    changes = [20.0, 3, 40.0, 4, 60.0, 2]
    gnss = read_gnss(mode="single", mode_changes=changes, sky="constant")
    t = (gnss.true_t_ns - gnss.true_t_ns[0]) * 1e-9
    for begin, mode, status, sigma in ((0, 0, 0, 1.5), (20, 2, 2, 0.2), (40, 3, 2, 0.01)):
        rows = (t >= begin) & (t < begin + 20)
        assert set(gnss.mode[rows]) == {mode}
        assert set(gnss.status[rows]) == {status}
        np.testing.assert_allclose(gnss.variance[rows][:, 0], sigma**2)
    assert gnss.status[-1] == 1


def test_outages_by_time_and_place() -> None:
    gnss = read_gnss(outages=[10.0, 5.0, 50.0, 0.95])
    t = np.round((gnss.true_t_ns - gnss.true_t_ns[0]) * 1e-9, 6)
    assert len(gnss) == 1000 - 50 - 10
    assert not ((t >= 10.0) & (t < 15.0)).any()
    assert len(read_gnss(outage_boxes=[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])) == 0
    loud = read_gnss(outages=[10.0, 5.0], silent=False)
    assert len(loud) == 1000
    assert np.count_nonzero(loud.status == -1) == 50
    assert set(loud.satellites[loud.status == -1]) == {0}


def test_without_a_fix_nothing_of_the_motion_is_told(tmp_path: Path) -> None:
    """Messages keep the last position and have no velocity; NMEA has neither; dates are of 2026."""
    pynmeagps = pytest.importorskip("pynmeagps")
    from rosbags.highlevel import AnyReader

    out = [0.0, 0.5, 2.0, 3.0]
    flight = ims.simulate(
        **{**STILL, "trajectory": "figure_eight"}, duration=7, latitude_deg=48.0,
        gnss={"silent": False, "outages": out, "rate": 4.0},
    )  # fmt: skip
    gnss = flight.gnss
    t = (gnss.true_t_ns - flight.t0_ns) * 1e-9
    lost = (t < 0.5) | ((t >= 2.0) & (t < 5.0))
    assert np.array_equal(gnss.status == -1, lost)
    last_fix = np.flatnonzero(t < 2.0)[-1]
    for stated, true in (("geodetic", "ideal_geodetic"), ("position", "ideal_position")):
        shown = getattr(gnss, stated)
        assert np.isnan(shown[t < 0.5]).all()
        assert (shown[lost & (t > 1.0)] == shown[last_fix]).all()
        assert len(np.unique(getattr(gnss, true)[lost, 0])) == lost.sum()
    for name in ("velocity", "variance", "velocity_variance"):
        assert np.array_equal(np.isnan(getattr(gnss, name)).all(axis=1), lost), name
    path = flight.save(tmp_path / "a.mcap", topics=["gps/fix", "gps/velocity", "gps/extended_fix"])
    by_topic: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            by_topic.setdefault(connection.topic, []).append(message)
    fixes, extended = by_topic["/gps/fix"], by_topic["/gps/extended_fix"]
    assert [m.status.status == -1 for m in fixes] == lost.tolist()
    for many in (fixes, extended):
        places = [[m.latitude, m.longitude, m.altitude] for m in many]
        np.testing.assert_array_equal(places, gnss.geodetic)
        assert [m.position_covariance_type == 0 for m in many] == lost.tolist()
    for name in ("speed", "track", "climb", "err", "err_horz", "err_speed", "err_climb"):
        assert [np.isnan(getattr(m, name)) for m in extended] == lost.tolist(), name
    assert extended[0].time == 1767225600.0 + flight.t0_ns * 1e-9
    velocities = by_topic["/gps/velocity"]
    stamps = stamps_ns(velocities)
    assert stamps == gnss.t_ns[~lost].tolist()
    assert {m.header.frame_id for m in velocities} == {"world"}
    with gnss.save_nmea(tmp_path / "a.nmea").open("rb") as file:
        messages = [parsed for _, parsed in pynmeagps.NMEAReader(file, quitonerror=2)]
    for name, fields in (("GGA", ("lat", "alt")), ("RMC", ("lat", "spd", "cog")),
                         ("VTG", ("cogt", "sogn", "sogk"))):  # fmt: skip
        chosen = [m for m in messages if m.msgID == name]
        for field in fields:
            assert [getattr(m, field) == "" for m in chosen] == lost.tolist(), (name, field)
    assert {str(m.date) for m in messages if m.msgID == "RMC"} == {"2026-01-01"}


def test_fixes_of_a_place_that_nobody_gave_are_told() -> None:
    def lines(**settings: Any) -> list[str]:
        values = {"trajectory.type": "static", "duration": 1.0, "sensors": ["gnss"], **settings}
        body = Body(load_simulation(values), sensors=values["sensors"])
        return [w for w in body.warnings() if "latitude" in w]

    (line,) = lines()
    assert line.startswith("latitude_deg = 0 and longitude_deg = 0: fixes and satellites are those")
    assert lines(latitude_deg=48.0) == lines(longitude_deg=11.0) == lines(sensors=[]) == []


def test_random_outages_and_jumps_have_their_rates() -> None:
    """Outages of 2 s each 10 s: a share of 2 / 12 is lost, over 2000 s by 170 of them to 8 %.

    (Lengths are rounded up to whole intervals of 0.1 s, half of one on average, 2.5 %.)
    """
    gnss = read_gnss(duration=2000, outage_rate=0.1, outage_duration=2.0)
    assert 1.0 - len(gnss) / 20000 == pytest.approx(1.0 / 6.0, rel=0.4)
    still = {"horizontal_sigma": [0.0] * 4, "vertical_sigma": [0.0] * 4}
    jumps = read_gnss(duration=2000, multipath_rate=0.1, multipath_sigma=3.0, **still).error
    hit = np.abs(jumps[:, 0]) > 0.0
    assert hit.mean() == pytest.approx(5.0 / 15.0, rel=0.4)
    assert jumps[hit].std() == pytest.approx(3.0, rel=0.4)


def test_the_walk_grows_with_the_root_of_time() -> None:
    """64 seeds after 100 s: 0.1 m/sqrt(s) make 1 m, known to 1 / sqrt(2 * 192); five of these."""
    parameters = load_simulation(
        {"sensors": ["gnss"], "imu.preset": "perfect", "trajectory.type": "static", "rate": 10.0,
         "duration": 100.0, "gnss.random_walk": 0.1, "gnss.horizontal_sigma": [0.0] * 4,
         "gnss.vertical_sigma": [0.0] * 4}
    )  # fmt: skip
    run = Body(parameters, sensors={"gnss"})
    ends = [run.with_seed(seed).next(10**6)["gnss"].error[-1] for seed in range(64)]
    assert np.std(ends) == pytest.approx(1.0, rel=5.0 / np.sqrt(2 * 192))


def test_noisy_errors_do_not_depend_on_blocks() -> None:
    settings = {
        "sensors": ["gnss"],
        "imu.preset": "perfect",
        "trajectory.type": "figure_eight",
        "duration": 60.0,
        "gnss.random_walk": 0.1,
        "gnss.multipath_rate": 0.2,
        "gnss.multipath_sigma": 2.0,
        "gnss.outage_rate": 0.1,
        "gnss.outage_duration": 2.0,
    }
    whole = Body(load_simulation(settings), sensors={"gnss"}).next(10**6)
    parts = list(Body(load_simulation(settings), sensors={"gnss"}).windows(53))
    for name in ("error", "geodetic", "velocity", "mode"):
        joined = np.concatenate([getattr(part["gnss"], name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole["gnss"], name), name)


def test_covariance_follows_from_the_geometry() -> None:
    """Ranges are as good as the nominal dilutions say; each axis has its own dilution.

    Normalised errors of 12 h with 20 s: 2160 independent values, the deviation is known to 1.5 %;
    five of these.
    """
    gnss = read_gnss(
        duration=43200, rate=0.5, correlation_time=20.0, covariance_factor=4.0, hdop=0.8, vdop=1.6,
        horizontal_sigma=[2.0] * 4, vertical_sigma=[4.0] * 4,
    )  # fmt: skip
    ranges = np.array([2.0 * np.sqrt(2.0) / 0.8, 2.0 * np.sqrt(2.0) / 0.8, 4.0 / 1.6])
    sigma = ranges * gnss.dilution[:, :3]
    np.testing.assert_allclose(gnss.variance, 4.0 * sigma**2, rtol=1e-12)
    np.testing.assert_allclose((gnss.error / sigma).std(axis=0), 1.0, rtol=0.075)
    np.testing.assert_allclose(gnss.hdop, np.hypot(*gnss.dilution.T[:2]), rtol=1e-12)
    np.testing.assert_allclose(gnss.pdop, np.hypot(gnss.hdop, gnss.vdop), rtol=1e-12)
    bits = [bin(used).count("1") for used in gnss.used.tolist()]
    assert np.array_equal(gnss.satellites, bits)
    assert len(set(bits)) > 2
    # GPS promises a PDOP of at most 6 for 98 % of the time (SPS performance standard, 3.7-1).
    assert np.quantile(gnss.pdop, 0.98) < 6.0


def test_houses_hide_satellites() -> None:
    """The box is the middle third of a straight drive of 60 s; a mask of 85 deg leaves no fix."""
    drive = {
        "imu": "perfect", "rate": 20, "sensors": ["gnss"], "seed": 1, "duration": 60.0,
        "trajectory": {"type": "harmonic", "x": {"polynomial": [0.0, 1.0]}},
    }  # fmt: skip
    box = [20.0, -5.0, -5.0, 40.0, 5.0, 5.0]
    receiver: dict[str, Any] = {"rate": 1.0, "silent": False, "mask_boxes": [*box, 25.0]}
    gnss = ims.simulate(**drive, gnss=receiver).gnss
    between_houses = (gnss.ideal_position[:, 0] >= 20.0) & (gnss.ideal_position[:, 0] <= 40.0)
    assert np.count_nonzero(between_houses) == 21
    assert gnss.satellites[between_houses].max() < gnss.satellites[~between_houses].min()
    assert gnss.pdop[between_houses].min() > gnss.pdop[~between_houses].max()
    assert (
        gnss.variance[between_houses].min(axis=0)[0] > gnss.variance[~between_houses].max(axis=0)[0]
    )
    covered = ims.simulate(**drive, gnss={**receiver, "mask_boxes": [*box, 25.0, *box, 85.0]}).gnss
    assert set(covered.mode[between_houses]) == {-1}
    assert set(covered.satellites[between_houses]) == {0}
    assert set(covered.hdop[between_houses]) == {99.99}
    assert np.array_equal(covered.error[~between_houses], gnss.error[~between_houses])


def test_extended_fixes_hold_the_same(tmp_path: Path) -> None:
    """gps_msgs/GPSFix, gps_common/GPSFix in ROS 1, against what is read; in bags on request."""
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    flight = ims.simulate(
        **{**STILL, "trajectory": "figure_eight"}, duration=3, latitude_deg=48.0,
        gnss={"mode": "float", "outages": [1.0, 0.5], "silent": False},
    )  # fmt: skip
    gnss = flight.gnss
    for name, package in (("a.mcap", "gps_msgs"), ("a.bag", "gps_common")):
        path = flight.save(tmp_path / name, topics=["imu/data_raw", "gps/fix", "gps/extended_fix"])
        with AnyReader([path]) as reader:
            chosen = [c for c in reader.connections if c.topic == "/gps/extended_fix"]
            assert chosen[0].msgtype == f"{package}/msg/GPSFix"
            messages = [
                reader.deserialize(content, connection.msgtype)
                for connection, _, content in reader.messages(chosen)
            ]
        assert [m.status.status for m in messages] == [20] * 10 + [-1] * 5 + [20] * 15
        for name in ("latitude", "longitude", "altitude"):
            column = gnss.geodetic[:, ("latitude", "longitude", "altitude").index(name)]
            assert np.array_equal([getattr(m, name) for m in messages], column)
        for name in ("hdop", "vdop", "pdop"):
            assert np.array_equal([getattr(m, name) for m in messages], getattr(gnss, name))
        assert np.array_equal([m.status.satellites_used for m in messages], gnss.satellites)
        assert [len(m.status.satellite_used_prn) for m in messages] == [0] * 30
        assert [m.position_covariance_type for m in messages] == [2] * 10 + [0] * 5 + [2] * 15
        message = messages[0]
        assert np.array_equal(message.position_covariance[::4], gnss.variance[0])
        assert message.gdop == pytest.approx(np.linalg.norm(gnss.dilution[0]))
        east, north, up = gnss.velocity[0]
        assert message.speed == pytest.approx(np.hypot(east, north))
        assert np.radians(message.track) == pytest.approx(np.arctan2(east, north) % (2 * np.pi))
        assert message.climb == up
        # 95 % of a Gaussian error is within 1.960 standard deviations.
        speed, climb = 1.960 * np.sqrt(gnss.velocity_variance[0, [0, 2]])
        assert (message.err_speed, message.err_climb) == pytest.approx((speed, climb), rel=1e-6)
        assert (message.header.frame_id, message.status.header.frame_id) == ("gps_link", "gps_link")
        assert message.status.header.stamp.sec == message.header.stamp.sec == 1


def test_nmea_is_read_by_pynmeagps(tmp_path: Path) -> None:
    """Places to 0.2 mm, the resolution of 1e-7 minutes; checksums are checked by the reader."""
    pynmeagps = pytest.importorskip("pynmeagps")
    flight = ims.simulate(
        **{**STILL, "trajectory": "figure_eight"}, duration=5, start_time=1.7e9,
        latitude_deg=-33.9, longitude_deg=151.2, gnss={"mode": "fixed", "outages": [2.0, 1.0]},
    )  # fmt: skip
    path = flight.gnss.save_nmea(tmp_path / "a.nmea")
    with path.open("rb") as file:
        messages = [parsed for _, parsed in pynmeagps.NMEAReader(file, quitonerror=2)]
    assert [m.msgID for m in messages] == ["GGA", "GSA", "RMC", "VTG"] * 40
    gnss = flight.gnss
    for k, (latitude, longitude, height) in enumerate(gnss.geodetic):
        gga, gsa, rmc, vtg = messages[4 * k : 4 * k + 4]
        assert gga.lat == pytest.approx(latitude, abs=2e-9)
        assert gga.lon == pytest.approx(longitude, abs=2e-9)
        assert gga.alt == pytest.approx(height, abs=1e-4)
        assert (gga.quality, gga.numSV, rmc.status) == (4, gnss.satellites[k], "A")
        numbers = [getattr(gsa, f"svid_{n:02d}") for n in range(1, 13)]
        used = [prn for prn in range(1, 33) if gnss.used[k] >> (prn - 1) & 1]
        assert [n for n in numbers if n] == used
        assert gsa.navMode == 3
        shown = [gga.HDOP, gsa.PDOP, gsa.HDOP, gsa.VDOP]
        dops = [gnss.hdop[k], gnss.pdop[k], gnss.hdop[k], gnss.vdop[k]]
        np.testing.assert_allclose(shown, dops, rtol=0, atol=0.005001)
        east, north, _ = gnss.velocity[k]
        assert vtg.sogk == pytest.approx(3.6 * np.hypot(east, north), abs=1e-3)
    assert str(messages[2].date) == "2023-11-14"


@pytest.mark.parametrize("name", files.names("gnss"))
def test_presets_have_sources_and_run(name: str, tmp_path: Path) -> None:
    assert "# [1] " in files.find("gnss", name).read_text(encoding="utf-8")
    gnss = ims.simulate(**STILL, duration=10, gnss={"preset": name}).gnss
    assert len(gnss) == 10 * round(len(gnss) / 10) > 0
    argv = ["-o", str(tmp_path / "a"), "--format", "csv", "--duration", "2s", "--gnss", name]
    assert generate.main([*argv, "--quiet"]) == 0
    header, *rows = (tmp_path / "a/gps0.csv").read_text().splitlines()
    assert header.startswith("timestamp,latitude,longitude,altitude")
    assert len(rows) == len(gnss) // 5
    assert (tmp_path / "a_truth_gnss.yaml").exists()


@pytest.mark.parametrize(("name", "error"), [("ublox_m8", 2.5), ("ublox_m9n", 1.5)])
def test_half_of_the_fixes_lie_within_the_circle_of_the_data_sheet(name: str, error: float) -> None:
    """The preset's error east and north makes the circular error probable of its source.

    Of 8640 independent fixes of a day the median of a Rayleigh distribution is known to 0.72 /
    sqrt(n), 0.8 %; five of these, and 5 % for a sky that is not the nominal one.
    """
    receiver = {"preset": name, "rate": 0.1, "correlation_time": 2.0}
    gnss = ims.simulate(
        **{**STILL, "rate": 1.0}, duration=86400, seed=1, latitude_deg=48.0, gnss=receiver
    ).gnss
    assert np.median(np.hypot(*gnss.error.T[:2])) == pytest.approx(error, rel=0.09)


@pytest.mark.parametrize(
    ("receiver", "line"),
    [
        ({"preset": "f9"}, "unknown gnss 'f9'"),
        ({"horizontal_sigma": [1.0, 1.0, 1.0]}, "gnss.horizontal_sigma"),
        ({"mode_changes": [5.0, 2, 5.0, 3]}, "times|must increase"),
        ({"mode_changes": [5.0, 7]}, "mode 7: must be 1, 2, 3 or 4"),
        ({"outage_boxes": [1, 0, 0, 0, 1, 1]}, "least must be below largest"),
        ({"mask_boxes": [1, 0, 0, 0, 1, 1, 20]}, "least must be below largest"),
        ({"mask_boxes": [0, 0, 0, 1, 1, 1, 95]}, "must be between 0 and 90 deg"),
        ({"mask_boxes": [0, 0, 0, 1, 1, 1, 5], "sky": "constant"}, "must be empty"),
        ({"multipath_rate": 1.0}, "must both be 0 or both be above 0"),
    ],
)
def test_bad_parameters_are_refused_by_name(receiver: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError, match=line):
        read_gnss(**receiver)
