# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pages in a real browser, as wide as a desk's screen and as a phone's."""

import base64
import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.campaigns.effects import BETTER, WORSE
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.results import read_results
from imu_sim_ros.campaigns.verdict import judge
from imu_sim_ros.commands.report import main
from imu_sim_ros.core.digits import interval_texts

from .conftest import HOSTILE

WIDTHS = (1280, 390)


@pytest.fixture(scope="module")
def pages(results, all_sensors, bag, tmp_path_factory):
    """Return the folder of three pages, of two campaigns and of a bag."""
    folder = tmp_path_factory.mktemp("pages")
    sources = ((results, "campaign.html"), (all_sensors, "sensors.html"), (bag, "bag.html"))
    for source, name in sources:
        assert main([str(source), "-o", str(folder / name), "--quiet"]) == 0
    return folder


@pytest.fixture
def opened(browser, pages):
    """Return a function that opens a page; there must be no complaint by then, nor at the end."""

    def one(name, width=1280):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get((pages / name).as_uri())
        assert browser.execute_script("return 'ready' in document.documentElement.dataset")
        return browser

    yield one
    assert browser.get_log("browser") == []


def run(browser, script, *arguments):
    """Run a script that knows ``figure`` and ``table``: one by its title's or name's beginning."""
    tools = """
    const figure = (title) => document.querySelector(`figure[data-plot^="${title}"]`);
    const table = (name) => document.querySelector(`[data-table^="${name}"]`);
    """
    return browser.execute_script(tools + script, *arguments)


def test_shortened_names_of_groups_are_told_apart_on_a_phone(opened):
    """A cell's name ends with its estimator, the only difference between neighbours."""
    labels = run(
        opened("campaign.html", 390),
        """return [...figure("ATE RMSE").querySelectorAll("text > title")].map((title) =>
        [title.parentNode.firstChild.textContent, title.textContent])""",
    )
    assert len({label for label, _ in labels}) == len(labels) > 1
    assert all(label[-6:] == whole[-6:] for label, whole in labels)
    assert any("\u2026" in label for label, _ in labels)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ["campaign.html", "sensors.html", "bag.html"])
def test_every_plot_is_drawn_and_fits(opened, name, width):
    page = opened(name, width)
    drawn = run(
        page,
        """return [...document.querySelectorAll("figure")].map((one) => [one.dataset.plot,
        Number(one.dataset.drawn), one.querySelector("svg").clientWidth])""",
    )
    assert len(drawn) >= 5
    for title, marks, wide in drawn:
        assert marks > 0, title
        assert 200 < wide <= width, title
    # Nothing is wider than the window: a phone's page is not pushed from side to side.
    assert run(page, "return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("name", ["campaign.html", "bag.html"])
@pytest.mark.parametrize("width", WIDTHS)
def test_axes_have_three_ticks_and_no_label_lies_over_them(opened, name, width):
    """Numbers of the vertical axis end before the frame and begin behind the axis' label."""
    plots = run(
        opened(name, width),
        """return [...document.querySelectorAll("figure[data-plot]")].filter((one) =>
          one.offsetWidth && one.querySelector("rect.frame")).map((one) => {
          const at = (mark) => { const box = mark.getBoundingClientRect();
            return [box.left, box.right, box.top, box.bottom]; };
          const ticks = [...one.querySelectorAll("text.tick")];
          const label = one.querySelector("text[transform]");
          return [one.dataset.plot, at(one.querySelector("rect.frame")), ticks.map(at),
            label && at(label)]; })""",
    )
    assert plots
    for title, frame, ticks, label in plots:
        across = [tick for tick in ticks if tick[2] >= frame[3] - 1]
        up = [tick for tick in ticks if tick not in across]
        assert len(across) >= 3, title
        assert all(a[1] < b[0] for a, b in itertools.pairwise(across)), title
        if label is not None:
            assert len(up) >= 3, title
            assert all(label[1] <= tick[0] + 1 and tick[1] <= frame[0] for tick in up), title


@pytest.mark.parametrize("width", WIDTHS)
def test_a_path_and_the_ends_of_its_axes_lie_in_the_picture(opened, width):
    page = opened("bag.html", width)
    for view in ("initial view", "from above", "from the side"):
        run(page, "figure('Path').querySelector(`button[title='${arguments[0]}']`).click()", view)
        outliers = run(
            page,
            """const frame = figure("Path").querySelector("svg").getBoundingClientRect();
            return [...figure("Path").querySelectorAll("svg text, path.track")].filter((mark) => {
              const box = mark.getBoundingClientRect();
              return box.left < frame.left - 1 || box.right > frame.right + 1
                || box.top < frame.top - 1 || box.bottom > frame.bottom + 1; }).length""",
        )
        assert outliers == 0, view


def test_the_legend_shows_a_band_as_a_band_and_a_line_as_a_line(opened):
    marks = run(
        opened("bag.html"),
        """return [...figure("/filter/odom: position error x").querySelectorAll(".legend button")]
        .map((one) => [one.textContent, [...one.querySelector("svg").children].map(
          (mark) => mark.tagName)])""",
    )
    assert marks == [["3 sigma, as stated", ["rect"]], ["error", ["line"]]]


def test_a_page_rounds_intervals_as_the_terminal_does(opened):
    """Two digits of the half width; 400 intervals over 24 decades, with ties and carries."""
    rng = np.random.default_rng(3)
    values = rng.normal(size=380) * 10.0 ** rng.uniform(-12.0, 12.0, 380)
    widths = np.abs(values)[:, None] * 10.0 ** rng.uniform(-5.0, 1.0, (380, 2))
    intervals = np.column_stack([values, values - widths[:, 0], values + widths[:, 1]]).tolist()
    intervals += [[12.5, 2.5, 22.5], [0.125, 0.0, 0.25], [6.3e-5, 0.0, 9.99e-5], [1.0, 0.9996, 1.1]]
    intervals += [[2198.0, 1800.0, 2600.0], [9.96, 8.0, 9.996], [-2.5, -12.5, 7.5]]
    script = "return arguments[0].map((ends) => intervalInWords(...ends))"
    texts = opened("campaign.html").execute_script(script, intervals)
    assert texts == [list(interval_texts(*ends)) for ends in intervals]


@pytest.mark.parametrize("width", WIDTHS)
def test_pages_are_accessible(opened, width):
    """axe-core finds no violation of WCAG, light and dark."""
    package = pytest.importorskip("axe_selenium_python")
    library = Path(package.__file__).parent / "node_modules/axe-core/axe.min.js"
    script = "axe.run().then((found) => arguments[0](found.violations))"
    for name in ("campaign.html", "bag.html"):
        page = opened(name, width)
        page.execute_script(library.read_text(encoding="utf-8"))
        for _ in range(2):
            # axe-core 3 does not read color(srgb ...), which mixed colours are: a ratio of None.
            violations = [
                (violation["id"], node["html"][:200])
                for violation in page.execute_async_script(script)
                for node in violation["nodes"]
                if not any(
                    (check["data"] or {}).get("contrastRatio", 0) is None for check in node["any"]
                )
            ]
            assert not violations, name
            run(page, "document.querySelector('nav button').click()")


def test_an_estimate_leads_to_its_errors(opened):
    page = opened("bag.html", 390)
    link = "return table('all estimates').querySelector('a')"
    place = run(page, f"{link}.getBoundingClientRect().bottom")
    assert place < 844  # in sight on a phone, without scrolling
    run(page, f"{link.removeprefix('return ')}.click()")
    heading = run(page, "return document.querySelector(location.hash + ' h2').textContent")
    assert heading == "walk.mcap: errors of /filter/odom"


def test_hostile_names_are_text(opened):
    page = opened("campaign.html")
    assert page.title == HOSTILE
    assert run(page, "return document.querySelector('h1').textContent") == HOSTILE
    assert run(page, "return document.images.length") == 0
    failures = "return document.querySelector('[data-failures]').textContent"
    assert HOSTILE in run(page, failures)


def test_ticks_of_values_that_hardly_differ_are_told_apart(opened):
    """With three digits, all four labels would be 0.0179."""
    page = opened("bag.html")
    ticks = "ticksInWords(new Scale([0.017911, 0.017947], false, 0, 1).ticks(4), 3)"
    assert run(page, f"return {ticks}") == ["0.01792", "0.01793", "0.01794"]
    assert run(page, "return ticksInWords([0, 0.5, 1], 3)") == ["0", "0.5", "1"]
    assert run(page, "return ticksInWords([1e-7, 2e-7], 3)") == ["1e-7", "2e-7"]


def test_nothing_is_fetched(opened):
    page = opened("bag.html")
    assert run(page, "return performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize("width", WIDTHS)
def test_links_lead_to_sections(opened, width):
    page = opened("campaign.html", width)
    for link in page.find_elements("css selector", "#links a"):
        link.click()
        target = link.get_attribute("href").partition("#")[2]
        top = run(
            page, "return document.getElementById(arguments[0]).getBoundingClientRect().top", target
        )
        bottom = run(
            page, "return innerHeight + scrollY >= document.documentElement.scrollHeight - 2"
        )
        assert 0 <= top < 120 or bottom


SORTED = """
const host = table("runs"), buttons = [...host.querySelectorAll("th button")];
const k = buttons.findIndex((one) => one.textContent.startsWith("ate_rmse_m"));
for (let times = 0; times < arguments[0]; times++) buttons[k].click();
return [[...host.querySelectorAll("tbody tr")].map((row) => row.children[k].textContent),
  buttons[k].parentElement.getAttribute("aria-sort")];
"""


@pytest.mark.parametrize("width", WIDTHS)
def test_the_table_of_runs_is_sorted_by_a_click(opened, width):
    page = opened("campaign.html", width)
    for clicks, order in ((1, "ascending"), (1, "descending")):
        fields, state = run(page, SORTED, clicks)
        values = [float(word) for word in fields if word]
        assert state == order
        assert len(values) == 25
        assert values == sorted(values, reverse=order == "descending")


@pytest.mark.parametrize("width", WIDTHS)
def test_the_search_narrows_table_and_plots(opened, width):
    page = opened("campaign.html", width)
    count = """return [Number(table("runs").dataset.rows),
      figure("ATE RMSE [m], by").querySelectorAll(".box").length]"""
    search = """const input = table("runs").querySelector("input"); input.value = arguments[0];
    input.dispatchEvent(new Event("input"));"""
    assert run(page, count) == [108, 18]
    for query, rows, boxes in (
        ("estimator=euler", 54, 9),
        ("imu=mpu6000 imu.gyroscope_bias=0.01 estimator=midpoint", 6, 1),
        ("seed<2 bmi088", 12, 6),
        ("imu=mpu", 36, 6),
        ('imu="mpu"', 0, 0),
        ("gyroscope_b=0.1 estimator=eul", 18, 3),
        ("onerror", 1, 0),
        ("no such words", 0, 0),
        ("", 108, 18),
    ):
        run(page, search, query)
        assert run(page, count) == [rows, boxes], query


def test_unknown_columns_are_said(opened):
    page = opened("campaign.html")
    script = """const host = table("runs"), input = host.querySelector("input[type=search]");
    input.value = arguments[0]; input.dispatchEvent(new Event("input"));
    return [host.querySelector("[role=status]").textContent, Number(host.dataset.rows)]"""
    status, rows = run(page, script, "speed>3")
    assert status.startswith("no column speed; there are seed, estimator, status, imu")
    assert rows == 0
    status, rows = run(page, script, "ate>0.001")
    assert status == (
        "ate: several columns have this in their name: ate_rmse_m, ate_rmse_rad, estimated_share"
    )
    status, rows = run(page, script, "seed<two")
    assert status == "seed<two: < needs a number"
    assert run(page, script, "seed<1") == ["18 of 108 rows", 18]


@pytest.mark.parametrize("width", WIDTHS)
def test_the_verdict_is_on_top_and_its_links_lead_to_the_runs(opened, width):
    page = opened("campaign.html", width)
    heading = run(page, "return document.querySelector('main section h2').textContent")
    assert heading == "Verdict"
    failed = page.find_element("css selector", ".failed.box")
    # The median of ate_rmse_m is above 1 mm with the largest bias at least, and one run failed.
    assert "requirements not met" in failed.text
    link = failed.find_element("css selector", "a")
    place = run(page, "return arguments[0].parentElement.textContent", link)
    link.click()
    cells = """return [...table("runs").querySelectorAll("tbody tr")].map((row) =>
      row.textContent)"""
    rows = run(page, cells)
    assert len(rows) == 6
    estimator = "midpoint" if "midpoint" in place else "euler"
    assert all("mpu6000" in row and estimator in row for row in rows)


def test_the_matrix_says_who_is_better_and_by_how_much(opened, results):
    page = opened("campaign.html")
    matrix = run(
        page,
        """const menu = document.querySelector('select[aria-label="verdict on"]');
        menu.value = [...menu.options].findIndex((one) =>
          one.text.startsWith("which imu.gyroscope_bias: ATE"));
        menu.dispatchEvent(new Event("change"));
        const where = document.querySelector('select[aria-label="where"]');
        where.value = [...where.options].find((one) => one.text === "adis16448, midpoint").value;
        where.dispatchEvent(new Event("change"));
        const matrix = document.querySelector("table.matrix:not(.overview)");
        return [[...matrix.querySelectorAll("tbody th")].map((one) => one.textContent),
          [...matrix.querySelectorAll("tbody tr")].map((row) =>
            [...row.querySelectorAll("td")].map((one) => one.textContent))]""",
    )
    names, fields = matrix
    assert names == ["0.001", "0.01", "0.1"]  # the best first
    assert [fields[k][k] for k in range(3)] == [""] * 3
    # What the row is divided by, the column is multiplied by.
    assert fields[0][2][0] == "\u00f7"
    assert fields[2][0] == fields[0][2].replace("\u00f7", "\u00d7")
    judged = judge(load_plan(results / "plan.yaml"), read_results(results), "ate_rmse_m")
    (contest,) = [
        contest
        for contest in judged.contests
        if contest.where == {"imu": "adis16448", "estimator": "midpoint"}
    ]
    (effect,) = [pair for pair in contest.effects if (pair.a, pair.b) == ("0.001", "0.1")]
    assert fields[0][2] == f"\u00f7{1.0 / effect.effect.value:.3g}"


def test_a_row_opens_with_path_and_command(opened, results, tmp_path):
    """The command is run by a shell, and makes the same run again."""
    page = opened("campaign.html")
    run(
        page,
        """const input = table("runs").querySelector("input[type=search]");
        input.value = 'status=done imu=bmi088 imu.gyroscope_bias=0.1 estimator=euler';
        input.dispatchEvent(new Event("input"));
        for (let k = 0; k < 6; k++) table("runs").querySelectorAll("button.open")[k].click();""",
    )
    details = page.find_elements("css selector", "tr.detail")
    assert len(details) == 6
    assert all("final_velocity_error_m_s" in detail.text for detail in details)
    paths = page.find_elements("css selector", "tr.detail figure path.track")
    assert len(paths) >= 2  # truth and estimate of the run in the middle
    command = details[2].find_element("css selector", "pre.repeat").get_attribute("textContent")
    seed = int(re.search(r'"seeds":\[(\d+)', command)[1])
    campaign = f"{sys.executable} -m imu_sim_ros.commands.campaign"
    command = command.replace("\nimu_sim campaign ", f"\n{campaign} ")
    done = subprocess.run(["/bin/sh", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (again,) = read_results(tmp_path / "run")
    (original,) = [
        row
        for row in read_results(results)
        if (row["seed"], row["estimator"], row["imu"]) == (seed, "euler", "bmi088")
        and row["imu.gyroscope_bias"] == 0.1
    ]
    original.pop("common_time")  # of all estimators of the flight; the command repeats one
    assert again == original


def test_columns_are_chosen(opened):
    page = opened("campaign.html")
    heads = "return [...table('runs').querySelectorAll('th')].map((one) => one.dataset.name)"
    columns = run(page, heads)
    assert columns[:5] == ["seed", "estimator", "status", "imu", "imu.gyroscope_bias"]
    assert "cell" not in columns
    run(
        page,
        """const label = [...table("runs").querySelectorAll("details.columns label")].find((one) =>
        one.textContent.trim() === arguments[0]); label.querySelector("input").click()""",
        "cell",
    )
    assert run(page, heads) == [*columns, "cell"]


def test_success_is_a_metric(opened):
    page = opened("campaign.html")
    titles = run(
        page,
        """const menu = document.querySelector('select[aria-label="metric"]');
        menu.value = "success"; menu.dispatchEvent(new Event("change"));
        return [...document.querySelectorAll("figure h3")].filter((one) => one.offsetWidth)
          .map((one) => one.textContent)""",
    )
    assert "Success rate, by cell and estimator" in titles
    assert "success rate over imu.gyroscope_bias" in titles
    assert not any("ECDF" in title for title in titles)


@pytest.mark.parametrize("name", ["campaign.html", "bag.html"])
def test_rows_of_plots_are_full_and_the_theme_button_is_on_the_screen(opened, name):
    page = opened(name)
    rows = run(
        page,
        """return [...document.querySelectorAll(".plots")].filter((one) => one.offsetWidth)
        .map((grid) => { const rows = new Map();
          for (const one of grid.children) {
            if (!one.offsetWidth) continue;
            const at = one.getBoundingClientRect();
            rows.set(Math.round(at.top / 20), (rows.get(Math.round(at.top / 20)) || 0) + at.width);
          }
          return [grid.clientWidth, [...rows.values()]]; })""",
    )
    assert rows
    for width, widths in rows:
        assert all(row_width > 0.95 * width for row_width in widths)
    page = opened(name, 390)
    box = "return document.querySelector('nav button').getBoundingClientRect()"
    bounds = run(page, box)
    assert bounds["left"] >= 0
    assert bounds["right"] <= 390
    page = opened(name, 360)
    links = "return [...document.querySelectorAll('#links')].map((one) => [one.scrollWidth - "
    links += "one.clientWidth, one.getBoundingClientRect().right])[0]"
    hidden, edge = run(page, links)
    assert edge <= run(page, box)["left"]
    assert name != "campaign.html" or hidden <= 0  # all five links of a campaign are in sight


@pytest.mark.parametrize("width", WIDTHS)
def test_dragging_zooms_all_linked_plots(opened, width):
    from selenium.webdriver import ActionChains

    page = opened("bag.html", width)
    ranges = """const names = ["Angular rate", "Specific force",
        "Gaps", "Angular rate: spectrum"];
      const at = (name) => figure(name).dataset;
      return names.map((name) => [Number(at(name).x0), Number(at(name).x1)])"""
    initial = run(page, ranges)
    area = page.find_element("css selector", 'figure[data-plot="Specific force"] .area')
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", area)
    wide = area.rect["width"]
    ActionChains(page, duration=20).move_to_element_with_offset(
        area, int(-wide / 4), 0
    ).click_and_hold().move_by_offset(int(wide / 2), 3).release().perform()
    zoomed = run(page, ranges)
    whole = initial[1][1] - initial[1][0]
    for range_initial, range_zoomed in zip(initial[:3], zoomed[:3], strict=True):
        assert range_zoomed[0] == pytest.approx(range_initial[0] + whole / 4, abs=0.02 * whole)
        assert range_zoomed[1] == pytest.approx(range_initial[1] - whole / 4, abs=0.02 * whole)
    assert zoomed[3] == initial[3]
    run(page, "figure('Gaps').querySelector('[title=\"whole range\"]').click()")
    assert run(page, ranges) == initial


def test_the_path_turns_and_series_can_be_hidden(opened):
    page = opened("bag.html")
    line = "return figure('Path').querySelector('path.track').getAttribute('d')"
    outline = run(page, line)
    run(page, "figure('Path').querySelector('[title=\"from above\"]').click()")
    assert run(page, line) != outline
    run(page, "figure('Path').querySelector('.legend button').click()")
    assert run(page, "return Number(figure('Path').dataset.drawn)") == 1
    hidden = """const one = figure("Angular rate"), before = one.dataset.drawn;
    one.querySelector(".legend button").click();
    return [Number(before), Number(one.dataset.drawn)]"""
    count_drawn, count_hidden = run(page, hidden)
    assert count_hidden < count_drawn


def test_the_metric_and_the_sensor_page_follow_their_menus(opened):
    page = opened("campaign.html")
    run(
        page,
        """for (const [label, value] of [["metric", "final_attitude_error_rad"],
          ["Which IMU? Error over its", "accelerometer_noise_density"], ["group by", "imu"]]) {
          const menu = document.querySelector(`select[aria-label="${label}"]`);
          menu.value = value; menu.dispatchEvent(new Event("change")); }""",
    )
    titles = run(
        page, "return [...document.querySelectorAll('figure h3')].map((one) => one.textContent)"
    )
    assert "final attitude error [rad], by imu" in titles
    assert "final attitude error [rad] over accelerometer noise density [m/s^2/sqrt(Hz)]" in titles
    assert "final attitude error [rad] over imu.gyroscope_bias" in titles
    labels = run(
        page,
        "return [...document.querySelectorAll('figure text.label')].map((one) => one.textContent)",
    )
    # Each name once, though there are six lines of points.
    assert sorted(labels) == ["adis16448", "bmi088", "mpu6000"]


def test_plots_are_drawn_for_the_width_of_paper(opened):
    """Small plots in rows of three; the verdict's pairs are as wide as a large matrix."""
    page = opened("sensors.html")
    wide = """dispatchEvent(new Event(arguments[0]));
    return ['1 to 8', 'ate_rmse_m: '].map((title) => Math.floor(
      figure(title).querySelector('svg').getAttribute("viewBox").split(" ")[2]))"""
    assert run(page, wide, "beforeprint") == [233, 700]
    assert run(page, wide, "afterprint")[1] > 1000


def test_dark_and_light_have_contrast(opened):
    """Words against paper at least 7:1 (WCAG 2.1, success criterion 1.4.6), in both."""
    page = opened("campaign.html")
    themes = []
    for _ in range(2):
        run(page, "document.querySelector('nav button').click()")
        colours = run(
            page, "const s = getComputedStyle(document.body); return [s.color, s.backgroundColor]"
        )
        light, dark = sorted(map(luminance, colours), reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 7.0
        themes.append(colours)
    assert themes[0] != themes[1]


def luminance(colour):
    """Return the relative luminance of ``rgb(r, g, b)`` by WCAG 2.1."""
    parts = [int(part) / 255 for part in colour[4:-1].split(",")]
    linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_paper_has_the_first_rows_and_no_column_beyond_its_edge(opened):
    page = opened("campaign.html", 720)  # about an A4 page's width between its margins
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        shown = """window.dispatchEvent(new Event(arguments[0]));
        return table("runs").querySelectorAll("tbody tr").length"""
        rows = int(run(page, "return table('runs').dataset.rows"))
        assert run(page, shown, "beforeprint") == 10 < rows
        cells = "return table('cells').querySelectorAll('tbody tr').length"
        assert run(page, cells) == 18  # all of them
        for name, columns, edge in run(
            page,
            """return [...document.querySelectorAll("[data-table]")].map((one) => [
            one.dataset.table, [...one.querySelectorAll("th")].filter((th) => th.offsetWidth).map(
            (th) => [th.dataset.name, getComputedStyle(th, "::after").content]),
            one.querySelector("table").getBoundingClientRect().right])""",
        ):
            assert edge <= 720, name
            # The names of columns are printed by what is repeated on every page.
            assert all(content == f'"{head}"' for head, content in columns), name
        assert run(page, shown, "afterprint") == 25
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


@pytest.mark.parametrize(("name", "limit"), [("campaign.html", 4), ("sensors.html", 6)])
def test_a_campaign_is_printed_on_few_pages(opened, name, limit):
    """A4, as the browser prints it by itself, with all 69 rows of the sensors' cells."""
    page = opened(name)
    settings = {"paperWidth": 8.27, "paperHeight": 11.69, "printBackground": True}
    printed = page.execute_cdp_cmd("Page.printToPDF", settings)
    pages = re.findall(rb"/Type\s*/Page\b", base64.b64decode(printed["data"]))
    assert 2 <= len(pages) <= limit


def test_the_matrix_of_all_sensors_is_whole(opened):
    """23 columns are seen without scrolling, whether they have counts or effects."""
    page = opened("sensors.html")
    sizes = """const where = document.querySelector('select[aria-label="where"]');
    return [...where.options].map((option) => {
      where.value = option.value;
      where.dispatchEvent(new Event("change"));
      const matrix = document.querySelector("table.matrix:not(.overview)");
      return [matrix.querySelectorAll("thead th").length, matrix.parentElement.scrollWidth -
        matrix.parentElement.clientWidth];
    })"""
    assert run(page, sizes) == [[23, 0]] * 4


def test_the_sensor_without_errors_is_not_ranked(opened):
    """The sensor without errors wins without a contest; the best real sensor is named."""
    page = opened("sensors.html")
    script = "return document.querySelector('.headline').textContent + [...document."
    script += "querySelectorAll('table.overview button')].map((one) => one.title)"
    titles = run(page, script)
    assert "ate_rmse_m" in titles
    assert "perfect" not in titles
    rows = (
        "return [...document.querySelectorAll('table.matrix:not(.overview) tbody th')].map((one) =>"
    )
    assert run(page, rows + "one.textContent)")[-1] == "perfect"


def test_the_overview_has_every_cell_and_opens_its_comparison(opened, results):
    """Nine cells of imu and bias: three rows, three columns; who leads is who is judged best."""
    page = opened("campaign.html")
    fields = run(
        page,
        """return [...document.querySelectorAll("table.overview tbody tr")].map((row) =>
          [...row.children].map((one) => one.textContent))""",
    )
    judged = judge(load_plan(results / "plan.yaml"), read_results(results), "ate_rmse_m")
    labels = {BETTER: None, WORSE: None}
    expected = [
        line.best or labels.get(line.lead.verdict, line.lead.verdict) for line in judged.headline
    ]
    shown = [field for row in fields for field in row[1:]]
    assert [row[0] for row in fields] == ["mpu6000", "adis16448", "bmi088"]
    assert len(shown) == len(expected) == 9
    assert all(field.startswith(str(best)) for field, best in zip(shown, expected, strict=True))
    opens = "document.querySelectorAll('table.overview button')[4].click();"
    chosen = run(page, f"{opens} return document.querySelector('select[aria-label=where]').value")
    assert chosen == "4"


def test_every_group_has_a_distribution_in_the_colour_of_its_estimator(opened):
    """18 groups of two estimators: nine panels, two colours in them and in the boxes."""
    page = opened("campaign.html")
    panels, boxes = run(
        page,
        """const strokes = (all) => [...all].map((one) => one.getAttribute("stroke"));
        return [[...document.querySelectorAll(".multiples figure")].map((one) =>
          strokes(one.querySelectorAll("g[clip-path] path"))),
          strokes(document.querySelectorAll(".box rect"))]""",
    )
    assert panels == [["var(--c0)", "var(--c1)"]] * 9
    assert boxes == ["var(--c0)", "var(--c1)"] * 9


def test_the_table_of_topics_is_whole(opened):
    page = opened("bag.html")
    cut = "const it = table('topics').querySelector('.scroll'); return it.scrollWidth - it."
    assert run(page, f"{cut}clientWidth") == 0
