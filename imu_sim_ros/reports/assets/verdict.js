// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The verdict: who is best, by how much, how sure that is, and what failed.

const campaigns = new Map();  // by the folder, for links to runs
const MOST_LINES_OF_VERDICT = 12;
const MOST_OF_MATRIX = 30;
const MOST_OF_A_COLUMN = 8;  // members of a matrix beside which there is room for a plot

function runsLink(campaign, query, words) {
  return element("a", { href: "#", onclick: (event) => {
    event.preventDefault();
    campaigns.get(campaign).find(query);
  } }, words);
}

class Verdict {
  // item: {campaign, judged: [{metric, label, runs, done, contests, factor}], requirements, failures}
  constructor(item) {
    this.item = item;
    this.host = element("div", { class: "verdict" });
    this.body = element("div");
    this.host.append(...this.requirements());
    if (item.judged.length > 1) {
      const select = element("select", { "aria-label": "verdict on", onchange: () => this.show(Number(select.value)) },
        ...item.judged.map((one, k) => element("option", { value: k }, one.factor ? `which ${one.factor}: ${one.label}` : one.label)));
      this.host.append(element("div", { class: "controls" }, element("label", {}, "verdict on ", select)));
    }
    this.host.append(this.body, ...this.failures());
    this.first = true;
  }

  requirements() {
    const { requirements, campaign, problems } = this.item;
    if (!requirements.count && !problems.length) return [];
    const missed = requirements.missed.map((one) => element("li", {}, `${one.requirement}: `, element("b", {}, one.value === null ? "there is no value" : inWords(one.value)),
      one.place ? ` with ${one.place} ` : " ", runsLink(campaign, one.query, "its runs")));
    const lines = [...missed, ...problems.map((line) => element("li", {}, line))];
    if (!lines.length) return [element("p", { class: "passed" }, `\u2713 all ${requirements.count} requirements are met`)];
    const words = missed.length ? `\u2717 ${requirements.texts} of ${requirements.count} requirements not met` : "\u2717 the gate fails";
    const rest = lines.length > 10 ? [element("details", {}, element("summary", {}, `${lines.length - 10} more`), element("ul", {}, ...lines.splice(10)))] : [];
    return [element("div", { class: "failed box", role: "alert" }, element("b", {}, words), element("ul", {}, ...lines), ...rest)];
  }

  failures() {
    const { failures, campaign } = this.item;
    if (!failures.length) return [];
    const lines = failures.map((one) => element("li", {}, `${one.runs} runs: ${one.reason} (${one.place}) `, runsLink(campaign, one.query, "these runs")));
    const rest = lines.length > 8 ? [element("details", {}, element("summary", {}, `${lines.length - 8} more`), element("ul", {}, ...lines.splice(8)))] : [];
    return [element("h3", {}, "Failed runs"), element("ul", { class: "failures", "data-failures": failures.length }, ...lines), ...rest];
  }

  show(k) {
    const judged = this.item.judged[k];
    this.body.replaceChildren(...this.headline(judged));
    if (!judged.contests.length) return;
    this.matrixHost = element("div");
    this.plotHost = element("div");
    const choice = element("select", { "aria-label": "where", onchange: () => this.contest(judged, choice.value) });
    if (judged.contests.length > 1) choice.append(element("option", { value: "" }, `all ${judged.contests.length}: how often`));
    judged.contests.forEach((one, n) => choice.append(element("option", { value: n }, one.where || "all runs")));
    const wide = this.fullest(judged).ranking.length > MOST_OF_A_COLUMN;
    this.body.append(rowsFilled(element("div", { class: "plots" }, element("div", { class: wide ? "wide" : null }, element("h3", {}, `Who is better: ${judged.label}`),
      judged.contests.length > 1 ? element("div", { class: "controls" }, choice) : null, this.matrixHost), this.plotHost)));
    this.contest(judged, choice.value);
  }

  headline(judged) {
    const { contests } = judged;
    if (!contests.length) return [element("p", { class: "headline" }, judged.alone)];
    const all = this.item.judged.filter((one) => one.label === judged.label && one.contests.length);
    const parts = all.length > 1 || contests.length > 1 ? all.map((one) => element("p", { class: "headline" }, ...this.summary(one))) : [];
    const lines = contests.map((one) => {
      const where = one.where ? element("span", { class: "where" }, one.where) : null;
      const best = element("b", { class: one.best === null ? "faint" : "best" }, one.best !== null ? one.best : one.equal ? "equal" : "undecided");
      return element("li", { class: parts.length ? null : "headline" }, where, best, ` ${one.line.replaceAll(" = ", "\u00a0=\u00a0")}`);
    });
    const rest = lines.splice(MOST_LINES_OF_VERDICT);
    if (all.length > 1) parts.push(element("h3", { class: "part" }, `Which ${judged.factor}`));
    parts.push(element("ul", { class: "contests" }, ...lines));
    if (rest.length) parts.push(element("details", {}, element("summary", {}, `${rest.length} more`), element("ul", { class: "contests" }, ...rest)));
    return parts;
  }

  // Who is best, in how many of the cells, for one factor.
  summary({ contests, factor, label }) {
    const wins = new Map(), count = contests.length;
    for (const one of contests) if (one.best !== null) wins.set(one.best, (wins.get(one.best) || 0) + 1);
    const [first, ...others] = [...wins].sort((a, b) => b[1] - a[1]);
    const equal = contests.filter((one) => one.best === null && one.equal).length, open = contests.filter((one) => one.best === null && !one.equal).length;
    const without = (equal ? `, equal in ${equal}` : "") + (open ? `, undecided in ${open}` : "");
    const times = count > 1 ? ` in any of ${count} comparisons${without}` : "";
    if (!first) return [`No ${factor} is better than the next${times}: ${label}`];
    const rest = others.flatMap(([name, of]) => [", ", element("b", {}, name), ` in ${of}`]);
    const where = count > 1 ? ` in ${first[1]} of ${count} comparisons` : "";
    return [element("b", {}, first[0]), ` is the best ${factor}${where}`, ...rest, without, `: ${label}`];
  }

  contest(judged, choice) {
    const one = choice === "" ? null : judged.contests[Number(choice)];
    const names = (one || this.fullest(judged)).ranking.slice(0, MOST_OF_MATRIX);
    const cell = one ? (a, b) => effectCell(one, a, b) : (a, b) => countCell(judged.contests, a, b);
    const heads = names.map((name) => element("th", { scope: "col" }, element("span", {}, name)));
    const rows = names.map((a) => element("tr", {}, element("th", { scope: "row" }, a), ...names.map((b) => (a === b ? element("td", { class: "same" }, "") : cell(a, b)))));
    const told = one ? "Row against column on the same seeds: green is better, red worse, beyond the tolerance; grey is equal within it; white is undecided. Hold the pointer over a field for its interval."
      : `In how many of ${judged.contests.length} comparisons the row is better than the column.`;
    this.matrixHost.replaceChildren(element("div", { class: "scroll", tabindex: "0" }, element("table", { class: "matrix" }, element("thead", {}, element("tr", {}, element("td"), ...heads)), element("tbody", {}, ...rows))),
      element("p", { class: "caption" }, told));
    const drawn = one || judged.contests[0];
    this.plotHost.replaceChildren(...(drawn.plot ? [new Plot(drawn.plot).figure] : []));
  }

  fullest(judged) { return judged.contests.reduce((a, b) => (b.ranking.length > a.ranking.length ? b : a)); }
}

function effectOf(contest, a, b) {
  const found = contest.effects.find((one) => one.a === a && one.b === b);
  if (found) return { verdict: found.verdict, words: found.short, line: found.line };
  const other = contest.effects.find((one) => one.a === b && one.b === a);
  if (!other) return null;
  const turned = { better: "worse", worse: "better" };
  return { verdict: turned[other.verdict] || other.verdict, words: other.turned, line: other.line };
}

function effectCell(contest, a, b) {
  const found = effectOf(contest, a, b);
  if (!found) return element("td", {}, "");
  return element("td", { class: found.verdict, title: found.line }, found.words);
}

function countCell(contests, a, b) {
  const found = contests.map((one) => effectOf(one, a, b)).filter(Boolean);
  const won = found.filter((one) => one.verdict === "better").length, lost = found.filter((one) => one.verdict === "worse").length;
  return element("td", { class: won > lost ? "better" : lost > won ? "worse" : "undecided", title: `${a}: better than ${b} in ${won}, worse in ${lost} of ${found.length}` }, found.length === contests.length ? String(won) : `${won} of ${found.length}`);
}
