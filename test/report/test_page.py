# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contents of a page: numbers against SciPy, escaped names, sizes, error messages."""

import base64
import csv
import itertools
import json
import re
import shutil

import numpy as np
import pytest
import scipy.signal

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import VECTOR3_STAMPED, Vector3StampedEncoder
from imu_sim_ros.bags.messages.encode_cameras import IMAGE, ImageEncoder
from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.campaigns.metrics import COVERED
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.results import read_results
from imu_sim_ros.campaigns.verdict import headline, judge
from imu_sim_ros.commands.report import main
from imu_sim_ros.core.records import Readings, replace_fields
from imu_sim_ros.inputs.poses import write_tum
from imu_sim_ros.reports import streams
from imu_sim_ros.reports.page import Section, column, html, json_for_script, table
from imu_sim_ros.sensors.camera.images.files import decode_image

from .conftest import GAP_AT, HOSTILE, RATE, SAMPLES, START


def content(page):
    """Return what the page's program draws."""
    (text,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', page)
    return json.loads(text)


def unpacked(column):
    """Return the values of a table's column of strings."""
    return column["values"] if "values" in column else [column["words"][k] for k in column["index"]]


def items(page, kind):
    entries = [item for section in content(page)["sections"] for item in section["items"]]
    entries += [inner for item in entries for inner in item.get("items", [])]
    return [item for item in entries if item["kind"] == kind]


def page_of(path, tmp_path, *arguments):
    tmp_path.mkdir(exist_ok=True)
    output = tmp_path / "page.html"
    assert main([str(path), "-o", str(output), "--quiet", *map(str, arguments)]) == 0
    return output.read_text(encoding="utf-8")


def test_no_text_ends_its_element_and_nothing_is_fetched():
    name = HOSTILE + "\u2028<!--"
    page = html(name, [name], [Section(name, [table(name, [name], [[name]], search=True)])])
    assert page.count("</script>") == 2
    assert "<img" not in page
    assert content(page)["sections"][0]["items"][0]["columns"][0]["values"] == [name]
    # No address but the namespace of drawings, which is a name and is never opened.
    assert set(re.findall(r"https?://[^\"'\s]*", page)) == {"http://www.w3.org/2000/svg"}


def plain_numbers(values):
    return json.loads(json_for_script(values))


def test_numbers_are_short_and_finite():
    assert plain_numbers([1.23456789, np.nan, np.inf, 2.0, True, None, np.float64(3e-7)]) == [
        *(1.23457, None, None, 2, True, None, 3e-7)
    ]
    assert column("a", ["x", "x", "y", "x", None]) == {
        "name": "a",
        "words": ["x", "y"],
        "index": [0, 0, 1, 0, None],
    }
    values = [1.0] * 600 + [None, 0.2]
    assert column("a", values) == {
        "name": "a",
        "usual": 1.0,
        "count": 602,
        "others": [[600, None], [601, 0.2]],
    }


def test_a_campaigns_runs_are_in_its_page(results, tmp_path):
    page = page_of(results, tmp_path)
    rows = read_results(results)
    (campaign,) = items(page, "campaign")
    columns = {column["name"]: column for column in campaign["columns"]}
    shown = columns["ate_rmse_m"]["values"]
    assert shown == plain_numbers([row["ate_rmse_m"] for row in rows])
    assert campaign["curves"] == ["imu.gyroscope_bias"]
    assert {sensor["name"] for sensor in campaign["sensors"]} >= {"gyroscope_noise_density"}
    euler = [row["ate_rmse_m"] for row in rows if row["estimator"] == "euler"][6:12]
    group = [candidate for candidate in campaign["groups"] if candidate["estimator"] == "euler"][1]
    assert group["metrics"]["ate_rmse_m"][0] == pytest.approx(np.median(euler), rel=1e-5)
    (verdict,) = items(page, "verdict")
    judged = judge(load_plan(results / "plan.yaml"), rows, "ate_rmse_m")
    judgement = verdict["judged"][0]
    assert (judgement["lead"], judgement["rest"]) == headline(judged.headline, "ate_rmse_m", "2 %")
    line = judged.headline[0].line("ate_rmse_m", "2 %")
    assert line.endswith(judgement["contests"][0]["line"].replace(": ", "; ", 1))
    missed = [requirement for requirement in judged.requirements if not requirement.met]
    assert len(verdict["requirements"]["missed"]) == len(missed) > 0
    assert sum(failure["runs"] for failure in verdict["failures"]) == 1
    names = [item["name"] for item in items(page, "table")]
    assert names == ["cells", "parameters that vary", "constant parameters"]
    code = "\n".join(item["text"] for item in items(page, "code"))
    assert "imu_sim campaign plan.yaml -o results" in code
    assert (results / "plan.yaml").read_text() in code


def test_a_page_of_several_inputs_has_the_sections_of_each(results, bag, tmp_path):
    """Two campaigns, a bag, and a file of poses, which is an estimate of the bag's motion."""
    track = tmp_path / "other.tum"
    t = (START + np.arange(1, 50) * 1_000_000_000) / 1e9
    track.write_text("".join(f"{stamp:.9f} 1 2 3 0 0 0 1\n" for stamp in t))
    inputs = [str(path) for path in (results, results, bag, track)]
    output = tmp_path / "all.html"
    assert main([*inputs, "-o", str(output), "--quiet", "--title", "all of them"]) == 0
    page = output.read_text(encoding="utf-8")
    titles = [section["title"] for section in content(page)["sections"]]
    assert titles.count("results: Results") == 2
    assert titles[-6:] == [
        *("walk.mcap: estimates", "walk.mcap: motion"),
        *("walk.mcap: errors of /filter/odom", "walk.mcap: errors of other.tum"),
        *("walk.mcap: findings", "walk.mcap: readings"),
    ]
    assert len(items(page, "campaign")) == 2
    (path,) = items(page, "path")
    assert [line["name"] for line in path["series"]][1:] == ["/filter/odom", "other.tum"]
    assert "<title>all of them</title>" in page


def test_a_page_of_10_000_runs_is_small(results, tmp_path):
    """Under 1 MB: the runs of the campaign 93 times, with other seeds and digits."""
    rows = read_results(results)
    rng = np.random.default_rng(0)
    folder = tmp_path / "many"
    folder.mkdir()
    with (folder / "results.csv").open("w", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        for k in range(93):
            for row in rows:
                factor = rng.uniform(0.5, 2.0)
                moved = {n: v * factor for n, v in row.items() if isinstance(v, float)}
                moved |= {name: row[name] for name in ("imu.gyroscope_bias", *COVERED)}
                writer.writerow({**row, **moved, "seed": row["seed"] + 6 * k})
    (folder / "plan.yaml").write_bytes((results / "plan.yaml").read_bytes())
    page = page_of(folder, tmp_path)
    assert len(items(page, "campaign")[0]["columns"][0]["values"]) == 93 * 108
    assert len(page.encode()) < 1e6


def test_a_bags_streams_gaps_errors_and_consistency(bag, tmp_path):
    page = page_of(bag, tmp_path)
    plots = {item["title"]: item for item in items(page, "plot")}
    (path,) = items(page, "path")
    assert [line["name"] for line in path["series"]] == [
        "truth (/ground_truth/odom)",
        "/filter/odom",
    ]
    tables = {item["name"]: item for item in items(page, "table")}
    gaps = {line["name"]: line["values"] for line in tables["gaps of /imu/data_raw"]["columns"]}
    assert gaps == {
        "at [s]": [pytest.approx((GAP_AT - 1) / RATE + 1.0)],
        "interval [s]": [1],
        "in usual intervals": [100],
    }
    band, error = plots["/filter/odom: position error y"]["series"]
    assert band["high"][0] == pytest.approx(0.3)
    # Of 12 normal values the least and the largest lie some 1.6 sigma out.
    assert np.mean(np.abs(error["y"])) == pytest.approx(0.16, rel=0.1)
    nees = plots["NEES of the position"]["series"][1]
    assert len(nees["y"]) <= 1002
    (text,) = [i["text"] for i in items(page, "text") if i["text"].startswith("/filter/odom")]
    mean = float(re.search(r"NEES of the position (\S+)", text)[1])
    # The mean of 6,000 values whose variance is 6.
    rms = float(re.search(r"(\S+) m root mean square", text)[1])
    # Three axes of 0.1 m; the mean square of 18,000 normal values scatters by sqrt(2 / 18000).
    assert rms == pytest.approx(0.1 * np.sqrt(3), rel=4 * 0.5 * np.sqrt(2 / (3 * SAMPLES)))
    assert mean == pytest.approx(3.0, abs=4 * np.sqrt(6 / SAMPLES))


def moving_flight(folder, trajectory):
    """Return a bag of 12 s with an IMU and its truth."""
    flight = ims.simulate(imu="adis16448", trajectory=trajectory, duration=12, rate=100, seed=1)
    return flight, flight.save(folder / f"{trajectory}.mcap")


def test_the_answer_stands_first_and_estimates_have_one_colour(tmp_path):
    """Two dead reckonings, one of them without its last 4 s: both are compared over 8 s, too."""
    flight, bag = moving_flight(tmp_path, "circle")
    track = ims.dead_reckon(flight)
    worse = ims.dead_reckon(flight, method="euler")
    track.save(tmp_path / "good.tum")
    (tmp_path / "short.tum").write_text(
        "".join((worse.save(tmp_path / "worse.tum")).read_text().splitlines(keepends=True)[:801])
    )
    page = tmp_path / "page.html"
    files = [str(tmp_path / name) for name in ("good.tum", "short.tum")]
    assert main([str(bag), *files, "-o", str(page), "--quiet"]) == 0
    page = page.read_text(encoding="utf-8")
    top_section = content(page)["sections"][0]
    assert top_section["title"] == "circle.mcap: estimates"
    (table,) = [item for item in top_section["items"] if item["kind"] == "table"]
    columns = {column["name"]: column["values"] for column in table["columns"]}
    assert columns["estimate"] == ["good.tum", "short.tum"]
    good, short = (ims.evaluate(file, flight.truth) for file in files)
    for k, evaluation in enumerate((good, short)):
        assert columns["ATE [m]"][k] == pytest.approx(evaluation.rms_position, rel=1e-4)
        assert columns["attitude [rad]"][k] == pytest.approx(evaluation.rms_attitude, rel=1e-4)
        rpe = evaluation.to_dict([(1.0, "s")])["rpe"][0]["translation_m"]["rmse"]
        assert columns["RPE 1 s [m]"][k] == pytest.approx(rpe, rel=1e-4)
        drift = evaluation.to_dict()["final_drift_percent"]
        assert columns["drift [%]"][k] == pytest.approx(drift, rel=1e-4)
    common = np.sqrt(np.mean(np.sum(good.position[: len(short.position)] ** 2, axis=1)))
    assert columns["ATE, common time"] == [
        pytest.approx(common, rel=1e-3),
        pytest.approx(short.rms_position, rel=1e-4),
    ]
    assert top_section["items"][0]["text"].startswith(
        "Smallest ATE over the time that all cover: good"
    )
    titles = [section["title"] for section in content(page)["sections"]]
    assert set(table["links"].values()) <= {*titles}
    plots = {item["title"]: item for item in items(page, "plot")}
    for title in ("Length of the position error", "Length of the attitude error"):
        assert [line["colour"] for line in plots[title]["series"]] == [0, 1]
    (path,) = items(page, "path")
    assert [line["colour"] for line in path["series"]] == [None, 0, 1]
    for axis in "xyz":
        item = plots[f"short.tum: position error {axis}"]
        assert item["series"][0]["colour"] == axis
        assert item["y"]["label"] == "estimate - truth [m]"
        assert item["y"]["range"] == plots["short.tum: position error x"]["y"]["range"]
    spectrum = plots["Angular rate: spectrum"]["series"]
    assert [line["colour"] for line in spectrum] == ["x", "y", "z"]


@pytest.mark.parametrize(("trajectory", "at_rest"), [("static", True), ("circle", False)])
def test_only_an_imu_at_rest_has_an_allan_deviation(tmp_path, trajectory, at_rest):
    page = page_of(moving_flight(tmp_path, trajectory)[1], tmp_path)
    titles = [item["title"] for item in items(page, "plot")]
    assert ("Angular rate: Allan deviation" in titles) == at_rest
    missing = any("has no Allan deviation" in item["text"] for item in items(page, "text"))
    assert missing != at_rest


@pytest.mark.parametrize("rate", [400.1, 833.0])
def test_whole_milliseconds_are_no_gaps(rate):
    """Steps of 1 and 2 ms, or of 2 and 3: the clock has no losses, nor has the page."""
    t_ns = np.rint(np.arange(20_000) * 1e9 / rate).astype(np.int64) // 10**6 * 10**6
    noise = np.random.default_rng(1).standard_normal((len(t_ns), 6))
    block = Readings(t_ns, noise[:, :3], noise[:, 3:])
    plots = streams.analyse([block], len(t_ns))
    assert plots is not None
    assert plots.gap_count == 0
    assert 1.0 / plots.interval_s == pytest.approx(rate, rel=1e-4)


def test_the_spectrum_is_welchs_and_white_noise_lies_at_its_density(bag):
    """White noise of 0.02 rad/s at 100 Hz has a two-sided density of 0.002 rad/s/sqrt(Hz)."""
    imu = read_imu(bag)
    analysis = streams.analyse([imu], SAMPLES)
    assert analysis is not None
    assert analysis.gap_count == 1
    # The pieces of 30 s are shorter than a segment: one of them is the spectrum.
    piece = imu.gyro[:GAP_AT]
    f, power = scipy.signal.welch(piece, RATE, "hann", len(piece), axis=0, detrend="constant")
    high = f > 20
    theirs = np.sqrt(power[high][:-1].mean(axis=0) / 2)
    ours = np.sqrt((analysis.density[analysis.frequency > 20, :3] ** 2).mean(axis=0))
    # Bins of equal ratio weigh frequencies otherwise: 1200 values scatter by 1/sqrt(2400) = 2 %.
    assert ours == pytest.approx(theirs, rel=0.06)
    assert ours == pytest.approx([0.002] * 3, rel=0.08)
    sigma = analysis.deviation.deviation[0, 3:]
    assert sigma == pytest.approx([0.5] * 3, rel=0.05)


def test_streams_are_the_same_in_blocks_of_any_size(bag):
    imu = read_imu(bag)
    whole = streams.analyse([imu], SAMPLES)
    cuts = [0, 1, 7, 1000, 4999, SAMPLES]
    parts = [imu.rows(slice(start, stop)) for start, stop in itertools.pairwise(cuts)]
    in_parts = streams.analyse(parts, SAMPLES)
    for name in ("low", "high", "t_s", "longest", "density"):
        assert getattr(in_parts, name) == pytest.approx(getattr(whole, name), rel=1e-9), name
    assert in_parts.gaps == whole.gaps
    assert in_parts.deviation.deviation == pytest.approx(whole.deviation.deviation, rel=1e-6)


def complaints(capsys, *arguments):
    status = main([str(argument) for argument in arguments])
    return status, capsys.readouterr().err.splitlines()


def test_bad_inputs_are_one_line_each(results, bag, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "results.csv").write_text("cell,seed,estimator,status\n")
    (empty / "plan.yaml").write_text("seeds: 1\n")
    text_file = tmp_path / "words.txt"
    text_file.write_text("no readings\n")
    torn = tmp_path / "torn"
    torn.mkdir()
    (torn / "imu0.csv").write_text("1,0,0,0,0,0,9\n2,0,0\n")
    noise = tmp_path / "noise.mcap"
    noise.write_bytes(b"\x89MCAP" + bytes(100))
    for arguments, message in (
        (["none", "nor this"], "none: no such file or folder"),
        ([empty], f"{empty}: contains no run yet"),
        ([noise, "-o", tmp_path / "n.html"], "not an MCAP file"),
        (
            [results, "--metric", "beauty", "-o", tmp_path / "n.html"],
            "unknown --metric 'beauty'; must be",
        ),
        ([bag, "-o", tmp_path / "n.txt"], "must end in .html or .htm"),
        ([bag, "--truth-topic", "/x", "-o", tmp_path / "n.html"], "--truth-topic /x"),
        ([text_file, "-o", tmp_path / "n.html"], f"{text_file}: line 1: 2 columns"),
        ([torn, "-o", tmp_path / "n.html"], f"{torn / 'imu0.csv'}: line 2: 3 columns"),
    ):
        status, lines = complaints(capsys, *arguments)
        assert status == 2
        assert message in lines[0]
        assert all(line.startswith("report: ") for line in lines)
    assert not list(tmp_path.glob("*.html"))


def test_versions_that_are_not_text_are_shown_as_far_as_they_can(results, tmp_path):
    """A half-written versions.json shall not cost the page."""
    folder = tmp_path / "copy"
    shutil.copytree(results, folder)
    (folder / "versions.json").write_bytes(b"\x80\xff{")
    page = page_of(folder, tmp_path)
    assert any("\ufffd" in item["text"] for item in items(page, "code"))


def test_a_page_lies_in_its_campaign_and_is_not_overwritten(results, capsys):
    assert main([str(results), "--quiet"]) == 0
    status, lines = complaints(capsys, results)
    assert status == 2
    assert "already exists" in lines[0]
    (results / "report.html").unlink()


def test_numbers_come_from_all_poses_and_pictures_keep_a_jump(bag, tmp_path):
    """29,001 poses with a truth, one of them off by 50 m: 50 / sqrt(29001) = 0.2936 m."""
    count, jump = 30_000, 17_777
    t = START / 1e9 + 5.0 + np.arange(count) * 1e-3
    truth = read_odometry(bag, "/ground_truth/odom")
    position = np.stack([np.interp(t * 1e9, truth.t_ns, axis) for axis in truth.position.T], 1)
    position[jump, 1] += 50.0
    track = tmp_path / "jump.tum"
    rows = np.column_stack([position, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))])
    track.write_text(
        "".join(
            f"{int(stamp * 1e9) // 10**9}.{int(stamp * 1e9) % 10**9:09d} "
            + " ".join(f"{v:.9f}" for v in row)
            + "\n"
            for stamp, row in zip(t, rows, strict=True)
        )
    )
    page = tmp_path / "jump.html"
    assert main([str(bag), str(track), "-o", str(page), "--quiet"]) == 0
    page = page.read_text(encoding="utf-8")
    (text,) = [i["text"] for i in items(page, "text") if i["text"].startswith("jump.tum")]
    assert "0.2936 m root mean square over 29,001 poses" in text
    assert "at most 50 m" in text
    # 30 s of poses, 1 s of it in a gap of the truth; of its 60 s, the first 5 are allowed.
    assert "coverage 52.7 % of the truth's time" in text
    assert "999 poses without a truth are left out" in text
    plots = {item["title"]: item for item in items(page, "plot")}
    error = plots["jump.tum: position error y"]["series"][0]
    assert max(error["y"]) == pytest.approx(50.0, abs=1e-3)
    assert error["x"][int(np.argmax(error["y"]))] == pytest.approx(4.99 + jump * 1e-3, abs=1e-3)
    assert len(error["x"]) <= 1002
    (path,) = items(page, "path")
    (drawn,) = [line for line in path["series"] if line["name"] == "jump.tum"]
    assert max(drawn["y"]) > 47.0


def test_topics_have_rates_gaps_and_sizes_and_cameras_a_strip(bag, tmp_path):
    """The minute's IMU has a gap of 1 s; a camera of 2 Hz whose brightness grows by 10 a frame."""
    path = tmp_path / "seen.mcap"
    t_ns = START + np.arange(20) * 500_000_000
    with open_writer(path) as writer:
        encoder = ImageEncoder("cam0", 120, 400, "mono8")
        topic = writer.add_topic("/cam0/image_raw", IMAGE)
        for k, t in enumerate(t_ns.tolist()):
            image = np.full((120, 400), 10 * k, np.uint8)
            writer.write(topic, np.array([t]), [encoder.encode(t, image)])
        bias = np.column_stack([t_ns * 0.0 + 0.25, np.arange(20) * 0.01, np.zeros(20)])
        vector = Vector3StampedEncoder("imu").encode(t_ns, bias)
        writer.write(
            writer.add_topic("/ground_truth/gyroscope_bias", VECTOR3_STAMPED), t_ns, vector
        )
    page = page_of(path, tmp_path)
    (strip,) = items(page, "strip")
    assert [frame["t_s"] for frame in strip["frames"]] == [0, 2, 4, 5.5, 7.5, 9.5]
    for frame in strip["frames"]:
        image = decode_image(base64.b64decode(frame["png"]))
        assert image.shape == (40, 133)
        assert np.all(image == 20 * frame["t_s"])
    (plot,) = items(page, "plot")
    assert plot["title"] == "Bias: /ground_truth/gyroscope_bias"
    assert plot["y"]["label"] == "[rad/s]"
    assert plot["series"][1]["y"] == pytest.approx(bias[:, 1].tolist())
    page = page_of(bag, tmp_path / "other")
    (topics,) = [item for item in items(page, "table") if item["name"] == "topics"]
    columns = {column["name"]: column.get("values") for column in topics["columns"]}
    place = columns["topic"].index("/imu/data_raw")
    assert columns["rate [Hz]"][place] == pytest.approx(RATE)
    assert columns["mean [Hz]"][place] == pytest.approx((SAMPLES - 1) / 60.98, rel=1e-4)
    assert (columns["gaps"][place], columns["longest [s]"][place]) == (1, 1)
    assert columns["bytes"][place] > 300


def test_baselines_make_a_trend_and_the_last_is_compared_with(results, tmp_path):
    """An earlier campaign with twice the errors, and one with half of them."""
    folders = []
    for name, factor in (("monday", 2.0), ("tuesday", 0.5)):
        folder = tmp_path / name
        folder.mkdir()
        rows = read_results(results)
        with (folder / "results.csv").open("w", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            for row in rows:
                error = row["ate_rmse_m"]
                writer.writerow({**row, "ate_rmse_m": None if error is None else factor * error})
        folders += ["--baseline", folder]
    page = page_of(results, tmp_path, *folders)
    (campaign,) = items(page, "campaign")
    trend = campaign["trend"]
    assert trend["x"]["names"] == ["monday", "tuesday", "this"]
    for line in trend["series"]:
        assert line["y"] == pytest.approx(
            [2 * line["y"][2], line["y"][2] / 2, line["y"][2]], rel=1e-4
        )
    (compared,) = [i for i in items(page, "table") if i["name"] == "compared with tuesday"]
    sizes = unpacked(compared["columns"][2])
    assert len(sizes) == 18
    # 2 or 1.9999...: the words differ
    assert all(size.startswith(("2 times larger", "100 % larger")) for size in sizes), sizes


def test_poses_without_a_recording_are_on_common_axes(tmp_path):
    flight = ims.simulate(imu="perfect", trajectory="circle", rate=50, duration=4)
    poses = replace_fields(flight.truth, velocity=None, angular_velocity=None)
    for name in ("a.tum", "b.txt"):
        write_tum(tmp_path / name, poses)
    page = page_of(tmp_path / "a.tum", tmp_path, str(tmp_path / "b.txt"))
    titles = [section["title"] for section in content(page)["sections"]]
    assert titles == ["a.tum: motion", "a.tum: findings"]
    plots = {item["title"]: item for item in items(page, "plot")}
    for title in ("Orientation: roll", "Orientation: yaw"):
        assert [line["name"] for line in plots[title]["series"]] == ["a.tum", "b.txt"]
