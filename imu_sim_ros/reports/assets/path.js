// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// Paths in three dimensions: turned by dragging, drawn without perspective, scaled alike on all axes.

// Azimuth and elevation: the initial view, from above, from the side.
const VIEWS = [[-0.9, 0.6], [-Math.PI / 2, Math.PI / 2], [-Math.PI / 2, 0]];

class Path {
  // spec: {title, series: [{name, x, y, z, colour}]}
  constructor(spec) {
    this.spec = spec;
    this.turn = { azimuth: VIEWS[0][0], elevation: VIEWS[0][1], size: 1 };
    this.hidden = new Set();
    this.holder = element("div");
    const tool = (sign, label, action) => element("button", { type: "button", title: label, "aria-label": label, onclick: () => { action(); this.draw(); } }, sign);
    const look = (azimuth, elevation) => () => Object.assign(this.turn, { azimuth, elevation, size: 1 });
    this.figure = element("figure", { "data-plot": spec.title },
      element("div", { class: "head" }, element("h3", {}, spec.title),
        tool("+", "larger", () => { this.turn.size *= 1.4; }), tool("\u2212", "smaller", () => { this.turn.size /= 1.4; }),
        tool("top", "from above", look(...VIEWS[1])), tool("side", "from the side", look(...VIEWS[2])), tool("\u21ba", "initial view", look(...VIEWS[0]))),
      this.holder,
      this.legend = element("div", { class: "legend" }),
      element("figcaption", { class: "caption" }, "Drag to rotate; click on a name to hide its path. Circle: start; square: end. Metres."));
    this.pointer();
    this.drawLegend();
    new ResizeObserver(() => { if (Math.abs(this.holder.clientWidth - this.width) > 1) this.draw(); }).observe(this.holder);
  }

  drawLegend() {
    this.legend.replaceChildren(...this.spec.series.map((track) => {
      const sign = drawing("svg", { viewBox: "0 0 22 10", "aria-hidden": "true" });
      sign.append(drawing("line", { x1: 0, x2: 22, y1: 5, y2: 5, stroke: colour(track.colour), "stroke-width": track.colour === null ? 1.5 : 2.5, "stroke-dasharray": dash(track.colour) }));
      const turn = () => { if (!this.hidden.delete(track.name)) this.hidden.add(track.name); this.drawLegend(); };
      return element("button", { type: "button", "aria-pressed": String(!this.hidden.has(track.name)), onclick: turn }, sign, track.name);
    }));
    this.measure();
    this.draw();
  }

  shown() { return this.spec.series.filter((track) => !this.hidden.has(track.name)); }

  measure() {
    this.ends = ["x", "y", "z"].map((axis) => {
      let range = null;
      for (const track of this.shown()) {
        const bounds = extent(track[axis]);
        if (bounds) range = range ? [Math.min(range[0], bounds[0]), Math.max(range[1], bounds[1])] : bounds;
      }
      return range || [0, 1];
    });
    this.middle = this.ends.map(([low, high]) => (low + high) / 2);
    // Half the extents of the box around the paths in the views that have a button.
    const corners = this.ends[0].flatMap((x) => this.ends[1].flatMap((y) => this.ends[2].map((z) => [x, y, z])));
    const seen = VIEWS.flatMap((view) => corners.map((corner) => this.projected(corner, ...view).map(Math.abs)));
    this.half = [0, 1].map((k) => Math.max(...seen.map((place) => place[k])) || 1e-9);
  }

  // Across and up [m] from the middle, from a direction.
  projected([x, y, z], azimuth, elevation) {
    const [a, b, c] = [x - this.middle[0], y - this.middle[1], z - this.middle[2]];
    const across = -Math.sin(azimuth) * a + Math.cos(azimuth) * b;
    const depth = Math.cos(azimuth) * a + Math.sin(azimuth) * b;
    return [across, Math.cos(elevation) * c - Math.sin(elevation) * depth];
  }

  at(x, y, z) {
    const { azimuth, elevation, size } = this.turn;
    const [across, up] = this.projected([x, y, z], azimuth, elevation);
    const scale = size * Math.min((this.width / 2 - 40) / this.half[0], (this.height / 2 - 24) / this.half[1]);
    return [this.width / 2 + across * scale, this.height / 2 - up * scale];
  }

  draw() {
    this.width = Math.max(this.holder.clientWidth || 600, 260);
    this.height = Math.min(460, this.width * 0.8);
    const svg = drawing("svg", { viewBox: `0 0 ${this.width} ${this.height}`, role: "img", "aria-label": this.spec.title });
    this.axes(svg);
    // The truth is thin and lies over the estimates, which would hide it.
    const order = [...this.shown()].sort((a, b) => (a.colour === null) - (b.colour === null));
    for (const track of order) {
      const line = track.x.map((x, k) => this.at(x, track.y[k], track.z[k]).map((value) => value.toFixed(1)).join(" "));
      const look = { stroke: colour(track.colour), fill: "none", "stroke-width": track.colour === null ? 1.1 : 1.8, "stroke-dasharray": dash(track.colour) };
      if (line.length > 1) svg.append(drawing("path", { d: `M${line.join("L")}`, class: "track", ...look }));
      const [first, last] = [line[0], line[line.length - 1]].map((point) => point.split(" ").map(Number));
      svg.append(drawing("circle", { cx: first[0], cy: first[1], r: 4, fill: colour(track.colour) }),
        drawing("rect", { x: last[0] - 3.5, y: last[1] - 3.5, width: 7, height: 7, fill: colour(track.colour) }));
    }
    this.holder.replaceChildren(svg);
    this.figure.dataset.drawn = svg.querySelectorAll("path.track").length;
  }

  axes(svg) {
    const [[x0, x1], [y0, y1], [z0, z1]] = this.ends;
    const line = (a, b, axis = null) => {
      const [p, q] = [this.at(...a), this.at(...b)];
      const look = axis ? { stroke: colour(axis), "stroke-width": 1.5 } : { class: "grid" };
      svg.append(drawing("line", { ...look, x1: p[0], y1: p[1], x2: q[0], y2: q[1] }));
    };
    for (const x of new Scale([x0, x1], false, 0, 1).ticks(5)) if (x1 > x0) line([x, y0, z0], [x, y1, z0]);
    for (const y of new Scale([y0, y1], false, 0, 1).ticks(5)) if (y1 > y0) line([x0, y, z0], [x1, y, z0]);
    line([x0, y0, z0], [x1, y0, z0], "x");
    line([x0, y0, z0], [x0, y1, z0], "y");
    line([x0, y0, z0], [x0, y0, z1], "z");
    // A label lies behind the end of its axis, inside the drawing.
    const origin = this.at(x0, y0, z0);
    const label = (name, end, ...place) => {
      const [x, y] = this.at(...place), length = Math.hypot(x - origin[0], y - origin[1]) || 1;
      const text = `${name} ${inWords(end, 3)} m`, half = 3.6 * text.length;
      const [along, down] = [(x - origin[0]) / length, (y - origin[1]) / length];
      const middle = Math.min(Math.max(x + along * (half + 6), half), this.width - half);
      svg.append(drawing("text", { x: middle, y: y + down * 14 + 4, "text-anchor": "middle" }, text));
    };
    label("x", x1, x1, y0, z0);
    label("y", y1, x0, y1, z0);
    label("z", z1, x0, y0, z1);
  }

  pointer() {
    let from = null;
    this.holder.addEventListener("pointerdown", (event) => {
      from = { x: event.clientX, y: event.clientY, ...this.turn };
      this.holder.setPointerCapture(event.pointerId);
    });
    this.holder.addEventListener("pointermove", (event) => {
      if (from === null) return;
      this.turn.azimuth = from.azimuth - (event.clientX - from.x) * 0.01;
      this.turn.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, from.elevation + (event.clientY - from.y) * 0.01));
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"]) this.holder.addEventListener(end, () => { from = null; });
  }
}
