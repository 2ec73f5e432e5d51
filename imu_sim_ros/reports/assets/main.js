// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The page from its content.

const builders = {
  text: (item) => element("p", { class: item.faint ? "caption" : null }, item.text),
  heading: (item) => element("h3", { class: "part" }, item.text),
  code: (item) => element("pre", { tabindex: "0", class: item.text.split("\n").length > 20 ? "long" : null }, item.text),
  table: (item) => {
    const table = new Table(item.columns, { name: item.name, search: item.search, shown: item.shown, printed: item.printed, links: item.links, digits: item.digits, intervals: item.intervals });
    return item.name ? element("div", {}, element("h3", {}, item.name), table.host) : table.host;
  },
  plot: (item) => new Plot(item).figure,
  path: (item) => new Path(item).figure,
  strip: (item) => element("figure", {}, element("h3", {}, item.title), element("div", { class: "strip" }, ...item.frames.map((frame) => {
    const at = `${inWords(frame.t_s)} s`;
    return element("div", {}, element("img", { src: `data:image/png;base64,${frame.png}`, alt: `${item.title} at ${at}` }), element("span", { class: "caption" }, at));
  }))),
  plots: (item) => rowsFilled(element("div", { class: "plots" }, ...item.items.map(built))),
  folded: (item) => element("details", {}, element("summary", {}, item.title), ...item.items.map(built)),
  verdict: (item) => {
    const verdict = new Verdict(item);
    if (item.judged.length) verdict.show(0);
    return verdict.host;
  },
  campaign: (item) => {
    const host = element("div");
    campaigns.set(item.campaign, new Campaign(item, host));
    return host;
  },
};

function built(item) {
  const node = builders[item.kind](item);
  if (item.wide) node.classList.add("wide");
  return node;
}

// A plot beside which there is none takes the whole width.
function rowsFilled(grid) {
  let half = null;
  for (const child of [...grid.children, null]) {
    if (child && !child.classList.contains("wide")) half = half ? null : child;
    else if (half) { half.classList.add("wide"); half = null; }
  }
  return grid;
}

function theme() {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark"
    : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "light" : "dark";
}

function start() {
  const content = JSON.parse(document.getElementById("content").textContent);
  const links = document.getElementById("links"), main = document.querySelector("main");
  content.sections.forEach((section, k) => { if (!sectionIds.has(section.title)) sectionIds.set(section.title, `part${k + 1}`); });
  content.sections.forEach((section, k) => {
    const id = `part${k + 1}`;
    links.append(element("a", { href: `#${id}` }, section.short || section.title));
    const host = element("section", { id }, element("h2", {}, section.title));
    main.append(host);  // plots measure their width: they are built in a page that has one
    for (const item of section.items) host.append(built(item));
  });
  links.after(element("button", { type: "button", title: "dark or light", "aria-label": "dark or light", onclick: theme }, "\u25d0"));
  document.documentElement.dataset.ready = "";
}

start();
