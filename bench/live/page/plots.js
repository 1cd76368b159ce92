// Channels over time: one plot for each kind and unit of a group, each channel a band from its least to its greatest value.
/* global uPlot */

import { bandOf } from "./buffers.js";
import { clock, decimalsOf, fixed, shownIn } from "./text.js";

const MOST_LINES = 4; // in one plot; more are unreadable
const POINTS = 400;
const HEIGHT = 190;
const READ_MS = 200; // numbers that change faster cannot be read
export const ALL = "All";
const REST = "Machine";
const KINDS = { position: "positions", current: "currents", speed: "speed", temperature: "temperatures", supply: "supply" };

/** Channels as plots: {group, title, unit, channels}. States and faults are words, and stand in the header. */
export function panelsOf(channels) {
  const panels = new Map();
  for (const channel of channels.filter((c) => c.kind !== "state")) {
    const shown = shownIn(channel);
    const group = channel.group || REST;
    const kind = KINDS[channel.kind] || (channel.kind === "other" ? channel.name : channel.kind);
    const key = JSON.stringify([group, kind, shown.unit]);
    if (!panels.has(key)) panels.set(key, []);
    const alike = panels.get(key);
    if (!alike.length || alike.at(-1).channels.length >= MOST_LINES) alike.push({ group, kind, unit: shown.unit, channels: [] });
    alike.at(-1).channels.push({ ...channel, shown });
  }
  return [...panels.values()].flat().map(titled);
}

function titled(panel) {
  const kind = panel.channels.length === 1 ? panel.channels[0].name : panel.kind;
  return { ...panel, title: kind, heading: `${panel.group} · ${kind}` };
}

export function groupsOf(panels) {
  const names = [...new Set(panels.map((p) => p.group))];
  return names.length > 1 ? [...names, ALL] : names;
}

/** Colours of the style sheet; anew when the scheme changes. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return { lines: [1, 2, 3, 4].map((k) => of(`--line${k}`)), ink: of("--soft"), grid: of("--grid"), limit: of("--fail"), paper: of("--card"),
    zone: of("--zone") };
}

/** Limits in shown units that belong into a picture of these values: those that are not far away. */
function limitsNear(channel, low, high) {
  const { factor, offset } = channel.shown;
  const at = (limit) => (typeof limit === "number" ? (limit - offset) / factor : null);
  const size = Math.max(Math.abs(low), Math.abs(high));
  return [at(channel.lower), at(channel.upper)].filter((v) => v !== null && Math.abs(v) <= 2 * size);
}

function rangeOf(panel) {
  return (_, low, high) => {
    if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
    const limits = panel.channels.flatMap((c) => limitsNear(c, low, high));
    const [a, b] = [Math.min(low, ...limits), Math.max(high, ...limits)];
    const pad = Math.max(0.08 * (b - a), 1e-3 * Math.max(Math.abs(a), Math.abs(b)), 1e-9);
    return [a - pad, b + pad];
  };
}

function drawLimits(panel, palette) {
  return (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.strokeStyle = palette().limit;
    ctx.lineWidth = devicePixelRatio;
    const { min, max } = u.scales.y;
    for (const value of new Set(panel.channels.flatMap((c) => limitsNear(c, min, max)))) {
      const y = Math.round(u.valToPos(value, "y", true)) + 0.5;
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  };
}

/** Ticks of the upright axis with as many decimals as they need. */
function tickTexts(_, ticks, __, ___, step) {
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return ticks.map((t) => (decimals > 5 ? t.toExponential(1) : fixed(t, decimals)));
}

function optionsOf(panel, palette, width, hooks) {
  const lines = panel.channels.flatMap((channel, k) => ["high", "low"].map(() => (
    { label: channel.name, width: 1, stroke: () => palette().lines[k], points: { show: false }, spanGaps: false })));
  const axis = { stroke: () => palette().ink, grid: { stroke: () => palette().grid, width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
  return {
    width, height: HEIGHT, legend: { show: false }, pxAlign: false,
    cursor: { drag: { x: false, y: false }, points: { show: false }, y: false },
    scales: { x: { time: false }, y: { range: rangeOf(panel) } },
    series: [{}, ...lines],
    bands: panel.channels.map((_, k) => ({ series: [2 * k + 1, 2 * k + 2], fill: () => `${palette().lines[k]}3a` })),
    axes: [{ ...axis, size: 28, values: (_, ticks) => ticks.map((t) => (t < 600 ? `${+t.toFixed(2)} s` : clock(t))), space: 70 }, { ...axis, size: 58, values: tickTexts }],
    hooks,
  };
}

function limitText({ lower, upper, shown }) {
  const at = (limit) => +((limit - shown.offset) / shown.factor).toPrecision(4);
  const [a, b] = [lower, upper].map((limit) => (typeof limit === "number" ? at(limit) : null));
  if (a === null && b === null) return "";
  if (a !== null && b !== null) return a === -b ? `limit ±${b}` : `limits ${a} to ${b}`.replaceAll("-", "−");
  return (a === null ? `limit ${b}` : `least ${a}`).replaceAll("-", "−");
}

/** The limits of all channels of a plot, where they are the same. */
function commonLimit(panel) {
  const texts = new Set(panel.channels.map(limitText));
  return texts.size === 1 ? [...texts][0] : null;
}

function captionOf(panel) {
  const caption = document.createElement("figcaption");
  caption.textContent = panel.unit ? `${panel.heading} / ${panel.unit}` : panel.heading;
  const limit = commonLimit(panel);
  if (limit) caption.appendChild(document.createElement("span")).textContent = limit;
  return caption;
}

function legendOf(panel) {
  const list = document.createElement("ul");
  list.className = "legend";
  const values = panel.channels.map((channel, k) => {
    const item = list.appendChild(document.createElement("li"));
    const mark = item.appendChild(document.createElement("i"));
    mark.className = `mark line${k + 1}`;
    item.append(`${channel.name} `);
    const value = item.appendChild(document.createElement("b"));
    item.append(` ${panel.unit}`);
    const limit = commonLimit(panel) === null && limitText(channel);
    if (limit) item.appendChild(document.createElement("span")).textContent = limit;
    return value;
  });
  return { list, values };
}

/** The values of a plot's channels: under the cursor, from least to greatest, else the newest. */
function write(panel, values, chart, latest) {
  const decimals = decimalsOf(chart.scales.y.max - chart.scales.y.min);
  const at = chart.cursor.idx;
  panel.channels.forEach(({ name, shown }, k) => {
    const [high, low] = typeof at === "number" ? [chart.data[2 * k + 1][at], chart.data[2 * k + 2][at]] : [];
    const last = typeof latest[name] === "number" ? (latest[name] - shown.offset) / shown.factor : null;
    values[k].textContent = typeof low === "number" ? `${fixed(low, decimals)} … ${fixed(high, decimals)}` : fixed(last, decimals);
  });
}

/** One plot in the document: {node, show(history, window, end, last), visible, group, remove()}. */
export function plotOf(panel, palette) {
  const node = document.createElement("figure");
  node.className = "plot";
  node.appendChild(captionOf(panel));
  const frame = node.appendChild(document.createElement("div"));
  frame.className = "frame";
  const { list, values } = legendOf(panel);
  node.appendChild(list);
  const plot = { node, group: panel.group, visible: false };
  let chart = null;
  let latest = {};
  let labelled = 0;
  const label = (u) => {
    labelled = performance.now();
    write(panel, values, u, latest);
  };
  plot.show = (history, seconds, end, last) => {
    latest = last;
    const view = history.view(seconds, Math.min(POINTS, Math.max(100, frame.clientWidth)), end);
    const data = [view.x, ...panel.channels.flatMap(({ name, shown }) => bandOf(view, name, shown).reverse())];
    chart ??= new uPlot(optionsOf(panel, palette, frame.clientWidth, { draw: [drawLimits(panel, palette)], setCursor: [label] }), data, frame);
    if (chart.width !== frame.clientWidth && frame.clientWidth > 0) chart.setSize({ width: frame.clientWidth, height: HEIGHT });
    chart.batch(() => {
      chart.setData(data, false);
      const from = Math.max(0, end - seconds); // a run begins at 0 and fills the picture from its left
      chart.setScale("x", { min: from, max: from + seconds });
    });
    if (performance.now() - labelled >= READ_MS) label(chart);
  };
  plot.redraw = () => chart?.redraw(false);
  plot.remove = () => { chart?.destroy(); node.remove(); };
  return plot;
}
