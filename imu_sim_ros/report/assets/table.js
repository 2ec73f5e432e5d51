// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A table that is sorted by a click on a column's name and searched by words and comparisons.

const PAGE = 25;
const PRINTED = 250;  // rows on paper, where nobody turns over

// A column comes as {name, values}, or as {name, words, index} where few strings stand often.
function unpacked(column) {
  return column.words ? column.index.map((k) => (k === null ? null : column.words[k])) : column.values;
}

// The search: words that all must occur; name=value, name<number, name>number; quotes hold spaces.
function matcher(query, columns) {
  const parts = query.match(/(?:[^\s"]|"[^"]*(?:"|$))+/g) || [];
  const tests = parts.map((part) => {
    const found = part.match(/^([^=<>"]+)(<=|>=|=|<|>)(.+)$/);
    const column = found && columns.find((one) => one.name.toLowerCase() === found[1].toLowerCase());
    const bare = (words) => words.replaceAll('"', "").toLowerCase();
    if (!column) {
      const wanted = bare(part);
      return (row) => columns.some((one) => one.values[row] !== null && String(one.values[row]).toLowerCase().includes(wanted));
    }
    const [, , sign, words] = found, wanted = bare(words), number = Number(wanted);
    if (sign === "=") {
      return (row) => { const value = column.values[row]; return value !== null && (String(value).toLowerCase() === wanted || value === number); };
    }
    const compare = { "<": (v) => v < number, ">": (v) => v > number, "<=": (v) => v <= number, ">=": (v) => v >= number }[sign];
    return (row) => column.values[row] !== null && compare(column.values[row]);
  });
  return (row) => tests.every((test) => test(row));
}

class Table {
  // columns: [{name, values}]; options: {name, search, onfilter, bad}
  constructor(columns, options = {}) {
    this.columns = columns.map((one) => ({ ...one, values: unpacked(one) }));
    this.columns.forEach((one) => { one.number = one.values.some((v) => typeof v === "number") && one.values.every((v) => v === null || typeof v === "number"); });
    this.options = options;
    this.count = this.columns.length ? this.columns[0].values.length : 0;
    this.rows = Array.from({ length: this.count }, (_, k) => k);
    this.order = { column: null, down: false };
    this.page = 0;
    this.host = element("div", { "data-table": options.name || "" });
    this.build();
    this.filter("");
    window.addEventListener("beforeprint", () => this.draw(PRINTED));
    window.addEventListener("afterprint", () => this.draw());
  }

  column(name) { return this.columns.find((one) => one.name === name).values; }

  build() {
    const { search } = this.options;
    this.input = element("input", { type: "search", placeholder: 'search: words, name=value, name>1', "aria-label": `search ${this.options.name || "table"}`, oninput: () => this.filter(this.input.value) });
    this.told = element("span", { class: "faint", role: "status" });
    const bar = element("div", { class: "controls" }, this.input, this.told);
    if (!search) this.input.remove();
    this.buttons = this.columns.map((column, k) => element("button", { type: "button", onclick: () => this.sort(k) }, column.name));
    const heads = this.buttons.map((button, k) => element("th", { class: this.columns[k].number ? "number" : null, scope: "col", "data-name": this.columns[k].name }, button));
    this.body = element("tbody");
    const turn = (words, by) => element("button", { type: "button", onclick: () => { this.page += by; this.draw(); } }, words);
    this.back = turn("\u2039 back", -1);
    this.next = turn("next \u203a", 1);
    this.pager = element("div", { class: "controls pager" }, this.back, this.next);
    const table = element("table", {}, element("thead", {}, element("tr", {}, ...heads)), this.body);
    this.host.append(bar, element("div", { class: "scroll", tabindex: "0" }, table), this.pager);
  }

  filter(query) {
    this.input.value = query;
    const fits = matcher(query, this.columns);
    this.rows = [];
    for (let row = 0; row < this.count; row++) if (fits(row)) this.rows.push(row);
    this.page = 0;
    this.arrange();
    if (this.options.onfilter) this.options.onfilter(this.rows);
  }

  sort(k) {
    this.order = { column: k, down: this.order.column === k && !this.order.down };
    this.page = 0;
    this.arrange();
  }

  arrange() {
    const { column, down } = this.order;
    this.buttons.forEach((button, k) => {
      const state = k !== column ? "none" : down ? "descending" : "ascending";
      button.parentElement.setAttribute("aria-sort", state);
      button.textContent = this.columns[k].name + (k !== column ? "" : down ? " \u25bc" : " \u25b2");
    });
    if (column === null) this.rows.sort((a, b) => a - b);
    else {
      const { values, number } = this.columns[column], sign = down ? -1 : 1;
      const order = number ? (a, b) => a - b : (a, b) => String(a).localeCompare(String(b), "en", { numeric: true });
      this.rows.sort((a, b) => {
        const one = values[a], other = values[b];
        if (one === null || other === null) return (one === null) - (other === null);  // what is missing comes last
        return sign * order(one, other) || a - b;
      });
    }
    this.draw();
  }

  draw(size = PAGE) {
    const pages = Math.max(1, Math.ceil(this.rows.length / size)), first = size === PAGE ? this.page * PAGE : 0;
    const bad = this.options.bad;
    this.body.replaceChildren(...this.rows.slice(first, first + size).map((row) =>
      element("tr", { class: bad && bad(row, this) ? "bad" : null }, ...this.columns.map((column) => {
        const value = column.values[row], words = inWords(value, 5);
        return element("td", { class: column.number ? "number" : words.length > 60 ? "long" : null }, words);
      }))));
    this.pager.hidden = pages === 1;
    this.back.disabled = this.page === 0;
    this.next.disabled = this.page >= pages - 1;
    const part = pages > 1 ? `, ${first + 1} to ${Math.min(first + size, this.rows.length)} shown` : "";
    this.told.textContent = `${this.rows.length} of ${this.count} rows${part}`;
    this.host.dataset.rows = this.rows.length;
  }
}
