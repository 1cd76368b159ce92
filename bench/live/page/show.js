// Runs that are over: the list, a run, a trend. Which of them is in the address (?run=…, ?view=trend&quantity=…); all that is
// told is put there as text.

import { resultRow, TONES } from "./ending.js";
import { takeToken } from "./stream.js";
import { quantityText } from "./text.js";
import { element, findingNode } from "./told.js";

const $ = (id) => document.getElementById(id);
const VIEWS = ["list", "run", "trend"];
const MACHINES = ["real", "served", "simulated"];
const MORE = 4; // times as many runs where older ones are asked for
const TYPED_MS = 200;
const token = takeToken();
let shown = 100;
let asked = 0; // what is shown last was asked last

async function get(path, fields) {
  const query = new URLSearchParams(Object.entries(fields || {}).filter(([, value]) => value !== "" && value !== null && value !== undefined));
  let reply;
  try {
    reply = await fetch(`${path}?${query}`, { headers: { "X-Levbench-Token": token }, cache: "no-store" });
  } catch {
    throw new Error("Nothing answers: bench show has ended, or the connection is lost.");
  }
  if (!reply.ok) throw new Error((await reply.text()).slice(0, 2000));
  return reply.json();
}

function wrong(text) {
  $("wrong").textContent = text;
  $("wrong").hidden = !text;
}

function title(text, below) {
  $("title").textContent = text;
  $("which").textContent = below;
  document.title = `${text} - Levbench`;
}

function only(view) {
  for (const name of VIEWS) $(name).hidden = name !== view;
  $("toruns").toggleAttribute("aria-current", view === "list");
  $("totrend").toggleAttribute("aria-current", view === "trend");
}

/** 2026-11-28 22:50 of an ISO 8601 time. */
function when(started) {
  return started.slice(0, 16).replace("T", " ");
}

function toned(tag, outcome) {
  return element(tag, `verdict ${TONES[outcome] || "open"}`, outcome);
}

function link(text, fields) {
  const node = element("a", "", text);
  node.href = `?${new URLSearchParams(fields)}`;
  return node;
}

function runRow(run) {
  const row = element("tr");
  const name = element("td");
  name.append(link(run.procedure, { run: run.run_id }));
  row.append(toned("td", run.outcome), name, element("td", "", run.rig), element("td", "", run.which || run.uut || "–"),
    element("td", "time", when(run.started)));
  return row;
}

async function showList() {
  only("list");
  const mine = ++asked;
  const words = $("words").value;
  const told = await get("runs", { filter: words, last: shown });
  if (mine !== asked) return;
  title("Runs", told.folder);
  $("runs").tBodies[0].replaceChildren(...told.runs.map(runRow));
  $("runs").hidden = !told.runs.length;
  $("count").textContent = !told.all ? "No runs here so far." : `${told.found} of ${told.all} runs`;
  $("more").hidden = told.runs.length >= told.found;
}

async function showRun(id) {
  only("run");
  const mine = ++asked;
  $("run").hidden = true;
  const run = await get(`run/${encodeURIComponent(id)}`);
  if (mine !== asked) return;
  title(run.procedure, [`rig ${run.rig}`, run.which || run.uut, when(run.started) + " UTC"].filter(Boolean).join(" · "));
  $("ending").className = `card ending ${TONES[run.outcome] || "open"}`;
  $("outcome").textContent = run.outcome;
  $("place").textContent = `The run lies in ${run.folder}`;
  const measured = run.results.filter((r) => typeof r.value === "number");
  const missing = run.results.filter((r) => typeof r.value !== "number").map((r) => quantityText(r.name));
  $("results").tBodies[0].replaceChildren(...measured.map((result) => linkedRow(result, run)));
  $("results").hidden = !measured.length;
  $("missing").textContent = measured.length ? `Not measured: ${missing.join(", ")}.` : "Nothing was measured.";
  $("missing").hidden = measured.length > 0 && !missing.length;
  $("findinglist").replaceChildren(...run.findings.map(findingNode));
  $("reportlink").hidden = $("frame").hidden = !run.report;
  $("noreport").hidden = Boolean(run.report);
  $("noreport").textContent = `There is no report. Next: bench report ${run.folder}`;
  if (run.report) $("reportlink").href = run.report;
  if (run.report) $("frame").contentWindow.location.replace(run.report); // no step of its own in the history
  $("run").hidden = false;
  $("run").focus({ preventScroll: true });
}

/** A row whose name leads to the trend of that quantity, of this machine. */
function linkedRow(result, run) {
  const row = resultRow(result);
  const fields = { view: "trend", quantity: result.name, procedure: run.procedure, rig: run.rig, machine: run.machine };
  if (run.seed !== null) fields.seed = run.seed;
  row.cells[0].replaceChildren(link(quantityText(result.name), fields));
  return row;
}

function choices(node, names, chosen) {
  const all = names.includes(chosen) || !chosen ? names : [...names, chosen];
  node.replaceChildren(...["", ...all].map((name) => {
    const option = element("option", "", name || "any");
    option.value = name;
    return option;
  }));
  node.value = chosen;
}

async function showTrend(fields) {
  only("trend");
  const mine = ++asked;
  $("chart").hidden = $("table").hidden = true;
  const known = await get("runs", { last: 1 });
  if (mine !== asked) return;
  title("Trend", known.folder);
  $("quantities").replaceChildren(...known.quantities.map((name) => { const o = element("option"); o.value = name; return o; }));
  choices($("procedure"), known.procedures, fields.procedure || "");
  choices($("rig"), known.rigs, fields.rig || "");
  choices($("machine"), MACHINES, fields.machine || "");
  $("quantity").value = fields.quantity || "";
  $("seed").value = fields.seed || "";
  if (!fields.quantity) return $("quantity").focus();
  const told = await get("trend", fields);
  if (mine !== asked) return;
  title(`Trend of ${quantityText(told.quantity)}`, `${told.procedure} on ${told.machine}`);
  $("drawing").src = `trend.svg?${new URLSearchParams(fields)}`;
  $("drawing").alt = `${told.quantity} over the runs; the table below says the same`;
  $("table").replaceChildren(...told.told.filter(([, said]) => said).map(([kind, said]) => {
    const node = element(kind === "rows" ? "pre" : "p", kind, said);
    if (kind === "rows") node.tabIndex = 0; // it scrolls where it is too wide
    return node;
  }));
  $("chart").hidden = $("table").hidden = false;
}

async function show() {
  wrong("");
  const { view, run, ...fields } = Object.fromEntries(new URLSearchParams(location.search));
  try {
    if (!token) throw new Error("This address lacks its token. Open the address that bench printed, with all that follows its #.");
    await (run ? showRun(run) : view === "trend" ? showTrend(fields) : showList());
  } catch (error) {
    wrong(error.message);
  }
}

function go(query) {
  history.pushState(null, "", query);
  scrollTo(0, 0);
  return show();
}

document.addEventListener("click", (event) => {
  const to = event.target.closest("a[href^='?']");
  if (!to || event.button || event.ctrlKey || event.metaKey || event.shiftKey || event.altKey) return;
  event.preventDefault();
  go(to.getAttribute("href"));
});
addEventListener("popstate", show);
$("ask").addEventListener("submit", (event) => {
  event.preventDefault();
  const fields = [...new FormData($("ask"))].filter(([, value]) => value.trim());
  go(`?${new URLSearchParams([["view", "trend"], ...fields])}`);
});
$("filter").addEventListener("submit", (event) => event.preventDefault());
let typed = 0;
$("words").addEventListener("input", () => {
  clearTimeout(typed);
  typed = setTimeout(show, TYPED_MS);
});
$("more").addEventListener("click", () => {
  shown *= MORE;
  show();
});
show();
