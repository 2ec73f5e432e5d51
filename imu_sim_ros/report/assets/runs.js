// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A campaign: its runs, and the plots that follow the metric and the search.

const MOST_BOXES = 80;
const MOST_LINES = 8;

class Campaign {
  // data: {metrics, grid, columns, groups, sensors}
  constructor(data, host) {
    this.data = data;
    this.metric = data.metrics.find((one) => one.name === data.metric) || data.metrics[0];
    this.table = new Table(data.columns, {
      name: "runs", search: true,
      bad: (row, table) => table.column("status")[row] !== "done",
      onfilter: (rows) => { this.rows = rows; if (this.boxes) this.follow(); },
    });
    this.by = this.firstDivision();
    this.controls(host);
    this.plots(host);
    host.append(element("h3", {}, "Runs"),
      element("p", { class: "caption" }, 'The search narrows the box plots and the distributions above as well: words, name=value, name>number ("quotes" around spaces). A click on a box finds its runs.'),
      this.table.host);
  }

  values(name) { return this.table.column(name); }

  // The first of the grid's names and the estimator that has 2 to 8 values; else all groups.
  firstDivision() {
    for (const name of ["estimator", ...this.data.grid]) {
      const count = new Set(this.values(name)).size;
      if (count > 1 && count <= MOST_LINES) return name;
    }
    return "";
  }

  choice(words, options, chosen, onchange) {
    const select = element("select", { "aria-label": words, onchange: () => onchange(select.value) },
      ...options.map(([value, text]) => element("option", { value, selected: value === chosen ? "" : null }, text)));
    return element("label", {}, `${words} `, select);
  }

  controls(host) {
    const divisions = [["", "cell and estimator"], ["estimator", "estimator"], ...this.data.grid.map((name) => [name, name])];
    host.append(element("div", { class: "controls" },
      this.choice("metric", this.data.metrics.map((one) => [one.name, one.label]), this.metric.name, (name) => {
        this.metric = this.data.metrics.find((one) => one.name === name);
        this.follow();
        this.summarised();
      }),
      this.choice("group by", divisions, this.by, (name) => { this.by = name; this.follow(); })));
  }

  plots(host) {
    const grid = element("div", { class: "plots" });
    host.append(grid);
    const add = (spec, wide = false) => {
      const plot = new Plot(spec);
      if (wide) plot.figure.classList.add("wide");
      grid.append(plot.figure);
      return plot;
    };
    const [boxes, shares] = this.distributions();
    this.boxes = add(boxes, boxes.categories.length > 12);
    this.shares = add(shares);
    this.curves = this.curveSpecs().map((spec) => add(spec));
    this.consistency = this.data.consistency ? add(this.data.consistency) : null;
    if (this.data.sensors.length) this.sensorPage(grid);
    grid.querySelectorAll("figure").forEach((figure) => figure.setAttribute("data-campaign", ""));
  }

  follow() {
    const [boxes, shares] = this.distributions();
    this.boxes.show(boxes);
    this.shares.show(shares);
  }

  summarised() {
    this.curveSpecs().forEach((spec, k) => this.curves[k].show(spec));
    if (this.sensor) this.sensor.show(this.sensorSpec());
  }

  // The values of the metric in the runs that the search leaves, sorted, by the chosen division.
  divided() {
    const numbers = this.values(this.metric.name), found = new Map();
    const names = this.by ? this.values(this.by) : null, cells = this.values("cell"), estimators = this.values("estimator");
    const states = this.values("status");
    const several = new Set(estimators).size > 1;
    const rows = [...this.rows].sort((a, b) => a - b);
    for (const row of rows) {
      if (numbers[row] === null || states[row] !== "done") continue;
      const name = names ? `${this.by} = ${inWords(names[row], 6)}` : several ? `${cells[row]}; ${estimators[row]}` : cells[row];
      if (!found.has(name)) found.set(name, { name, numbers: [], row });
      found.get(name).numbers.push(numbers[row]);
    }
    const groups = [...found.values()];
    for (const group of groups) group.numbers.sort((a, b) => a - b);
    return groups;
  }

  distributions() {
    const groups = this.divided(), { label } = this.metric;
    const positive = groups.every((group) => group.numbers[0] > 0);
    const ends = [0.05, 0.95].map((p) => groups.map((group) => quantile(group.numbers, p)));
    const wide = groups.length && Math.max(...ends[1]) > 50 * Math.min(...ends[0]);
    const log = positive && Boolean(wide);
    const drawn = groups.slice(0, MOST_BOXES);
    const boxes = drawn.map((group, k) => {
      const at = (p) => quantile(group.numbers, p);
      return { name: group.name, count: group.numbers.length, low: at(0.05), q1: at(0.25), median: at(0.5), q3: at(0.75), high: at(0.95), colour: groups.length <= MOST_LINES ? k : 0 };
    });
    const rest = (most) => (groups.length > most ? ` The first ${most} of ${groups.length}; search the runs for others.` : "");
    const shares = groups.slice(0, MOST_LINES).map((group, k) => ({
      name: group.name, mode: "step", colour: k, x: group.numbers, y: group.numbers.map((_, i) => (i + 1) / group.numbers.length),
    }));
    return [
      { title: `${label}, by ${this.by || "cell"}`, x: { label, log }, categories: boxes.map((box) => box.name),
        series: [{ name: "", boxes, x: [], colour: 0 }], caption: "Median, quartiles, 5th and 95th percentile of the runs that are done." + rest(MOST_BOXES),
        onpick: (k) => this.pick(drawn[k]) },
      { title: `Share of runs below (ECDF), by ${this.by || "cell"}`, x: { label, log }, y: { label: "share of runs", range: [0, 1.02] }, legend: true, series: shares, caption: rest(MOST_LINES).trim() },
    ];
  }

  pick(group) {
    if (!group) return;
    const quoted = (name) => `${name}="${String(this.values(name)[group.row]).replaceAll('"', "")}"`;
    this.table.filter(this.by ? quoted(this.by) : `${quoted("cell")} ${quoted("estimator")}`);
  }

  // The median with its interval over each parameter of the grid that is a number.
  curveSpecs() {
    const { groups, grid } = this.data, { name: metric, label } = this.metric;
    return this.data.curves.map((parameter) => {
      const lines = new Map();
      for (const group of groups) {
        const summary = group.metrics[metric];
        if (!summary) continue;
        const rest = grid.filter((name) => name !== parameter).map((name) => `${name}=${inWords(group.values[name], 3)}`);
        if (this.data.estimators > 1) rest.push(group.estimator);
        const name = rest.join(", ") || "median";
        if (!lines.has(name)) lines.set(name, []);
        lines.get(name).push([group.values[parameter], ...summary]);
      }
      const series = [...lines].slice(0, MOST_LINES).map(([name, points], k) => {
        points.sort((a, b) => a[0] - b[0]);
        return { name, colour: k, x: points.map((p) => p[0]), y: points.map((p) => p[1]), low: points.map((p) => p[2]), high: points.map((p) => p[3]) };
      });
      const log = groups.every((group) => group.values[parameter] > 0);
      const tall = series.every((one) => one.y.every((value) => value > 0));
      const [least, most] = extent(series.flatMap((one) => one.y)) || [1, 1], wide = most > 5 * least;
      const slopes = this.data.slopes.filter((one) => one.metric === metric && one.parameter === parameter)
        .map((one) => `${one.estimator}: ${inWords(one.slope, 3)} (${inWords(one.low, 3)} to ${inWords(one.high, 3)})`);
      const told = slopes.length ? ` Slope of the logarithms, 95 %: ${slopes.join("; ")}.` : "";
      const missing = lines.size > MOST_LINES ? ` The first ${MOST_LINES} of ${lines.size} lines.` : "";
      return { title: `${label} over ${parameter}`, x: { label: parameter, log }, y: { label, log: tall && wide }, legend: true, series, caption: `Median with its 95 % interval.${told}${missing}` };
    });
  }

  sensorPage(grid) {
    this.property = this.data.sensors[0].name;
    this.sensor = new Plot(this.sensorSpec());
    this.sensor.figure.classList.add("wide");
    const choice = element("div", { class: "controls wide" }, this.choice("Which IMU? Error over its", this.data.sensors.map((one) => [one.name, one.label]), this.property, (name) => {
      this.property = name;
      this.sensor.show(this.sensorSpec());
    }));
    grid.append(choice, this.sensor.figure);
  }

  sensorSpec() {
    const { groups, grid } = this.data, { name: metric, label } = this.metric;
    const property = this.data.sensors.find((one) => one.name === this.property);
    const lines = new Map();
    groups.forEach((group, k) => {
      const summary = group.metrics[metric], x = property.values[k];
      if (!summary || !(x > 0)) return;
      const rest = grid.filter((name) => name !== "imu").map((name) => `${name}=${inWords(group.values[name], 3)}`);
      if (this.data.estimators > 1) rest.push(group.estimator);
      const name = rest.join(", ") || "median";
      if (!lines.has(name)) lines.set(name, []);
      lines.get(name).push([x, ...summary, String(group.values.imu)]);
    });
    const series = [...lines].slice(0, MOST_LINES).map(([name, points], k) => {
      const column = (place) => points.map((point) => point[place]);
      return { name, mode: "bars", colour: k, x: column(0), y: column(1), low: column(2), high: column(3), labels: column(4) };
    });
    const tall = series.every((one) => one.y.every((value) => value > 0));
    return { title: `${label} over ${property.label}`, x: { label: property.label, log: true }, y: { label, log: tall }, legend: true, series,
      caption: "Each point is a preset: median with its 95 % interval. Presets without this error are left out." };
  }
}
