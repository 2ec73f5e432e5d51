# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Routes in files, on the Earth and in metres."""

import numpy as np
import pymap3d
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.parameters import trajectory_layer
from imu_sim_ros.trajectory.route import east_north, read_route

PLACES = [(48.137, 11.575), (48.1372, 11.579), (48.14, 11.5795), (48.1402, 11.575)]
STAMPS = [f"2026-05-01T08:0{k}:{10 * k:02d}Z" for k in range(4)]
GPX = (
    '<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    + "".join(
        f'<trkpt lat="{a}" lon="{o}"><ele>520</ele><time>{t}</time></trkpt>'
        for (a, o), t in zip(PLACES, STAMPS, strict=True)
    )
    + '</trkseg></trk><wpt lat="1" lon="2"/></gpx>'
)
LINE = " ".join(f"{o},{a},0" for a, o in PLACES)
KML = (
    '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString>'
    f"<coordinates>\n{LINE}\n</coordinates></LineString></Placemark></Document></kml>"
)
TRACK = (
    '<kml xmlns:gx="http://www.google.com/kml/ext/2.2"><Placemark><gx:Track>'
    + "".join(f"<when>{t}</when>" for t in STAMPS)
    + "".join(f"<gx:coord>{o} {a} 520</gx:coord>" for a, o in PLACES)
    + "</gx:Track></Placemark></kml>"
)
CSV = "name,longitude,latitude\n" + "".join(f"p,{o},{a}\n" for a, o in PLACES)


def write_text(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("origin", [(48.0, 11.0), (-33.9, 151.2), (0.0, 0.0), (75.0, -179.999)])
def test_places_are_those_of_the_plane(origin):
    """To 1 mm over 50 km, against pymap3d: back to the Earth with z = 0."""
    rng = np.random.default_rng(3)
    latitude = origin[0] + rng.uniform(-0.4, 0.4, 200)
    longitude = origin[1] + rng.uniform(-0.4, 0.4, 200)
    x, y = east_north(latitude, longitude, *origin).T
    back = pymap3d.enu2geodetic(x, y, 0.0 * x, origin[0], origin[1], 0.0)
    turned = (back[1] - longitude + 180.0) % 360.0 - 180.0
    assert np.abs(back[0] - latitude).max() * 111e3 < 1e-3
    assert np.abs(turned).max() * 111e3 < 1e-3


@pytest.mark.parametrize(
    ("name", "text", "timed"),
    [
        ("a.gpx", GPX, True),
        ("a.kml", KML, False),
        ("b.kml", TRACK, True),
        ("a.csv", CSV, False),
        ("b.csv", CSV.replace(",", ";"), False),
    ],
)
def test_each_form_gives_the_same_route(tmp_path, name, text, timed):
    route = read_route(write_text(tmp_path, name, text))
    expected = east_north(*np.array(PLACES).T, *PLACES[0])
    np.testing.assert_allclose(route.waypoints, expected, atol=1e-9)
    assert route.origin == pytest.approx(PLACES[0])
    if timed:
        np.testing.assert_allclose(route.times, [0.0, 70.0, 140.0, 210.0])
    else:
        assert route.times is None
    height = {"a.gpx": 520.0, "b.kml": 520.0, "a.kml": 0.0}.get(name, np.nan)
    np.testing.assert_array_equal(route.heights, [height] * 4)


def test_metres_stay_as_they_are(tmp_path):
    path = write_text(tmp_path, "route.csv", "t,x,y,z\n# a comment\n0,1.5,2,3\n30,100.0,2.5,\n")
    route = read_route(path)
    np.testing.assert_array_equal(route.heights, [3.0, np.nan])
    np.testing.assert_array_equal(route.waypoints, [[1.5, 2.0], [100.0, 2.5]])
    np.testing.assert_array_equal(route.times, [0.0, 30.0])
    assert route.origin is None


def test_fixes_are_on_the_route(tmp_path):
    """Fixes without error pass the file's points to 2 cm, at steps of 0.1 s."""
    path = write_text(tmp_path, "route.gpx", GPX)
    flight = ims.simulate(
        trajectory=str(path),
        rate=100.0,
        sensors=["gnss"],
        latitude_deg=PLACES[0][0],
        longitude_deg=PLACES[0][1],
        gnss={"rate": 50.0},
    )
    fixes = flight.gnss.ideal_geodetic
    for latitude, longitude in PLACES:
        north = (fixes[:, 0] - latitude) * 111.2e3
        east = (fixes[:, 1] - longitude) * 74.3e3
        assert np.hypot(north, east).min() < 0.06  # 5 m/s, a fix every 10 cm


def test_elevations_of_a_file_are_above_its_first_point(tmp_path):
    text = GPX
    for k in range(4):
        text = text.replace("<ele>520<", f"<ele>{521 + 2 * k}.0<", 1)
    layer = {**trajectory_layer(str(write_text(tmp_path, "hill.gpx", text)))}
    layer |= {"trajectory.use_elevations": True, "trajectory.rest_before": 1.0}
    moving = build_trajectory(load_simulation(layer).trajectory)
    ends = moving.sample(np.array([0.0, moving.duration])).position[:, 2]
    np.testing.assert_allclose(ends, [0.0, 6.0], atol=1e-6)
    text = text.replace("<ele>525.0</ele>", "<ele>high</ele>")
    layer |= trajectory_layer(str(write_text(tmp_path, "gap.gpx", text)))
    with pytest.raises(ConfigurationError, match="1 of 4 points have no elevation.* point 3"):
        build_trajectory(load_simulation(layer).trajectory)


def test_another_origin_is_warned_of(tmp_path, capsys):
    from imu_sim_ros.simulation.engine import Body

    path = write_text(tmp_path, "route.gpx", GPX)
    layer = trajectory_layer(str(path))
    assert layer == {"trajectory.type": "drive", "trajectory.file": str(path)}
    (line,) = Body(load_simulation(layer)).warnings()
    assert "latitude_deg=48.1370000 and longitude_deg=11.5750000" in line
    origin = {"latitude_deg": 48.137, "longitude_deg": 11.575}
    assert Body(load_simulation({**layer, **origin})).warnings() == []
    matched = {
        **layer,
        "trajectory.origin": [48.1, 11.5],
        "latitude_deg": 48.1,
        "longitude_deg": 11.5,
    }
    simulation = Body(load_simulation(matched))
    assert simulation.warnings() == []
    place = simulation.trajectory.sample(np.zeros(1)).position[0]
    np.testing.assert_allclose(place[:2], east_north(*np.array([PLACES[0]]).T, 48.1, 11.5)[0])


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.csv", "a,b\n1,2\n3,4\n", "the first line must name the columns"),
        ("a.csv", "", "is empty"),
        ("a.csv", "x,y\n1,2\n", "has 1 points"),
        ("a.csv", "x,y\n1,2\n3,four\n", "line 3: '3', 'four': not two numbers"),
        ("a.csv", "x,y\n1,2\n3\n", "line 3: 1 columns; must be 2"),
        ("a.csv", "x,y\n1,2\nnan,4\n", "line 3: nan, 4: must be finite"),
        ("a.csv", "x,y,t\n1,2,0\n3,4,late\n", "line 3: time 'late': not a number"),
        ("a.csv", "lat,lon\n48,11\n98,11\n", "line 3: latitude 98, longitude 11: must be within"),
        ("a.csv", "lat,lon\n48,11\n8,11\n", "from the origin (48, 11)"),
        ("a.gpx", "<gpx/>", "has 0 points"),
        ("a.gpx", "<gpx><wpt lat='1'/><wpt lat='x' lon='2'/></gpx>", "point 1: '1', ''"),
        ("a.gpx", GPX.replace(STAMPS[1], "noon"), "point 2: time 'noon': must be like"),
        ("a.gpx", "no xml", "not XML"),
        ("a.kml", "<kml><Point><coordinates>1 2</coordinates></Point></kml>", "point 1"),
        ("a.pdf", "x", "must be a route: .csv, .gpx or .kml"),
    ],
)
def test_bad_files_are_named(tmp_path, name, text, reason):
    path = write_text(tmp_path, name, text)
    with pytest.raises(InputError) as caught:
        read_route(path)
    assert reason in caught.value.problems[0]
    assert str(path) in caught.value.problems[0]


@pytest.mark.parametrize("encoding", ["klingon", "cp037", "ISO-8859-1", "utf-16"])
def test_xml_is_read_as_utf_8_whatever_it_declares(tmp_path, encoding):
    """Python's parser asks for the codec, which raises a LookupError of its own."""
    path = tmp_path / "a.gpx"
    points = "".join(f'<wpt lat="48" lon="11.00{k}"><name>\u00e9</name></wpt>' for k in (0, 1))
    text = f'<?xml version="1.0" encoding="{encoding}"?><gpx>{points}</gpx>'
    path.write_text(text, encoding="utf-8")
    assert len(read_route(path).waypoints) == 2
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        read_route(path)


def test_entities_are_refused(tmp_path):
    bomb = (
        '<!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
        "<gpx><name>&b;</name></gpx>"
    )
    with pytest.raises(InputError, match="document type"):
        read_route(write_text(tmp_path, "bomb.gpx", bomb))
