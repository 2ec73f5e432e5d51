// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A table that is sorted by a click on a column's name and searched by words and comparisons.

const PAGE = 25;
const PRINTED = 10;  // rows on paper, where nobody turns over; a table may ask for more

// A column comes as {name, values}, as {name, usual, count, others: [[row, value]]} where one value
// stands nearly everywhere, as {name, words, index} where few strings stand often, or as {name, f4},
// the base64 of little-endian floats, NaN for what is missing.
function unpacked(column) {
  if (column.others) {
    const values = Array(column.count).fill(column.usual);
    for (const [row, value] of column.others) values[row] = value;
    return values;
  }
  if (column.words) return column.index.map((k) => (k === null ? null : column.words[k]));
  if (!column.f4) return column.values;
  const bytes = Uint8Array.from(atob(column.f4), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer), values = [];
  for (let at = 0; at < bytes.length; at += 4) {
    const value = view.getFloat32(at, true);
    values.push(Number.isNaN(value) ? null : Number(value.toPrecision(6)));
  }
  return values;
}

// The search: words that all must occur; name=part, name="whole", name<number, name>number. A part
// of a column's name will do where only one column has it. Returns {fits, problems}.
function matcher(query, columns, text) {
  const problems = [];
  const tests = (query.match(/(?:[^\s"]|"[^"]*(?:"|$))+/g) || []).map((part) => {
    const bare = (quoted) => quoted.replaceAll('"', "").toLowerCase();
    const match = part.match(/^([^=<>"]+)(<=|>=|=|<|>)(.*)$/);
    if (!match) { const wanted = bare(part); return (row) => text(row).includes(wanted); }
    const [, name, sign, operand] = match, wanted = bare(operand), number = Number(wanted);
    const column = columnByName(name.toLowerCase(), columns, problems);
    if (!column) return () => false;
    const { values } = column;
    if (sign === "=") {
      const whole = operand.startsWith('"');
      return (row) => {
        const value = values[row];
        if (value === null) return false;
        if (typeof value === "number") return value === number;
        const has = String(value).toLowerCase();
        return whole ? has === wanted : has.includes(wanted);
      };
    }
    if (wanted === "" || Number.isNaN(number)) { problems.push(`${part}: ${sign} needs a number`); return () => false; }
    const compare = { "<": (v) => v < number, ">": (v) => v > number, "<=": (v) => v <= number, ">=": (v) => v >= number }[sign];
    return (row) => values[row] !== null && compare(values[row]);
  });
  return { fits: (row) => tests.every((test) => test(row)), problems };
}

function columnByName(name, columns, problems) {
  const exact = columns.find((column) => column.name.toLowerCase() === name);
  if (exact) return exact;
  const parts = columns.filter((column) => column.name.toLowerCase().includes(name));
  if (parts.length === 1) return parts[0];
  const names = (parts.length ? parts : columns).map((column) => column.name).join(", ");
  problems.push(parts.length ? `${name}: several columns have this in their name: ${names}` : `no column ${name}; there are ${names}`);
  return null;
}

class Table {
  // columns: [{name, values}]; options: {name, search, onfilter, bad, shown, detail, printed, links, digits, intervals}
  constructor(columns, options = {}) {
    this.columns = columns.map((column) => ({ ...column, values: unpacked(column), hidden: Boolean(options.shown) && !options.shown.includes(column.name) }));
    this.columns.forEach((column) => { column.number = column.values.some((v) => typeof v === "number") && column.values.every((v) => v === null || typeof v === "number"); });
    this.options = options;
    this.count = this.columns.length ? this.columns[0].values.length : 0;
    this.order = { column: null, down: false };
    this.page = 0;
    this.open = new Set();
    this.texts = [];
    this.host = element("div", { "data-table": options.name || "" });
    this.build();
    this.filter("");
    window.addEventListener("beforeprint", () => this.draw(options.printed || PRINTED));
    window.addEventListener("afterprint", () => this.draw());
  }

  column(name) { return this.columns.find((column) => column.name === name).values; }

  text(row) {
    if (this.texts[row] === undefined) this.texts[row] = this.columns.map((column) => column.values[row]).join("\n").toLowerCase();
    return this.texts[row];
  }

  build() {
    const { search, shown, name } = this.options;
    this.input = element("input", { type: "search", placeholder: "search: words, name=part, name>1", "aria-label": `search ${name || "table"}`, oninput: () => this.filter(this.input.value) });
    this.status = element("span", { class: "faint", role: "status" });
    const bar = element("div", { class: "controls" }, this.input, this.status);
    if (!search) this.input.remove();
    if (shown) bar.append(this.chooser());
    this.head = element("tr");
    this.body = element("tbody");
    const turn = (label, by) => element("button", { type: "button", onclick: () => { this.page += by; this.draw(); } }, label);
    this.back = turn("\u2039 back", -1);
    this.next = turn("next \u203a", 1);
    this.pager = element("div", { class: "controls pager" }, this.back, this.next);
    const table = element("table", {}, element("thead", {}, this.head), this.body);
    this.host.append(bar, element("div", { class: "scroll", tabindex: "0" }, table), this.pager);
  }

  chooser() {
    const boxes = this.columns.map((column) => {
      const box = element("input", { type: "checkbox", onchange: () => { column.hidden = !box.checked; this.arrange(); } });
      box.checked = !column.hidden;
      return element("label", {}, box, ` ${column.name}`);
    });
    return element("details", { class: "columns" }, element("summary", {}, "columns"), element("div", {}, ...boxes));
  }

  filter(query) {
    this.input.value = query;
    const { fits, problems } = matcher(query, this.columns, (row) => this.text(row));
    this.problems = problems;
    this.rows = [];
    for (let row = 0; row < this.count; row++) if (fits(row)) this.rows.push(row);
    this.page = 0;
    this.arrange();
    if (this.options.onfilter) this.options.onfilter(this.rows);
  }

  sort(column) {
    this.order = { column, down: this.order.column === column && !this.order.down };
    this.page = 0;
    this.arrange();
  }

  heads() {
    const { column: sorted, down } = this.order, shown = this.columns.filter((column) => !column.hidden);
    for (const column of shown) {
      column.button = column.button || element("button", { type: "button", onclick: () => this.sort(column) });
      column.head = column.head || element("th", { class: column.number ? "number" : null, scope: "col", "data-name": column.name }, column.button);
      column.head.setAttribute("aria-sort", column !== sorted ? "none" : down ? "descending" : "ascending");
      column.button.textContent = column.name + (column !== sorted ? "" : down ? " \u25bc" : " \u25b2");
    }
    const there = [...this.head.children];  // one that stays keeps the focus
    if (there.length !== shown.length || shown.some((column, k) => column.head !== there[k])) this.head.replaceChildren(...shown.map((column) => column.head));
  }

  arrange() {
    const { column, down } = this.order;
    this.heads();
    if (column === null) this.rows.sort((a, b) => a - b);
    else {
      const { values, number } = column, sign = down ? -1 : 1;
      const order = number ? (a, b) => a - b : (a, b) => String(a).localeCompare(String(b), "en", { numeric: true });
      this.rows.sort((a, b) => {
        const left = values[a], right = values[b];
        if (left === null || right === null) return (left === null) - (right === null);  // what is missing comes last
        return sign * order(left, right) || a - b;
      });
    }
    this.draw();
  }

  draw(size = PAGE) {
    const pages = Math.max(1, Math.ceil(this.rows.length / size)), first = size === PAGE ? this.page * PAGE : 0;
    this.body.replaceChildren(...this.rows.slice(first, first + size).flatMap((row) => this.line(row)));
    this.pager.hidden = pages === 1;
    this.back.disabled = this.page === 0;
    this.next.disabled = this.page >= pages - 1;
    const part = pages > 1 ? `, ${first + 1} to ${Math.min(first + size, this.rows.length)} shown` : "";
    this.status.textContent = this.problems.length ? this.problems.join("; ") : `${this.rows.length} of ${this.count} rows${part}`;
    this.status.hidden = pages === 1 && !this.options.search;
    this.status.classList.toggle("failed", this.problems.length > 0);
    this.host.dataset.rows = this.rows.length;
  }

  // A median and the ends of its interval have digits of their own.
  words(column, row) {
    const triple = (this.options.intervals || []).find((names) => names.includes(column.name));
    if (!triple) return inWords(column.values[row], this.options.digits || 5);
    const numbers = triple.map((name) => this.column(name)[row]);
    if (numbers.some((number) => typeof number !== "number")) return inWords(column.values[row], this.options.digits || 5);
    return intervalInWords(...numbers)[triple.indexOf(column.name)];
  }

  line(row) {
    const { bad, detail } = this.options, shown = this.columns.filter((column) => !column.hidden);
    const cells = shown.map((column) => {
      const text = this.words(column, row);
      const target = this.options.links && sectionIds.get(this.options.links[column.values[row]]);
      return element("td", { class: column.number ? "number" : text.length > 60 ? "long" : null }, target ? element("a", { href: `#${target}` }, text) : text);
    });
    const line = element("tr", { class: bad && bad(row, this) ? "bad" : null }, ...cells);
    if (!detail || !cells.length) return [line];
    const open = this.open.has(row);
    const turn = () => { if (!this.open.delete(row)) this.open.add(row); this.draw(); };
    const button = element("button", { type: "button", class: "open", "aria-expanded": String(open), "aria-label": `details of row ${row + 1}`, onclick: turn }, open ? "\u25be" : "\u25b8");
    cells[0].prepend(button);
    return open ? [line, element("tr", { class: "detail" }, element("td", { colspan: shown.length }, detail(row)))] : [line];
  }
}
