# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Raw measurements and RINEX against receivers of other people: RTKLIB, and georinex's reader."""

import shutil
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.geodesy import ecef_of_geodetic
from imu_sim_ros.core.gps_time import GpsTime, gps_time
from imu_sim_ros.sensors.gnss import rinex
from imu_sim_ros.sensors.gnss.observations import Antenna, klobuchar, ranges, saastamoinen_delay
from imu_sim_ros.sensors.gnss.satellites import LIGHT, almanac, orbits
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

QUIET = {"code_sigma": 0.0, "phase_sigma": 0.0, "rate_sigma": 0.0}
"""No noise."""
CHANGE = 1_700_002_800 - 18
"""[s] Unix time at which another ephemeris is the nearest: 3600 s after an even hour of GPS."""
PLACE = {"latitude_deg": 48.0, "longitude_deg": 11.0, "height": 500.0}
GIVEN = {"imu": "perfect", "rate": 20.0, "start_time": CHANGE - 60.0, "sensors": ["gnss"], **PLACE}
ORIGIN = ecef_of_geodetic(*(np.array([value]) for value in PLACE.values()))[0]


def raw(**options: Any) -> dict[str, Any]:
    return {"rate": 1.0, "raw": {"rinex": True, **options}}


def flight_with_rinex(path: Path, *, gnss: dict[str, Any], **overrides: Any) -> Any:
    """Return a flight of two minutes; its RINEX files are at the path."""
    settings = {
        **GIVEN,
        "trajectory": "static",
        "duration": 120.0,
        "seed": 5,
        **overrides,
        "gnss": gnss,
    }
    ims.generate(path, topics=["imu/data_raw"], **settings)
    return ims.simulate(**settings)


def solved(folder: Path, files: list[str], **options: Any) -> Any:
    """Return what RTKLIB finds (n, columns): week, second, x, y, z, quality, satellites, ..."""
    program = shutil.which("rnx2rtkp")
    if program is None:
        pytest.skip("rnx2rtkp (Debian's rtklib) is not installed")
    rtklib_options = {
        "pos1-posmode": "single", "pos1-frequency": "l1", "pos1-elmask": 10, "pos1-navsys": 1,
        "pos1-ionoopt": "brdc", "pos1-tropopt": "saas", "out-solformat": "xyz",
        "out-timesys": "gpst", "out-timeform": "tow", "out-outvel": "on", **options,
    }  # fmt: skip
    chosen = folder / "rtklib.conf"
    chosen.write_text("".join(f"{name}={value}\n" for name, value in rtklib_options.items()))
    argv = [program, "-k", str(chosen), *(str(folder / name) for name in files)]
    done = subprocess.run(argv, capture_output=True, text=True, check=True)
    assert "invalid" not in done.stderr
    rows = [line.split() for line in done.stdout.splitlines() if line and not line.startswith("%")]
    return np.array(rows, float)


def test_rtklib_finds_a_still_antenna_within_a_centimetre(tmp_path: Path) -> None:
    """Without noise, across a change of ephemerides; files hold mm, dilutions are below 3."""
    flight_with_rinex(tmp_path / "a", gnss={**raw(**QUIET), "lever_arm": [0.0, 0.0, 2.0]})
    solution = solved(tmp_path, ["a.obs", "a.nav"])
    assert len(solution) == 120
    latitude, longitude = np.radians(48.0), np.radians(11.0)
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                   np.sin(latitude)])  # fmt: skip
    assert np.abs(solution[:, 2:5] - (ORIGIN + 2.0 * up)).max() < 0.01


def test_rtklib_finds_a_moving_antenna_and_its_velocity(tmp_path: Path) -> None:
    """Without noise: 1 cm, and 1 cm/s.

    The receiver's clock is 1 ms off: in this time the antenna moves by 4 mm.
    """
    flight = flight_with_rinex(tmp_path / "a", trajectory="figure_eight",
                  gnss=raw(**QUIET, clock_offset=1e-3))  # fmt: skip
    solution = solved(tmp_path, ["a.obs", "a.nav"])
    truth = ecef_of_geodetic(*flight.gnss.ideal_geodetic.T)
    assert np.abs(solution[:, 2:5] - truth).max() < 0.02
    east, north, up = flight.gnss.ideal_velocity.T
    speed = np.linalg.norm(solution[:, 15:18], axis=1)
    np.testing.assert_allclose(speed, np.sqrt(east**2 + north**2 + up**2), rtol=0, atol=0.01)


def test_rtklib_fixes_the_ambiguities_of_two_receivers(tmp_path: Path) -> None:
    """A base and a rover with noise: a wrong integer is 0.19 m.

    A phase at the mask has 2 mm / sin(10 deg); the difference of two receivers and two satellites
    has twice that, 23 mm. With a dilution of 3 at most, 0.1 m is more than four times its error
    for the worst satellite alone.
    """
    flight_with_rinex(tmp_path / "base", gnss=raw(), seed=1)
    rover = flight_with_rinex(
        tmp_path / "rover", gnss=raw(clock_offset=-3e-4), trajectory="figure_eight"
    )
    base = {f"ant2-pos{k + 1}": repr(float(coordinate)) for k, coordinate in enumerate(ORIGIN)}
    solution = solved(
        tmp_path, ["rover.obs", "base.obs", "rover.nav"],
        **{"pos1-posmode": "kinematic", "pos1-frequency": "l1+2", "ant2-postype": "xyz", **base},
    )  # fmt: skip
    assert len(solution) == 120
    assert np.mean(solution[:, 5] == 1.0) > 0.9  # fixed
    truth = ecef_of_geodetic(*rover.gnss.ideal_geodetic.T)
    off = np.linalg.norm(solution[:, 2:5] - truth, axis=1)
    assert off[solution[:, 5] == 1.0].max() < 0.1


def test_rtklib_errs_as_the_noise_says(tmp_path: Path) -> None:
    """Single fixes with 0.5 m on each range, larger below: no mean of 120, and a median in between.

    All satellites have between 0.5 m (zenith) and 2.9 m (mask), the position 3 times that at most.
    """
    flight_with_rinex(tmp_path / "a", gnss=raw(code_sigma=0.5))
    off = solved(tmp_path, ["a.obs", "a.nav"])[:, 2:5] - ORIGIN
    distances = np.linalg.norm(off, axis=1)
    assert 0.5 < np.median(distances) < 8.7
    assert np.linalg.norm(off.mean(axis=0)) < 5.0 * distances.std() / np.sqrt(120.0) + 0.3


def test_rtklib_has_the_same_orbits_with_every_term(tmp_path: Path) -> None:
    """Satellites with all harmonic terms and group delays: without noise, within a centimetre.

    The terms have the sizes of broadcast ones: 5e-6 rad are 130 m, 200 m of radius, 1e-7 rad 3 m.
    """
    start = gps_time(int(GIVEN["start_time"]) * 10**9)
    ephemerides = almanac(start.week, 7200.0 * round(start.second / 7200.0))
    numbers = np.random.default_rng(3)
    sizes = {
        "cuc": 5e-6, "cus": 5e-6, "crc": 200.0, "crs": 100.0, "cic": 1e-7, "cis": 1e-7,
        "delta_n": 5e-9, "idot": 1e-10, "tgd": 1e-8, "af2": 1e-18,
    }  # fmt: skip
    terms = {name: size * numbers.normal(size=30) for name, size in sizes.items()}
    with (tmp_path / "given.nav").open("w") as file:
        rinex.write_navigation(file, [ephemerides._replace(**terms)], None, 18)
    gnss = {**raw(**QUIET), "ephemeris": str(tmp_path / "given.nav")}
    flight_with_rinex(tmp_path / "a", gnss=gnss, duration=50.0)
    solution = solved(tmp_path, ["a.obs", "a.nav"])
    assert len(solution) == 50
    assert np.abs(solution[:, 2:5] - ORIGIN).max() < 0.01


def test_georinex_reads_the_same_numbers(tmp_path: Path) -> None:
    georinex = pytest.importorskip("georinex")
    flight = flight_with_rinex(
        tmp_path / "a", gnss={**raw(), "outages": [30.0, 20.0]}, duration=60.0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        observations, navigation = (
            georinex.load(tmp_path / f"a.{kind}") for kind in ("obs", "nav")
        )
    gnss = flight.gnss
    assert observations.sizes["time"] == len(gnss) == 40
    assert str(observations.time.values[0])[:19] == "2023-11-14T22:59:00"  # of GPS
    names = {"pseudorange": "C", "carrier_phase": "L", "doppler": "D"}
    satellites = [int(sv[1:]) - 1 for sv in observations.sv.values]
    for k, code in enumerate(("1C", "2W")):
        for name, letter in names.items():
            table = observations[letter + code].transpose("time", "sv").values
            ours = getattr(gnss, name)[:, satellites, k]
            np.testing.assert_allclose(table, ours, rtol=0, atol=5.01e-4)
    assert len(navigation.sv) == 30
    assert navigation.attrs["ionospheric_corr_GPS"].shape == (8,)
    start = gps_time(int(GIVEN["start_time"]) * 10**9)
    sets = almanac(start.week, 7200.0 * round(start.second / 7200.0))
    row = navigation.sel(time=navigation.time.values[0], sv="G07")
    assert float(row.M0) == sets.m0[6]
    assert float(row.sqrtA) == sets.sqrt_a[6]


def test_the_truth_adds_up() -> None:
    """Without noise a pseudorange is the sum of its parts, a phase another, to a micrometre."""
    gnss = ims.simulate(
        **GIVEN, trajectory="figure_eight", duration=20.0, gnss=raw(**QUIET), seed=2
    ).gnss
    clocks = LIGHT * (gnss.receiver_clock[:, None] - gnss.satellite_clock)
    common = gnss.ideal_range + clocks + gnss.troposphere
    scale = (1575.42 / 1227.60) ** 2
    assert np.isfinite(common).sum() == gnss.satellites.sum()
    for k, factor in enumerate((1.0, scale)):
        code = common + factor * gnss.ionosphere
        np.testing.assert_allclose(gnss.pseudorange[..., k], code, rtol=0, atol=1e-6)
        wave = LIGHT / (1575.42e6, 1227.60e6)[k]
        cycles = gnss.carrier_phase[..., k] - (common - factor * gnss.ionosphere) / wave
        tracked = np.isfinite(cycles)
        np.testing.assert_allclose(cycles[tracked], np.round(cycles[tracked]), rtol=0, atol=1e-4)
    slope = np.diff(gnss.carrier_phase[..., 0], axis=0)
    mean = 0.5 * (gnss.doppler[1:, :, 0] + gnss.doppler[:-1, :, 0])
    tracked = np.isfinite(slope)
    # Over 1 s: a jerk of 50 m/s^3 would be 4 m / 0.19 m; this motion has below 2 (0.9 cycles).
    np.testing.assert_allclose(slope[tracked], -mean[tracked], rtol=0, atol=2.0)


def test_the_sky_moves_on_smoothly() -> None:
    """An ephemeris and the next one give the same place, to a millimetre, and the same clock."""
    for toe in (7200.0, 597600.0):
        ephemeris, later_ephemeris = almanac(2400, toe), almanac(2400, toe + 7200.0)
        if toe == 597600.0:
            later_ephemeris = almanac(2401, 0.0)
        second = np.array(toe + 3600.0)
        orbit, later_orbit = orbits(ephemeris, 2400, second), orbits(later_ephemeris, 2400, second)
        assert np.abs(orbit.position - later_orbit.position).max() < 2e-3
        if toe == 7200.0:
            assert np.abs(orbit.clock - later_orbit.clock).max() < 1e-14
    radius = np.linalg.norm(orbits(almanac(2400, 0.0), 2400, np.array(0.0)).position, axis=-1)
    np.testing.assert_allclose(radius, 26559.7e3, rtol=0.0051)  # the eccentricity


def test_range_rates_are_the_changes_of_the_ranges() -> None:
    """A moving antenna over 0.1 s: the rest of a jerk of 1e-3 m/s^3 is 2e-6 m/s.

    The Earth's turn on the way is 1 mm/s of it. Near the start of the week seconds are exact
    enough for a millionth; rounding of 2e7 m over 0.1 s is 4e-8 m/s.
    """
    ephemerides, velocity, unused = (
        almanac(2400, 7200.0),
        np.array([[20.0, -30.0, 10.0]]),
        np.zeros(1),
    )

    def seen(delay: float) -> Any:
        place = ORIGIN + delay * velocity
        antenna = Antenna(place, velocity, unused, unused, unused, np.eye(3)[None])
        return ranges(ephemerides, 2400, np.array([4000.0 + delay]), antenna)

    change = (seen(0.05).distance - seen(-0.05).distance) / 0.1
    np.testing.assert_allclose(seen(0.0).rate, change, rtol=0, atol=3e-5)


def test_delays_have_their_known_sizes() -> None:
    """The zenith has 2.3 m dry and some 0.1 m wet at sea level; 5 ns of ionosphere at night."""
    zenith = np.full((1, 1), np.pi / 2)
    latitude = np.array([np.radians(45.0)])
    assert saastamoinen_delay(latitude, np.zeros(1), zenith, 0.0)[0, 0] == pytest.approx(
        2.307, abs=2e-3
    )
    wet = saastamoinen_delay(latitude, np.zeros(1), zenith)[0, 0] - 2.307
    assert 0.05 < wet < 0.15
    ion = np.array([1.118e-8, -7.451e-9, -5.961e-8, 1.192e-7, 1.167e5, -2.294e5, -1.311e5, 1.049e6])
    look, place = (np.zeros((2, 1)), np.full((2, 1), np.pi / 2)), (np.zeros(2), np.zeros(2))
    night, noon = klobuchar(GpsTime(2400, 0.0), np.array([0.0, 50400.0]), place, look, ion)[:, 0]
    slant = 1.0 + 16.0 * 0.03**3
    assert night == pytest.approx(LIGHT * 5e-9 * slant)
    assert noon > 2.0 * night


def test_klobuchar_is_the_published_example() -> None:
    """23.784 m for 40 N, 100 W, azimuth 210 and elevation 20 deg, at 20:45 (Klobuchar, 1987)."""
    ion = np.array([0.3820e-7, 0.1490e-7, -0.1790e-6, 0.0, 0.1430e6, 0.0, -0.3280e6, 0.1130e6])
    place = np.radians([40.0]), np.radians([-100.0])
    look = np.radians([[210.0]]), np.radians([[20.0]])
    delay = klobuchar(GpsTime(2400, 593_100.0), np.zeros(1), place, look, ion)[0, 0]
    assert delay == pytest.approx(23.784, abs=5e-4)


def test_the_troposphere_over_a_mountain_is_that_of_its_pressure() -> None:
    """ICAO's atmosphere has 701.1 hPa at 3 km; ZHD = 2.2768 mm/hPa p / f (Davis et al., 1985).

    ``f = 1 - 0.00266 cos 2 latitude - 0.00028 h / km``.
    """
    zenith, latitude = np.full((1, 1), np.pi / 2), np.array([np.radians(30.0)])
    delay = saastamoinen_delay(latitude, np.array([3000.0]), zenith, 0.0)[0, 0]
    expected = 2.2768e-3 * 701.1 / (1.0 - 0.00266 * 0.5 - 0.00028 * 3.0)
    assert delay == pytest.approx(expected, rel=2e-4)


def test_files_of_ephemerides_are_the_sky(tmp_path: Path) -> None:
    """Written ephemerides are read, as version 3 and 2, and gives the same measurements."""
    gnss = raw(**QUIET)
    original = flight_with_rinex(tmp_path / "a", gnss=gnss, duration=10.0).gnss
    lines = (tmp_path / "a.nav").read_text().splitlines()
    version_2 = [f"{'     2.11':20}{'NAVIGATION DATA':20}{'':20}RINEX VERSION / TYPE"]
    version_2[0] = version_2[0][:20] + "N" + version_2[0][21:]
    version_2 += [f"{'':60}END OF HEADER"]
    for line in lines[6:]:
        if line.startswith("G"):
            year, month, day, hour, minute, second = (int(word) for word in line[4:23].split())
            version_2.append(
                f"{int(line[1:3]):2d} {year % 100:02d} {month:2d} {day:2d} {hour:2d} {minute:2d}"
                f"{second:5.1f}{line[23:]}"
            )
        else:
            version_2.append(line[1:])
    (tmp_path / "old.nav").write_text("\n".join(version_2) + "\n")
    for name in ("a.nav", "old.nav"):
        again = ims.simulate(
            **GIVEN, trajectory="static", duration=10.0, seed=5,
            gnss={**gnss, "ephemeris": str(tmp_path / name)},
        ).gnss  # fmt: skip
        np.testing.assert_allclose(again.pseudorange, original.pseudorange, rtol=0, atol=1e-6)
        assert np.array_equal(again.used, original.used)


def test_an_ephemeris_that_is_cut_short_is_told(tmp_path: Path) -> None:
    """Wherever its numbers end: none of those that follow is taken for 0."""
    flight_with_rinex(tmp_path / "a", gnss=raw(**QUIET), duration=10.0)
    lines = (tmp_path / "a.nav").read_text().splitlines()
    path, whole, record = tmp_path / "cut.nav", lines[:14], "\n".join(lines[14:22])
    for size in range(5, len("\n".join(lines[14:20])), 23):
        path.write_text("\n".join([*whole, record[:size]]))
        with pytest.raises(InputError, match="not an ephemeris of GPS"):
            rinex.read_navigation(path)
    path.write_text("\n".join([*whole, record.replace(lines[15][23:42], f"{'nan':>19}")]))
    with pytest.raises(InputError, match="= nan of satellite 2: must be finite"):
        rinex.read_navigation(path)
    path.write_text("\n".join([*whole, record]))
    assert len(rinex.read_navigation(path)[0].prn) == 2


def test_a_satellite_that_comes_back_has_another_ambiguity() -> None:
    gnss = ims.simulate(
        **GIVEN, trajectory="static", duration=30.0, seed=5,
        gnss={**raw(**QUIET), "outages": [10.0, 5.0]},
    ).gnss  # fmt: skip
    assert set(gnss.lock[:10].max(axis=0)) == {0, 1}
    assert set(gnss.lock[10:].max(axis=0)) == {0, 2}
    jump = (gnss.carrier_phase[10] - gnss.carrier_phase[9])[:, 0]
    # In 6 s a satellite moves by at most 6 km, 30,000 cycles; ambiguities are up to a million.
    assert np.nanmedian(np.abs(jump)) > 1e5


def test_measurements_do_not_depend_on_blocks() -> None:
    settings = {
        "sensors": ["gnss"], "imu.preset": "perfect", "trajectory.type": "figure_eight",
        "duration": 60.0, "gnss.raw.rinex": True, "gnss.outage_rate": 0.1, "rate": 50.0,
        "gnss.outage_duration": 2.0, "start_time": CHANGE - 30.0,
    }  # fmt: skip
    whole = Body(load_simulation(settings), sensors={"gnss"}).next(10**6)
    parts = list(Body(load_simulation(settings), sensors={"gnss"}).windows(53))
    for name in ("pseudorange", "carrier_phase", "doppler", "lock", "receiver_clock", "tag_ns"):
        joined = np.concatenate([getattr(part["gnss"], name) for part in parts])
        assert np.array_equal(joined, getattr(whole["gnss"], name), equal_nan=True), name


def test_generate_writes_the_files_and_replaces_none(tmp_path: Path) -> None:
    from imu_sim_ros.commands import generate

    argv = ["--imu", "perfect", "--duration", "3s", "--rate", "20", "--quiet", "--rinex"]
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 0
    assert (tmp_path / "a.obs").read_text().count("\n>") == 30
    assert (tmp_path / "a.nav").exists()
    (tmp_path / "a.mcap").unlink()
    (tmp_path / "a.obs").write_text("mine")
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 2
    assert (tmp_path / "a.obs").read_text() == "mine"
    few = ["--topics", "imu/data_raw", "--format", "csv"]
    assert generate.main(["-o", str(tmp_path / "b"), *argv, *few]) == 0
    assert (tmp_path / "b.obs").exists()


@pytest.mark.parametrize(
    ("receiver", "line"),
    [
        ({"ephemeris": "nowhere.nav"}, "gnss.ephemeris: nowhere.nav"),
        ({"ephemeris": __file__}, "is not a RINEX navigation file"),
        ({"sky": "constant", "raw": {"rinex": True}}, "gnss.raw.rinex: must not be given"),
        ({"raw": {"klobuchar": [1.0] * 4}}, "klobuchar"),
        ({"raw": {"frequencies": 3}}, "gnss.raw.frequencies = 3"),
    ],
)
def test_bad_parameters_are_refused_by_name(receiver: dict[str, Any], line: str) -> None:
    with pytest.raises((ConfigurationError, ims.InputError), match=line):
        ims.simulate(**GIVEN, trajectory="static", duration=1.0, gnss=receiver)


def test_ephemerides_of_another_day_are_refused(tmp_path: Path) -> None:
    flight_with_rinex(tmp_path / "a", gnss=raw(), duration=2.0)
    late = {**GIVEN, "start_time": CHANGE + 86400.0, "trajectory": "static", "duration": 1.0}
    with pytest.raises(ConfigurationError, match=r"holds GPS from 2023-11-1.* the run begins at"):
        ims.simulate(**late, gnss={"ephemeris": str(tmp_path / "a.nav")})
