// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A plot: lines, steps, points with error bars, bands, boxes. Drag to zoom, double-click to go back.

const linked = new Map();
let clips = 0;
const PAPER = 700;  // of a plot as wide as the page; those in rows have half of it
const BAND_OPACITY = 0.18;
const TALL = 24;  // rows above which a plot comes last on paper, beside another such

function mark(shape, x, y, r, look) {
  if (!shape || shape === "circle") return drawing("circle", { cx: x, cy: y, r, ...look });
  const half = 0.9 * r, turn = shape === "diamond" ? { transform: `rotate(45 ${x} ${y})` } : {};
  return drawing("rect", { x: x - half, y: y - half, width: 2 * half, height: 2 * half, ...turn, ...look });
}

class Plot {
  // spec: {title, x: {label, log}, y: {label, log}, series, link, caption, categories, onpick}
  constructor(spec) {
    this.hidden = new Set();
    this.figure = element("figure", { "data-plot": spec.title });
    this.tip = element("div", { class: "tip", hidden: "" });
    this.head = element("div", { class: "head" }, element("h3", {}, spec.title),
      this.tool("+", "zoom in", () => this.scaled(0.5)),
      this.tool("\u2212", "zoom out", () => this.scaled(2)),
      this.tool("\u21ba", "whole range", () => this.zoom(null, null)));
    this.holder = element("div");
    this.legend = element("div", { class: "legend" });
    this.figure.append(this.head, this.holder, this.legend);
    if (spec.caption) this.figure.append(element("figcaption", { class: "caption" }, spec.caption));
    this.figure.append(this.tip);
    if (spec.link) {
      if (!linked.has(spec.link)) linked.set(spec.link, new Set());
      linked.get(spec.link).add(this);
    }
    this.show(spec);
    // On paper a plot of the screen's width would be shrunk, its words with it.
    addEventListener("beforeprint", () => { this.paper = this.figure.matches(".multiples > *") ? PAPER / 3 : this.figure.matches(".plots > figure, .plots > :not(.wide) *") ? PAPER / 2 : PAPER; this.draw(); });
    addEventListener("afterprint", () => { this.paper = 0; this.draw(); });
    new ResizeObserver(() => {
      const width = this.holder.clientWidth;
      if (width && !this.paper && Math.abs(width - this.width) > 1) this.draw();
    }).observe(this.holder);
  }

  tool(sign, label, action) {
    return element("button", { type: "button", title: label, "aria-label": label, onclick: action }, sign);
  }

  show(spec) {
    this.spec = spec;
    this.head.firstChild.textContent = spec.title;
    this.rangeX = this.rangeY = null;
    this.drawLegend();
    this.draw();
  }

  shown() { return this.spec.series.filter((series) => !this.hidden.has(series.name)); }

  // The legend shows each series as it is drawn: a band, a line, a band with its line, or points.
  sign(series) {
    const sign = drawing("svg", { viewBox: "0 0 22 10", "aria-hidden": "true" });
    const points = series.mode === "points" || series.mode === "bars" || series.shape, fill = colour(series.colour);
    if (series.low && !points && series.mode !== "rows") sign.append(drawing("rect", { class: "band", x: 0, y: 0, width: 22, height: 10, fill, "fill-opacity": BAND_OPACITY }));
    if (points) sign.append(mark(series.shape, 11, 5, 4, { fill }));
    else if (series.y) sign.append(drawing("line", { x1: 0, x2: 22, y1: 5, y2: 5, stroke: fill, "stroke-width": series.thin ? 1.5 : 2.5, "stroke-dasharray": dash(series.colour) }));
    else if (series.mode === "rows") {
      if (series.x && !series.bare) sign.append(drawing("line", { x1: 0, x2: 22, y1: 5, y2: 5, stroke: fill, "stroke-width": 2 }));
      if (series.x) sign.append(mark(series.shape, 11, 5, series.bare ? 2.5 : 4, { fill, "fill-opacity": series.bare ? 0.35 : 1 }));
      else sign.append(drawing("rect", { class: "band", x: 1, y: 1, width: 20, height: 8, fill, "fill-opacity": 0.25, stroke: fill }));
    }
    return sign;
  }

  drawLegend() {
    const listed = this.spec.series.filter((series) => series.name && !series.unlisted);
    this.legend.replaceChildren(...(listed.length > 1 || this.spec.legend ? listed : []).map((series) => {
      const button = element("button", { type: "button", "aria-pressed": String(!this.hidden.has(series.name)) }, this.sign(series), series.name);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(series.name)) this.hidden.add(series.name);
        this.drawLegend();
        this.draw();
      });
      return button;
    }));
  }

  usable(axis) {
    const all = [];
    for (const series of this.shown()) {
      for (const key of axis === "x" ? ["x"] : ["y", "low", "high"]) {
        for (const value of series[key] || []) if (!this.spec[axis].log || value > 0) all.push(value);
      }
      if (axis === "x" && series.mode === "rows") for (const value of [...series.low, ...series.high]) if (!this.spec.x.log || value > 0) all.push(value);
      if (axis === "x" && series.boxes) for (const box of series.boxes) all.push(box.low, box.q1, box.median, box.q3, box.high);
    }
    return all;
  }

  ranges() {
    const { x, y, categories } = this.spec;
    const wholeX = x.range || padded(extent(this.usable("x")), x.log);
    const wholeY = categories ? [categories.length - 0.5, -0.5] : y.range || padded(extent(this.usable("y")), y.log);
    return [this.rangeX || wholeX, this.rangeY || wholeY];
  }

  draw() {
    const { spec } = this;
    const width = this.width = Math.max(this.paper || this.holder.clientWidth || 600, spec.small ? 200 : 260);
    const rows = spec.categories ? spec.categories.length : 0;
    const labelled = spec.series.some((series) => series.labels);
    const pitch = this.pitch = !this.paper ? 22 : rows > 48 ? 7 : rows > 12 ? 9 : 12;
    this.figure.classList.toggle("tall", rows > TALL);
    const height = this.height = rows ? 60 + rows * pitch : Math.min(labelled && !this.paper ? 520 : 340, (spec.small ? 110 : 160) + width * (this.paper ? 0.15 : 0.3));
    const [rangeX, rangeY] = this.ranges();
    const top = 8, bottom = height - 42;
    this.sy = new Scale(rangeY, Boolean(spec.y && spec.y.log), bottom, top);
    const levels = rows ? [] : this.sy.ticks(Math.max(3, Math.floor((bottom - top) / 45)));
    const heights = ticksInWords(levels, 3);
    const numbers = Math.max(62, 34 + 6.8 * Math.max(0, ...heights.map((text) => text.length)));
    const longest = rows ? Math.min(width * 0.42, 14 + (pitch < 18 ? 4.6 : 6.8) * Math.max(...spec.categories.map((name) => name.length))) : numbers;
    this.box = { left: longest, right: width - 12, top, bottom };
    this.sx = new Scale(rangeX, spec.x.log, this.box.left, this.box.right);
    const svg = this.svg = drawing("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": spec.title });
    this.axes(svg, longest, levels, heights);
    const clip = `clip${clips++}`;
    const path = drawing("clipPath", { id: clip });
    const { left, right } = this.box;
    path.append(drawing("rect", { x: left, y: top, width: right - left, height: bottom - top }));
    const marks = drawing("g", { "clip-path": `url(#${clip})` });
    this.taken = [];
    this.labels = [];
    for (const series of this.shown()) this.series(marks, series);
    const placed = new Set();
    for (const label of this.labels) this.label(marks, placed, ...label);
    svg.append(path, marks, drawing("rect", { class: "frame", x: left, y: top, width: right - left, height: bottom - top }));
    this.pointer(svg);
    this.holder.replaceChildren(svg);
    Object.assign(this.figure.dataset, { drawn: marks.childElementCount, x0: rangeX[0], x1: rangeX[1] });
  }

  axes(svg, margin, levels, heights) {
    const { left, right, top, bottom } = this.box, { spec } = this;
    const ticks = this.sx.ticks(Math.max(3, Math.floor((right - left) / 90)));
    const names = spec.x.names, shown = names ? ticks.filter(Number.isInteger) : ticks;
    const texts = names ? shown.map((tick) => names[tick] || "") : ticksInWords(shown, 4);
    let end = -Infinity;  // of the label before: one that has no room is left out
    shown.forEach((tick, k) => {
      const x = this.sx.at(tick), half = 3.6 * texts[k].length;
      svg.append(drawing("line", { class: "grid", x1: x, x2: x, y1: top, y2: bottom }));
      if (x - half < end + 3) return;
      end = x + half;
      svg.append(drawing("text", { class: "tick", x, y: bottom + 16, "text-anchor": "middle" }, texts[k]));
    });
    svg.append(drawing("text", { x: (left + right) / 2, y: bottom + 34, "text-anchor": "middle" }, spec.x.label));
    if (spec.categories) {
      spec.categories.forEach((name, k) => {
        const room = Math.floor((margin - 10) / (this.pitch < 18 ? 4.4 : 6.2));
        // The end of a name tells neighbours apart: the estimator of a cell.
        const head = Math.floor(room / 3), tail = room - 1 - head;
        const shortened = name.length > room ? `${name.slice(0, head)}\u2026${name.slice(-tail)}` : name;
        const text = drawing("text", { class: this.pitch < 9 ? "tiny" : this.pitch < 18 ? "small" : "", x: left - 6, y: this.sy.at(k) + this.pitch * 0.18, "text-anchor": "end" }, shortened);
        text.append(drawing("title", {}, name));
        svg.append(text);
      });
      return;
    }
    levels.forEach((tick, k) => {
      const y = this.sy.at(tick);
      svg.append(drawing("line", { class: "grid", x1: left, x2: right, y1: y, y2: y }),
        drawing("text", { class: "tick", x: left - 6, y: y + 4, "text-anchor": "end" }, heights[k]));
    });
    const middle = (top + bottom) / 2;
    svg.append(drawing("text", { x: 12, y: middle, transform: `rotate(-90 12 ${middle})`, "text-anchor": "middle" }, spec.y.label));
  }

  place(series, k, key = "y") {
    const x = series.x[k], y = series[key][k];
    if (x === null || y === null || x === undefined || y === undefined) return null;
    if ((this.spec.x.log && x <= 0) || (this.spec.y.log && y <= 0)) return null;
    return [this.sx.at(x), this.sy.at(y)];
  }

  series(marks, series) {
    const look = { stroke: colour(series.colour), "stroke-dasharray": dash(series.colour), fill: "none", "stroke-width": series.thin ? 1 : 1.6 };
    if (series.boxes) return this.boxes(marks, series);
    if (series.mode === "rows") return this.rows(marks, series);
    if (series.low && series.mode !== "bars") this.band(marks, series);
    if (series.mode === "points" || series.mode === "bars") return this.points(marks, series);
    if (!series.y) return;
    let path = "", before = null;
    for (let k = 0; k < series.x.length; k++) {
      const point = this.place(series, k);
      if (point === null) { before = null; continue; }
      const [x, y] = point.map((value) => value.toFixed(1));
      if (before === null) path += `M${x} ${y}`;
      else path += series.mode === "step" ? `H${x}V${y}` : `L${x} ${y}`;
      before = point;
    }
    if (path) marks.append(drawing("path", { d: path, ...look }));
  }

  band(marks, series) {
    const up = [], down = [];
    for (let k = 0; k < series.x.length; k++) {
      const high = this.place(series, k, "high"), low = this.place(series, k, "low");
      if (high === null || low === null) continue;
      up.push(high.map((value) => value.toFixed(1)).join(" "));
      down.unshift(low.map((value) => value.toFixed(1)).join(" "));
    }
    if (up.length > 1) marks.append(drawing("path", { d: `M${[...up, ...down].join("L")}Z`, fill: colour(series.colour), "fill-opacity": BAND_OPACITY }));
  }

  points(marks, series) {
    for (let k = 0; k < series.x.length; k++) {
      const point = this.place(series, k);
      if (point === null) continue;
      const [x, y] = point, fill = colour(series.colour);
      if (series.mode === "bars" && series.low[k] !== null && series.high[k] !== null) {
        const low = this.place(series, k, "low"), high = this.place(series, k, "high");
        if (low && high) marks.append(drawing("line", { x1: x, x2: x, y1: low[1], y2: high[1], stroke: fill, "stroke-width": 1.5 }));
      }
      marks.append(drawing("circle", { cx: x, cy: y, r: series.size || 4, fill }));
      if (!series.labels) continue;
      this.taken.push([x - 4, y - 4, x + 4, y + 4]);
      this.labels.push([series.labels[k], x, y]);
    }
  }

  // Several lines have points of one name at one x: the name stands once.
  label(marks, placed, text, x, y) {
    const key = `${text} ${x.toFixed(1)}`;
    if (placed.has(key)) return;
    const wide = text.length * 6.5 + 4;
    const [right, left, middle] = [7, -7 - wide, -wide / 2];
    for (const [dx, dy] of [[right, 4], [left, 4], [middle, -9], [middle, 17], [right, -5], [left, -5], [right, 12], [left, 12]]) {
      const box = [x + dx, y + dy - 10, x + dx + wide, y + dy + 3];
      const free = this.taken.every((taken) => box[0] > taken[2] || box[2] < taken[0] || box[1] > taken[3] || box[3] < taken[1]);
      if (!free || box[0] < this.box.left || box[2] > this.box.right) continue;
      this.taken.push(box);
      placed.add(key);
      marks.append(drawing("text", { class: "label", x: x + dx, y: y + dy }, text));
      return;
    }
  }

  // Values of categories with their intervals, which an end that is null leaves open; without
  // values, a band of each.
  rows(marks, series) {
    const { left, right } = this.box;
    series.at.forEach((row, k) => {
      const y = this.sy.at(row + (series.shift || 0)), x = series.x && series.x[k], fill = colour(series.colours ? series.colours[k] : series.colour);
      const end = (value, open) => (value === null || (this.spec.x.log && value <= 0) ? open : this.sx.at(value));
      const low = end(series.low[k], left), high = end(series.high[k], right);
      if (!series.x) marks.append(drawing("rect", { x: low, y: y - this.pitch * 0.45, width: Math.max(high - low, 1), height: this.pitch * 0.9, fill, "fill-opacity": 0.25, stroke: fill }));
      else if (x !== null && !(this.spec.x.log && x <= 0)) {
        if (!series.bare) marks.append(drawing("line", { x1: low, x2: high, y1: y, y2: y, stroke: fill, "stroke-width": 2 }));
        marks.append(mark(series.shape, this.sx.at(x), y, (series.size || 4.5) * (this.pitch < 18 ? 0.6 : 1), { fill, "fill-opacity": series.bare ? 0.35 : 1 }));
      }
    });
    if (series.line !== undefined) marks.append(drawing("line", { x1: this.sx.at(series.line), x2: this.sx.at(series.line), y1: this.box.top, y2: this.box.bottom, stroke: "var(--ink)", "stroke-dasharray": "4 3" }));
  }

  boxes(marks, series) {
    series.boxes.forEach((box, k) => {
      const y = this.sy.at(k), at = (value) => (Number.isFinite(value) ? this.sx.at(this.spec.x.log ? Math.max(value, 1e-300) : value) : value > 0 ? this.box.right : this.box.left);
      const ink = { stroke: colour(box.colour), "stroke-width": 1.5 }, half = this.pitch * 0.32;
      const group = drawing("g", { class: "box", "data-name": box.name });
      group.append(drawing("line", { x1: at(box.low), x2: at(box.high), y1: y, y2: y, ...ink }));
      for (const end of [box.low, box.high]) group.append(drawing("line", { x1: at(end), x2: at(end), y1: y - half / 2, y2: y + half / 2, ...ink }));
      group.append(drawing("rect", { x: at(box.q1), y: y - half, width: Math.max(at(box.q3) - at(box.q1), 1), height: 2 * half, fill: colour(box.colour), "fill-opacity": 0.3, ...ink }),
        drawing("line", { x1: at(box.median), x2: at(box.median), y1: y - half, y2: y + half, stroke: colour(box.colour), "stroke-width": 3 }));
      marks.append(group);
    });
  }

  zoom(rangeX, rangeY, spread = true) {
    this.rangeX = rangeX;
    this.rangeY = this.spec.categories ? null : rangeY;
    this.draw();
    if (spread && this.spec.link) for (const other of linked.get(this.spec.link)) if (other !== this) other.zoom(rangeX, null, false);
  }

  scaled(factor) {
    const { left, right } = this.box, middle = (left + right) / 2, half = ((right - left) / 2) * factor;
    this.zoom([this.sx.value(middle - half), this.sx.value(middle + half)], this.rangeY);
  }

  pointer(svg) {
    const { left, right, top, bottom } = this.box;
    const area = drawing("rect", { class: "area", x: left, y: top, width: right - left, height: bottom - top });
    const select = drawing("rect", { class: "select", visibility: "hidden" });
    let begin = null;
    const at = (event) => {
      const shape = svg.getBoundingClientRect();
      const x = ((event.clientX - shape.left) / shape.width) * this.width, y = ((event.clientY - shape.top) / shape.height) * this.height;
      return [Math.min(Math.max(x, left), right), Math.min(Math.max(y, top), bottom)];
    };
    const frame = ([x, y]) => {
      const tall = !this.spec.categories && Math.abs(y - begin[1]) > 24;
      return [Math.min(x, begin[0]), tall ? Math.min(y, begin[1]) : top, Math.max(x, begin[0]), tall ? Math.max(y, begin[1]) : bottom, tall];
    };
    area.addEventListener("pointerdown", (event) => { begin = at(event); area.setPointerCapture(event.pointerId); });
    area.addEventListener("pointermove", (event) => {
      this.hover(at(event));
      if (begin === null) return;
      const [x0, y0, x1, y1] = frame(at(event));
      for (const [key, value] of Object.entries({ x: x0, y: y0, width: x1 - x0, height: y1 - y0, visibility: "visible" })) select.setAttribute(key, value);
    });
    area.addEventListener("pointerup", (event) => {
      if (begin === null) return;
      const [x0, y0, x1, y1, tall] = frame(at(event));
      begin = null;
      select.setAttribute("visibility", "hidden");
      if (x1 - x0 > 8) this.zoom([this.sx.value(x0), this.sx.value(x1)], tall ? [this.sy.value(y1), this.sy.value(y0)] : this.rangeY);
      else if (this.spec.onpick) this.spec.onpick(Math.round(this.sy.value(at(event)[1])));
    });
    area.addEventListener("pointercancel", () => { begin = null; select.setAttribute("visibility", "hidden"); });
    area.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    area.addEventListener("dblclick", () => this.zoom(null, null));
    svg.append(select, area);
  }

  hover([x, y]) {
    const lines = this.spec.categories ? this.linesOfRow(Math.round(this.sy.value(y))) : this.nearest(x, y);
    this.tip.hidden = !lines.length;
    if (!lines.length) return;
    this.tip.textContent = lines.slice(0, 12).join("\n");
    const scale = this.holder.clientWidth / this.width, room = this.figure.clientWidth - this.tip.offsetWidth;
    this.tip.style.left = `${Math.max(0, Math.min(x * scale + 12, room))}px`;
    this.tip.style.top = `${this.holder.offsetTop + y * scale + 14}px`;
  }

  linesOfRow(row) {
    const boxed = this.spec.series[0] && this.spec.series[0].boxes, box = boxed && boxed[row];
    if (box) return [box.name, `median ${inWords(box.median)}`, `quartiles ${inWords(box.q1)} ${inWords(box.q3)}`, `${box.count} runs`];
    const lines = [];
    for (const series of this.shown()) {
      const k = series.mode === "rows" && !series.bare ? series.at.indexOf(row) : -1;
      if (k < 0) continue;
      const [middle, low, high] = series.pointed ? [inWords(series.x[k])] : intervalInWords(series.x ? series.x[k] : series.low[k], series.low[k], series.high[k]);
      const between = `${low || "open"} to ${high || "open"}`;
      lines.push(series.x ? `${series.name ? `${series.name}: ` : ""}${middle}${series.pointed ? "" : ` (${between})`}` : `${series.name}: ${between}`);
    }
    return lines.length ? [this.spec.categories[row], ...lines] : [];
  }

  nearest(x, y) {
    const lines = [];
    let head = null;
    for (const series of this.shown()) {
      if (!series.y) continue;
      let best = null, gap = Infinity;
      for (let k = 0; k < series.x.length; k++) {
        const point = this.place(series, k);
        if (point === null) continue;
        const away = Math.abs(point[0] - x) + (series.labels ? Math.abs(point[1] - y) : 0);
        if (away < gap) { gap = away; best = k; }
      }
      if (best === null || gap > 40) continue;
      head = head || `${this.spec.x.label}: ${inWords(series.x[best])}`;
      const bounded = series.low && series.low[best] !== null && series.high[best] !== null;
      const [middle, low, high] = bounded ? intervalInWords(series.y[best], series.low[best], series.high[best]) : [inWords(series.y[best])];
      lines.push(`${series.labels ? `${series.labels[best]}, ` : ""}${series.name || this.spec.y.label}: ${middle}${bounded ? ` (${low} to ${high})` : ""}`);
    }
    return head ? [head, ...lines] : lines;
  }
}
