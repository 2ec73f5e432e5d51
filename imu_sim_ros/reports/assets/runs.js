// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A campaign: its runs, and the plots that follow the metric and the search.

const MOST_BOXES = 80;
const MOST_LINES = 8;  // in a plot

class Campaign {
  // data: {metrics, grid, columns, groups, sensors, opened, plan}
  constructor(data, host) {
    this.data = data;
    this.metric = data.metrics.find((metric) => metric.name === data.metric) || data.metrics[0];
    this.table = new Table(data.columns, {
      name: "runs", search: true, shown: data.shown,
      bad: (row, table) => table.column("status")[row] !== "done",
      detail: (row) => this.detail(row),
      onfilter: (rows) => { this.rows = rows; if (this.boxes) this.follow(); },
    });
    this.group = new Map(data.groups.map((group) => [`${group.cell}\n${group.estimator}`, group]));
    this.by = "";
    this.controls(host);
    this.plots(host);
    this.heading = element("h3", {}, "Runs");
    host.append(this.heading,
      element("p", { class: "caption" }, 'The search narrows the box plots and the distributions above as well: parts of words, name=part, name="whole", name>number. A click on a box finds its runs; \u25b8 opens a run.'),
      this.table.host);
  }

  values(name) { return this.table.column(name); }

  find(query) {
    this.table.filter(query);
    this.heading.scrollIntoView();
  }

  // Everything about a run: its parameters, what it printed, its path, and the command to repeat it.
  detail(row) {
    const { opened, cells } = this.data, cell = this.values("cell")[row], estimator = this.values("estimator")[row];
    const more = opened[row] || {}, parts = [];
    const fields = this.table.columns.filter((column) => column.values[row] !== null).map((column) => element("div", {}, element("span", { class: "faint" }, column.name), ` ${inWords(column.values[row], 6)}`));
    parts.push(element("div", { class: "fields" }, ...fields));
    if (more.folder) parts.push(element("p", {}, "Kept in ", element("code", {}, more.folder)));
    if (more.log) parts.push(element("h3", {}, "End of its output and errors"), element("pre", { tabindex: "0" }, more.log));
    if (more.path) parts.push(new Path({ title: "Path", series: more.path }).figure);
    const plan = { ...this.data.plan, grid: Object.fromEntries(Object.entries(cells[cell] || {}).map(([name, value]) => [name, [value]])), seeds: [this.values("seed")[row]], keep: "all" };
    if (plan.estimators && !Array.isArray(plan.estimators)) plan.estimators = { [estimator]: plan.estimators[estimator] };
    else plan.estimators = [estimator];
    if (!Object.keys(plan.grid).length) delete plan.grid;
    parts.push(element("h3", {}, "To repeat this run, in the folder of the plan"),
      element("pre", { tabindex: "0", class: "repeat" }, `cat > run.yaml <<'END'\n${JSON.stringify(plan)}\nEND\nimu_sim campaign run.yaml -o run --workers 1`));
    return element("div", {}, ...parts);
  }

  choice(label, options, chosen, onchange) {
    const select = element("select", { "aria-label": label, onchange: () => onchange(select.value) },
      ...options.map(([value, text]) => element("option", { value, selected: value === chosen ? "" : null }, text)));
    return element("label", {}, `${label} `, select);
  }

  controls(host) {
    const divisions = [["", "cell and estimator"], ["estimator", "estimator"], ...this.data.grid.map((name) => [name, name])];
    host.append(element("div", { class: "controls" },
      this.choice("metric", this.data.metrics.map((metric) => [metric.name, metric.label]), this.metric.name, (name) => {
        this.metric = this.data.metrics.find((metric) => metric.name === name);
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
    const success = this.metric.name === "success";
    if (success) this.metric = this.data.metrics[0];
    this.boxes = add(this.boxSpec(), this.boxSpec().categories.length > 10);
    this.shares = { plots: [], title: element("h3", {}), grid: element("div"), caption: element("figcaption", { class: "caption" }) };
    this.shares.host = element("div", {}, this.shares.title, this.shares.grid, this.shares.caption);
    grid.append(this.shares.host);
    this.drawShares();
    this.curves = this.curveSpecs().map((spec) => add(spec));
    if (this.data.trend) add(this.data.trend);
    if (this.data.consistency) add(this.data.consistency, this.data.consistency.categories.length > 10);
    if (this.data.sensors.length) this.sensorPage(grid);
    if (success) { this.metric = this.data.metrics.find((metric) => metric.name === "success"); this.follow(); this.summarised(); }
    rowsFilled(grid);
    grid.querySelectorAll("figure").forEach((figure) => figure.setAttribute("data-campaign", ""));
  }

  follow() {
    const success = this.metric.name === "success";
    this.shares.host.hidden = success;
    if (success) { this.boxes.show(this.successShares()); return; }
    this.boxes.show(this.boxSpec());
    this.drawShares();
  }

  // The colour of each estimator is the same in every plot; null if there is but one.
  colourOf(estimator) {
    const place = this.data.estimators.indexOf(estimator);
    return place < 0 ? null : place;
  }

  // One colour an estimator, further lines of the same one dashed; of one estimator a colour each.
  coloured(lines, estimatorOf) {
    const count = new Map();
    return lines.map((line, k) => {
      const estimator = estimatorOf(line), place = this.colourOf(estimator);
      if (place === null) return k;
      const before = count.get(estimator) || 0;
      count.set(estimator, before + 1);
      return place + SERIES_COLOURS * before;
    });
  }

  summarised() {
    this.curveSpecs().forEach((spec, k) => this.curves[k].show(spec));
    if (this.sensor) this.sensor.show(this.sensorSpec());
  }

  // The values of the metric in the runs that the search leaves, sorted, by the chosen division.
  // Failed runs are the worst: at the end, infinite; where lower is not better, at the beginning.
  // How long a trajectory lasts is known of them, too.
  divided() {
    const numbers = this.values(this.metric.name), groupsByName = new Map(), worst = this.metric.better === "higher" ? -Infinity : Infinity;
    const names = this.by ? this.values(this.by) : null, cells = this.values("cell"), estimators = this.values("estimator");
    const states = this.values("status");
    for (const row of [...this.rows].sort((a, b) => a - b)) {
      const done = states[row] === "done";
      if (done && numbers[row] === null) continue;
      const counts = done || (this.metric.of_failed && numbers[row] !== null);
      const plotted = this.group.get(`${cells[row]}\n${estimators[row]}`);
      const name = names ? `${this.by} = ${inWords(names[row], 6)}` : plotted ? plotted.label : cells[row];
      if (!groupsByName.has(name)) groupsByName.set(name, { name, numbers: [], failed: 0, row, estimator: estimators[row], place: plotted ? plotted.place : name });
      const group = groupsByName.get(name);
      if (group.estimator !== estimators[row]) group.estimator = null;
      group.numbers.push(counts ? numbers[row] : worst);
      if (!done) group.failed += 1;
    }
    const groups = [...groupsByName.values()].filter((group) => group.numbers.some(Number.isFinite));
    for (const group of groups) {
      group.numbers.sort((a, b) => a - b);
      if (group.failed) group.name += ` (${group.numbers.length - group.failed} of ${group.numbers.length} done)`;
    }
    return groups;
  }

  // Success has no value of a run: its shares come with their intervals.
  successShares() {
    const { groups } = this.data, values = groups.map((group) => group.metrics.success);
    return { title: "Success rate, by cell and estimator", x: { label: "share of runs done", log: false }, categories: groups.map((group) => group.label),
      series: [{ name: "", mode: "rows", colour: null, colours: groups.map((group) => this.colourOf(group.estimator)), at: groups.map((_, k) => k), x: values.map((v) => v[0]), low: values.map((v) => v[1]), high: values.map((v) => v[2]) }],
      caption: "With the 95 % interval (Wilson); all runs, whatever the search.", onpick: (k) => this.pick({ row: this.firstOf(groups[k]) }) };
  }

  firstOf(group) {
    const cells = this.values("cell"), estimators = this.values("estimator");
    return cells.findIndex((cell, row) => cell === group.cell && estimators[row] === group.estimator);
  }

  // The groups, and the scale of all of them.
  scaled() {
    const groups = this.divided(), finite = (list) => list.filter(Number.isFinite);
    const positive = groups.every((group) => finite(group.numbers)[0] > 0);
    const ends = [0.05, 0.95].map((p) => groups.map((group) => quantile(finite(group.numbers), p)));
    const log = positive && Boolean(groups.length) && Math.max(...ends[1]) > 50 * Math.min(...ends[0]);
    const rest = groups.length > MOST_BOXES ? ` The first ${MOST_BOXES} of ${groups.length}; search the runs for others.` : "";
    return { groups: groups.slice(0, MOST_BOXES), log, rest, by: this.by || "cell and estimator" };
  }

  boxSpec() {
    const { groups, log, rest, by } = this.scaled(), { label } = this.metric;
    const boxes = groups.map((group, k) => {
      const at = (p) => quantile(group.numbers, p), place = this.colourOf(group.estimator);
      return { name: group.name, count: group.numbers.length, low: at(0.05), q1: at(0.25), median: at(0.5), q3: at(0.75), high: at(0.95), colour: place === null && groups.length <= MOST_LINES ? k : place };
    });
    return { title: `${label}, by ${by}`, x: { label, log }, categories: boxes.map((box) => box.name), series: [{ name: "", boxes, x: [], colour: 0 }],
      caption: `Median, quartiles, 5th and 95th percentile. Failed runs count as worse than any number; a box with failed runs reaches the frame.${rest}`, onpick: (k) => this.pick(groups[k]) };
  }

  // Distributions in one plot if it can be read, else in small ones with the same scale: one a cell
  // with its estimators, or as many as are needed.
  drawShares() {
    const { groups, log, rest, by } = this.scaled(), { label } = this.metric, { plots, grid } = this.shares;
    const several = groups.length > MOST_LINES, parts = new Map();
    const cells = several && !this.by && this.data.estimators.length > 1 && this.data.estimators.length <= MOST_LINES;
    groups.forEach((group, k) => {
      const key = cells ? group.place : Math.floor(k / MOST_LINES);
      parts.set(key, [...(parts.get(key) || []), group]);
    });
    const range = padded(extent(groups.flatMap((group) => group.numbers)), log);
    const specs = [...parts].map(([key, part]) => {
      const colours = this.coloured(part, (group) => group.estimator);
      const series = part.map((group, k) => {
        const before = group.numbers.filter((value) => value === -Infinity).length, shown = group.numbers.filter(Number.isFinite);
        return { name: cells ? group.estimator : group.name, mode: "step", colour: colours[k], x: shown, y: shown.map((_, i) => (before + i + 1) / group.numbers.length) };
      });
      const title = !several ? `Share of runs below (ECDF), by ${by}` : cells ? key : `${key * MOST_LINES + 1} to ${key * MOST_LINES + part.length}`;
      return { title, small: several, x: { label, log, range }, y: { label: several ? "share" : "share of all runs", range: [0, 1.02] }, legend: true, series };
    });
    specs.forEach((spec, k) => {
      if (plots[k]) plots[k].show(spec);
      else { plots.push(new Plot(spec)); grid.append(plots[k].figure); plots[k].draw(); }
    });
    plots.forEach((plot, k) => { plot.figure.hidden = k >= specs.length; });
    this.shares.title.hidden = !several;
    this.shares.title.textContent = `Share of runs below (ECDF), by ${by}`;
    this.shares.caption.textContent = `Of all runs: a line ends below 1 if some failed.${several ? " All with the same scale." : ""}${rest}`;
    grid.className = several ? "multiples" : "";
    this.shares.host.className = several ? "wide many" : "";
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
        if (this.data.estimators.length > 1) rest.push(group.estimator);
        const name = rest.join(", ") || "median";
        if (!lines.has(name)) lines.set(name, []);
        lines.get(name).push([group.values[parameter], ...summary, group.estimator]);
      }
      const visible = [...lines].slice(0, MOST_LINES), colours = this.coloured(visible, ([, points]) => points[0].at(-1));
      const series = visible.map(([name, points], k) => {
        points.sort((a, b) => a[0] - b[0]);
        return { name, colour: colours[k], x: points.map((p) => p[0]), y: points.map((p) => p[1]), low: points.map((p) => p[2]), high: points.map((p) => p[3]) };
      });
      const log = groups.every((group) => group.values[parameter] > 0);
      const tall = series.every((line) => line.y.every((value) => value > 0));
      const [least, most] = extent(series.flatMap((line) => line.y)) || [1, 1], wide = most > 5 * least;
      const slopes = this.data.slopes.filter((fit) => fit.metric === metric && fit.parameter === parameter)
        .map((fit) => {
          const [slope, low, high] = intervalInWords(fit.slope, fit.low, fit.high);
          return `${fit.estimator}: ${slope} (${low} to ${high})`;
        });
      const slopeText = slopes.length ? ` Slope of the logarithms, 95 %: ${slopes.join("; ")}.` : "";
      const missing = lines.size > MOST_LINES ? ` The first ${MOST_LINES} of ${lines.size} lines.` : "";
      return { title: `${label} over ${parameter}`, x: { label: parameter, log }, y: { label, log: tall && wide }, legend: true, series, caption: `Median with its 95 % interval.${slopeText}${missing}` };
    });
  }

  sensorPage(grid) {
    this.property = this.data.sensors[0].name;
    this.sensor = new Plot(this.sensorSpec());
    this.sensor.figure.classList.add("wide");
    const choice = element("div", { class: "controls wide" }, this.choice("Which IMU? Error over its", this.data.sensors.map((sensor) => [sensor.name, sensor.label]), this.property, (name) => {
      this.property = name;
      this.sensor.show(this.sensorSpec());
    }));
    grid.append(choice, this.sensor.figure);
  }

  sensorSpec() {
    const { groups, grid } = this.data, { name: metric, label } = this.metric;
    const property = this.data.sensors.find((sensor) => sensor.name === this.property);
    const lines = new Map();
    groups.forEach((group, k) => {
      const summary = group.metrics[metric], x = property.values[k];
      if (!summary || !(x > 0)) return;
      const rest = grid.filter((name) => name !== "imu").map((name) => `${name}=${inWords(group.values[name], 3)}`);
      if (this.data.estimators.length > 1) rest.push(group.estimator);
      const name = rest.join(", ") || "median";
      if (!lines.has(name)) lines.set(name, []);
      lines.get(name).push([x, ...summary, String(group.values.imu), group.estimator]);
    });
    const visible = [...lines].slice(0, MOST_LINES), colours = this.coloured(visible, ([, points]) => points[0].at(-1));
    const series = visible.map(([name, points], k) => {
      const column = (place) => points.map((point) => point[place]);
      return { name, mode: "bars", colour: colours[k], x: column(0), y: column(1), low: column(2), high: column(3), labels: column(4) };
    });
    const tall = series.every((line) => line.y.every((value) => value > 0));
    return { title: `${label} over ${property.label}`, x: { label: property.label, log: true }, y: { label, log: tall }, legend: true, series,
      caption: "Each point is a preset: median with its 95 % interval. Presets without this error are left out." };
  }
}
