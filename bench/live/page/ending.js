// How the run ends: STOP, and the outcome with its results.

import { element } from "./told.js";
import { quantityText, shownIn, withUncertainty } from "./text.js";

const $ = (id) => document.getElementById(id);
const UNSURE = "No connection: STOP may not get through. Stop at the terminal.";
const SAYS = "STOP ends the run and makes the machine safe.";
const ORDER = ["FAIL", "INDETERMINATE", "PASS"]; // then those that nothing judged
export const TONES = { PASS: "pass", DONE: "pass", FAIL: "fail", ERROR: "fail", ABORTED: "fail", INDETERMINATE: "open" };

/** The STOP button; `send()` posts. It can be pressed again until the run has taken it. */
export function stopView(send, changed) {
  let standing = SAYS; // what is said unless the connection is lost
  let linked = true;
  const says = (text, wrong) => {
    $("stoptext").textContent = text;
    $("stopsays").classList.toggle("wrong", wrong);
  };
  $("stop").addEventListener("click", async () => {
    says("STOP is being sent …", false);
    const { ok, status, reply } = await send();
    if (ok) {
      $("stop").disabled = true;
      $("stop").textContent = "STOPPING";
      standing = "The run has taken STOP: the machine is made safe, which may take as long as the rotor takes to slow down.";
      says(standing, false);
      changed();
    } else {
      const why = status ? `the run refused it (${status})${reply.error ? `: ${reply.error}` : ""}` : "nothing answers";
      says(`STOP did not get through: ${why}. Press it again, or Ctrl-C at the terminal.`, true);
    }
  });
  return {
    allow(may) {
      $("stop").hidden = $("noemergency").hidden = !may;
      $("stop").disabled = false;
      $("stop").textContent = "STOP";
      standing = may ? SAYS : "This page only watches: the run can be stopped at its terminal.";
      says(standing, false);
    },
    /** Whether there is a connection. */
    link(is) {
      if (is !== linked) says(is ? standing : UNSURE, !is);
      linked = is;
    },
    end() { $("stopbar").hidden = true; },
    begin() { $("stopbar").hidden = false; },
  };
}

function verdictOf({ verdict }) {
  return (verdict || "").toUpperCase();
}

/** A row of name, value, U, unit and verdict. */
export function resultRow(result) {
  const row = element("tr");
  const { unit, factor, offset } = shownIn(result);
  const size = (x) => (typeof x === "number" ? x / factor : null);
  const value = typeof result.value === "number" ? (result.value - offset) / factor : null;
  const [told, U] = withUncertainty(value, size(result.U));
  const verdict = verdictOf(result);
  const cells = [["", quantityText(result.name)], ["n", told], ["n", U], ["", unit],
    [`verdict ${TONES[verdict] || ""}`, verdict && verdict !== "NONE" ? verdict : "–"]];
  for (const [kind, text] of cells) {
    const cell = element("td", kind, text);
    row.append(cell);
  }
  return row;
}

export function showEnd(end) {
  $("ending").hidden = false;
  $("ending").className = `card ending ${TONES[end.outcome] || "open"}`;
  $("outcome").textContent = end.outcome;
  $("reason").textContent = [end.reason, `exit status ${end.status}`].filter(Boolean).join(" · ");
  const rank = (result) => ORDER.indexOf(verdictOf(result)) + 1 || ORDER.length;
  const results = (end.results || []).filter((r) => typeof r.value === "number").sort((a, b) => rank(a) - rank(b));
  const missing = (end.results || []).filter((r) => typeof r.value !== "number").map((r) => quantityText(r.name));
  $("results").hidden = !results.length;
  $("results").tBodies[0].replaceChildren(...results.map(resultRow));
  $("missing").hidden = !missing.length;
  $("missing").textContent = results.length ? `Not measured: ${missing.join(", ")}.` : "Nothing was measured.";
  $("report").hidden = !end.report && !end.folder;
  $("reportlink").hidden = !end.report;
  $("reportsave").hidden = true;
  if (end.report) $("reportlink").setAttribute("href", end.report);
  $("reportplace").textContent = end.folder ? `The run lies in ${end.folder}` : "";
  if (!$("bar").hasAttribute("value")) $("bar").hidden = true;
  $("ending").focus({ preventScroll: true });
}

/** The report as a file to keep, which this page holds for as long as it is open. */
export function offerReport(blob, name) {
  $("reportsave").href = URL.createObjectURL(blob);
  $("reportsave").download = `${name}.html`;
  $("reportsave").hidden = false;
}

/** The run's server has ended: nothing can be opened there any more. */
export function showGone() {
  $("reportlink").hidden = true;
}
