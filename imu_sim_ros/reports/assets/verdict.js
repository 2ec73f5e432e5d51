// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The verdict: who is best, by how much, how sure that is, and what failed.

const campaigns = new Map();  // by the folder, for links to runs
const MOST_ACROSS = 12;  // columns of the overview
const MOST_OF_MATRIX = 30;
const MOST_OF_A_COLUMN = 8;  // members of a matrix beside which there is room for a plot

function runsLink(campaign, query, label) {
  return element("a", { href: "#", onclick: (event) => {
    event.preventDefault();
    campaigns.get(campaign).find(query);
  } }, label);
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
        ...item.judged.map((judgement, k) => element("option", { value: k }, judgement.factor ? `which ${judgement.factor}: ${judgement.label}` : judgement.label)));
      this.host.append(element("div", { class: "controls" }, element("label", {}, "verdict on ", select)));
    }
    this.host.append(this.body, ...this.failures(), ...this.findings());
    this.first = true;
  }

  requirements() {
    const { requirements, campaign, problems } = this.item;
    if (!requirements.count && !problems.length) return [];
    const missed = requirements.missed.map((requirement) => element("li", {}, `${requirement.requirement}${requirement.place ? ` with ${requirement.place}` : ""}: `,
      element("b", {}, requirement.comment), " ", runsLink(campaign, requirement.query, "its runs")));
    const lines = [...missed, ...problems.map((line) => element("li", {}, line))];
    if (!lines.length) return [element("p", { class: "passed" }, `\u2713 ${requirements.count === 1 ? "the requirement is" : `all ${requirements.count} requirements are`} met`)];
    const headline = missed.length ? `\u2717 ${requirements.texts} of ${requirements.count} requirements not met` : "\u2717 the gate fails";
    const rest = lines.length > 10 ? [element("details", {}, element("summary", {}, `${lines.length - 10} more`), element("ul", {}, ...lines.splice(10)))] : [];
    return [element("div", { class: "failed box", role: "alert" }, element("b", {}, headline), element("ul", {}, ...lines), ...rest)];
  }

  failures() {
    const { failures, campaign } = this.item;
    if (!failures.length) return [];
    const lines = failures.map((failure) => element("li", {}, `${failure.runs} runs: ${failure.reason} (${failure.place}) `, runsLink(campaign, failure.query, "these runs")));
    const rest = lines.length > 8 ? [element("details", {}, element("summary", {}, `${lines.length - 8} more`), element("ul", {}, ...lines.splice(8)))] : [];
    return [element("h3", {}, "Failed runs"), element("ul", { class: "failures", "data-failures": failures.length }, ...lines), ...rest];
  }

  findings() {
    const { findings, campaign } = this.item;
    if (!findings.length) return [];
    const lines = findings.map((finding) => element("li", {}, `${finding.runs} runs: ${finding.finding} (${finding.place}) `, runsLink(campaign, finding.query, "its runs")));
    const rest = lines.length > 8 ? [element("details", {}, element("summary", {}, `${lines.length - 8} more`), element("ul", {}, ...lines.splice(8)))] : [];
    return [element("h3", {}, "Findings in the estimates"), element("ul", { class: "failures", "data-findings": findings.length }, ...lines), ...rest];
  }

  show(k) {
    const judged = this.item.judged[k];
    this.body.replaceChildren(...this.headline(judged));
    if (!judged.contests.length) return;
    this.matrixHost = element("div");
    this.plotHost = element("div");
    const choice = this.choice = element("select", { "aria-label": "where", onchange: () => this.contest(judged, choice.value) });
    if (judged.contests.length > 1) choice.append(element("option", { value: "" }, `all ${judged.contests.length}: how often`));
    judged.contests.forEach((contest, n) => choice.append(element("option", { value: n }, contest.place || "all runs")));
    if (judged.contests.length > 1) this.body.append(this.overview(judged));
    const wide = this.fullest(judged).ranking.length > MOST_OF_A_COLUMN;
    const matrix = element("div", { class: wide ? "wide" : null }, element("h3", {}, `Who is better: ${judged.label}`),
      judged.contests.length > 1 ? element("div", { class: "controls" }, choice) : null, this.matrixHost);
    const pair = judged.contests.length === 1 && judged.contests[0].ranking.length === 2;  // said above
    this.body.append(rowsFilled(element("div", { class: "plots" }, pair ? null : matrix, this.plotHost)));
    this.contest(judged, choice.value);
  }

  // Who is best, by how much and how sure that is; for one contest of several a table.
  headline(judged) {
    const all = this.item.judged.filter((judgement) => judgement.label === judged.label && judgement.contests.length);
    const shown = all.length ? all : [judged];
    const parts = shown.map((judgement) => {
      const sure = judgement.contests.some((contest) => contest.best !== null);
      return element("p", { class: "headline" }, element("b", { class: judgement.contests.length ? (sure ? "best" : "faint") : null }, judgement.lead), judgement.rest ? `: ${judgement.rest.replaceAll(" = ", "\u00a0=\u00a0")}` : "");
    });
    if (judged.table) parts.push(new Table(judged.table.columns, {}).host);
    return parts;
  }

  // The winner of each contest and its lead over the next: the last varying name goes across.
  overview(judged) {
    const { contests, names } = judged, keys = Object.keys(contests[0].where);
    const values = (key) => [...new Set(contests.map((contest) => contest.where[key]))];
    const across = [...keys].reverse().find((key) => values(key).length <= MOST_ACROSS && keys.length > 1), down = keys.filter((key) => key !== across);
    const heads = across ? values(across) : [""], rows = new Map();
    const valueText = (key, value) => (Number.isNaN(Number(value)) ? value : `${key.split(".").pop()} ${value}`);
    contests.forEach((contest, n) => {
      const name = down.map((key) => valueText(key, contest.where[key])).join(", ");
      if (!rows.has(name)) rows.set(name, new Map());
      rows.get(name).set(across ? contest.where[across] : "", n);
    });
    const field = (n) => {
      if (n === undefined) return element("td", {}, "");
      const contest = contests[n], content = contest.best !== null ? [element("b", {}, contest.best), ` ${contest.size}`] : [contest.equal ? "equal" : "undecided"];
      const node = element("td", { class: contest.best === null && contest.equal ? "equal" : null }, element("button", { type: "button", title: contest.line, onclick: () => this.choose(n) }, ...content));
      if (contest.best !== null) node.style.background = `color-mix(in srgb, ${colour(names.indexOf(contest.best))} 25%, transparent)`;
      return node;
    };
    const body = [...rows].map(([name, of]) => element("tr", {}, element("th", { scope: "row" }, name), ...heads.map((head) => field(of.get(head)))));
    const head = across ? [element("thead", {}, element("tr", {}, element("th", {}, across.split(".").pop()), ...heads.map((value) => element("th", { scope: "col" }, value))))] : [];
    return element("div", {}, element("h3", {}, `Best ${judged.factor}: ${judged.label}`),
      element("div", { class: "scroll", tabindex: "0" }, element("table", { class: "matrix overview" }, ...head, element("tbody", {}, ...body))),
      element("p", { class: "caption" }, "The best in each cell, and how its value compares with that of the next best: \u00f72 is half of it. A field opens its comparison below."));
  }

  choose(n) {
    this.choice.value = String(n);
    this.choice.dispatchEvent(new Event("change"));
    this.choice.scrollIntoView({ block: "center" });
  }

  contest(judged, choice) {
    const contest = choice === "" ? null : judged.contests[Number(choice)];
    const names = (contest || this.fullest(judged)).ranking.slice(0, MOST_OF_MATRIX);
    const cell = contest ? (a, b) => effectCell(contest, a, b) : (a, b) => countCell(judged.contests, a, b);
    const heads = names.map((name) => element("th", { scope: "col" }, element("span", {}, name)));
    const rows = names.map((a) => element("tr", {}, element("th", { scope: "row" }, a), ...names.map((b) => (a === b ? element("td", { class: "same" }, "") : cell(a, b)))));
    const explanation = contest ? "Row against column on the same seeds: green is better, red worse, beyond the tolerance; grey is equal within it; white is undecided. Hold the pointer over a field for its interval."
      : `In how many of ${judged.contests.length} comparisons the row is better than the column.`;
    this.matrixHost.replaceChildren(element("div", { class: "scroll", tabindex: "0" }, element("table", { class: "matrix" }, element("thead", {}, element("tr", {}, element("td"), ...heads)), element("tbody", {}, ...rows))),
      contest && judged.contests.length > 1 ? element("p", {}, contest.line) : "", element("p", { class: "caption" }, explanation));
    const plotted = contest || judged.contests[0];
    this.plotHost.replaceChildren(...(plotted.plot ? [new Plot(plotted.plot).figure] : []));
  }

  fullest(judged) { return judged.contests.reduce((a, b) => (b.ranking.length > a.ranking.length ? b : a)); }
}

function effectOf(contest, a, b) {
  const effect = contest.effects.find((entry) => entry.a === a && entry.b === b);
  if (effect) return { verdict: effect.verdict, words: effect.short, line: effect.line };
  const reverse = contest.effects.find((entry) => entry.a === b && entry.b === a);
  if (!reverse) return null;
  const turned = { better: "worse", worse: "better" };
  return { verdict: turned[reverse.verdict] || reverse.verdict, words: reverse.turned, line: reverse.line };
}

function effectCell(contest, a, b) {
  const effect = effectOf(contest, a, b);
  if (!effect) return element("td", {}, "");
  return element("td", { class: effect.verdict, title: effect.line }, effect.words);
}

function countCell(contests, a, b) {
  const effects = contests.map((contest) => effectOf(contest, a, b)).filter(Boolean);
  const won = effects.filter((effect) => effect.verdict === "better").length, lost = effects.filter((effect) => effect.verdict === "worse").length;
  return element("td", { class: won > lost ? "better" : lost > won ? "worse" : "undecided", title: `${a}: better than ${b} in ${won}, worse in ${lost} of ${effects.length}` }, effects.length === contests.length ? String(won) : `${won} of ${effects.length}`);
}
