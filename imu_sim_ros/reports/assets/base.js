// Copyright 2026 imu_sim_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// Elements, numbers in words, axes. Every text gets into the page as text, never as HTML.

const sectionIds = new Map();  // by title, for links between sections
const DASHES = ["", "6 3", "2 2", "8 3 2 3"];

function element(name, attributes = {}, ...content) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...content.filter((part) => part !== null));
  return node;
}

function drawing(name, attributes = {}, text = null) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== null) node.textContent = text;
  return node;
}

// A number is that of a series, a string an axis; the truth and what belongs to no estimator have
// the colour of words: null.
function colour(index) {
  if (index === null) return "var(--ink)";
  return typeof index === "string" ? `var(--${index})` : `var(--c${index % SERIES_COLOURS})`;
}
function dash(index) { return typeof index === "number" ? DASHES[Math.floor(index / SERIES_COLOURS) % DASHES.length] : ""; }

function inWords(value, digits = 4) {
  if (value === null || value === undefined) return "";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) {
    return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  }
  return String(Number(value.toPrecision(digits)));
}

// The power of ten of a number.
function powerOf(value) { return Number(Math.abs(value).toExponential().split("e")[1]); }

function fixed(value, place, power) {
  if (value === 0) return "0";
  const mantissa = power ? value / Number(`1e${power}`) : value, digits = place + power;
  const unit = Number(`1e${-digits}`);
  const text = digits < 0 ? (Math.sign(value) * Math.round(Math.abs(mantissa) / unit) * unit).toFixed(0) : mantissa.toFixed(digits);
  const plain = Number(text) === 0 ? text.replace("-", "") : text;
  return power ? `${plain}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}` : plain;
}

// A value and the ends of its interval with two digits of half its width, as interval_texts of
// core/digits.py writes them.
function intervalInWords(value, low, high) {
  const numbers = [value, low, high], half = 0.5 * (high - low);
  if (numbers.some((number) => typeof number !== "number") || !(half > 1e-9 * Math.max(...numbers.map(Math.abs))) || !isFinite(half)) return numbers.map((number) => inWords(number));
  const first = 1 - Number(half.toExponential(1).split("e")[1]);
  let texts = [];
  for (let place = first; place < first + 10; place++) {
    const largest = Math.max(...numbers.map(Math.abs)), rounded = Number(fixed(largest, place, 0));
    const power = powerOf(rounded || largest), shown = power < -4 || power > 5 ? power : 0;
    texts = numbers.map((number) => fixed(number, place, shown));
    if ((low === value || texts[1] !== texts[0]) && (high === value || texts[2] !== texts[0])) break;
  }
  return texts;
}

// Ticks in as few digits as say them exactly: neighbours that hardly differ are told apart.
function ticksInWords(ticks, digits) {
  for (; digits < 12; digits++) {
    const texts = ticks.map((tick) => inWords(tick, digits));
    if (texts.every((text, k) => Number(text) === ticks[k])) return texts;
  }
  return ticks.map(String);
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value === null || value === undefined || !Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : null;
}

function quantile(sorted, p) {
  const place = (sorted.length - 1) * p, below = Math.floor(place);
  const above = Math.min(below + 1, sorted.length - 1);
  if (!Number.isFinite(sorted[below]) || !Number.isFinite(sorted[above])) return place === below ? sorted[below] : Number.isFinite(sorted[above]) ? sorted[below] : sorted[above];
  return sorted[below] + (sorted[above] - sorted[below]) * (place - below);
}

// A scale holds a range of values and where it lies in the drawing.
class Scale {
  constructor(range, log, from, to) {
    this.log = log;
    this.range = range;
    this.from = from;
    this.to = to;
  }
  inner(value) { return this.log ? Math.log10(value) : value; }
  outer(value) { return this.log ? 10 ** value : value; }
  at(value) {
    const [low, high] = this.range.map((end) => this.inner(end));
    return this.from + ((this.inner(value) - low) / (high - low)) * (this.to - this.from);
  }
  value(place) {
    const [low, high] = this.range.map((end) => this.inner(end));
    return this.outer(low + ((place - this.from) / (this.to - this.from)) * (high - low));
  }
  // About as many ticks as wanted, but at least three.
  ticks(wanted) {
    let places = [];
    for (let count = wanted; places.length < 3 && count < 8 * wanted; count++) places = this.steps(count);
    return places;
  }
  steps(wanted) {
    const [low, high] = this.range;
    if (this.log && Math.log10(high / low) >= 1) return this.decades(low, high, wanted);
    const rough = (high - low) / Math.max(wanted, 1), power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
    const positions = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) {
      positions.push(Number((k * step).toPrecision(12)));
    }
    return positions;
  }
  // Powers of ten, between which there is room for 3, or for 2 and 5.
  decades(low, high, wanted) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const every = Math.max(1, Math.ceil((last - first + 1) / wanted));
    const places = (factors) => {
      const ticks = [];
      for (let k = first - 1; k <= last; k++) {
        if ((k - first) % every !== 0) continue;
        for (const factor of factors) {
          const tick = Number((factor * 10 ** k).toPrecision(12));
          if (tick >= low * 0.999 && tick <= high * 1.001) ticks.push(tick);
        }
      }
      return ticks;
    };
    const powers = places([1]);
    if (powers.length >= 3) return powers;
    const richest = places([1, 2, 5]), some = places([1, 3]);
    return richest.length <= Math.max(wanted, 3) || some.length < 3 ? richest : some;
  }
}

function padded(range, log) {
  if (range === null) return log ? [0.1, 10] : [0, 1];
  let [low, high] = range;
  if (log) {
    if (low === high) return [low / 2, high * 2];
    const more = (high / low) ** 0.04;
    return [low / more, high * more];
  }
  if (low === high) return [low - (Math.abs(low) || 1) * 0.5, high + (Math.abs(high) || 1) * 0.5];
  const more = (high - low) * 0.04;
  return [low - more, high + more];
}
