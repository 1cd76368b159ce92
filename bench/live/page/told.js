// What the run tells in words: state, progress, findings, log.

import { ageText, clock, fixed } from "./text.js";

const MOST_LINES = 300;
const LOUD = { error: 0, indeterminate: 1, note: 2 };
const $ = (id) => document.getElementById(id);

export function element(tag, kind, text) {
  const node = document.createElement(tag);
  if (kind) node.className = kind;
  if (text !== undefined) node.textContent = text;
  return node;
}

export function showHello(hello) {
  $("title").textContent = hello.title || hello.procedure;
  const facts = [hello.procedure, `rig ${hello.rig}`];
  if (hello.served && hello.simulated) facts.push("served simulator, in real time");
  if (hello.seed !== null && hello.seed !== undefined) facts.push(`seed ${hello.seed}`);
  if (hello.visit) facts.push(`visit ${hello.visit}`);
  $("which").textContent = [...facts, hello.run_id].filter(Boolean).join(" · ");
  $("simulated").hidden = !hello.simulated;
}

export function showSample({ state, fault, speed_rpm, t_s }) {
  $("state").textContent = state || "–";
  $("fault").textContent = fault || "–";
  $("fault").classList.toggle("wrong", Boolean(fault) && !/^(none|no[_ ]fault|ok|0)$/i.test(fault));
  const slow = Math.abs(speed_rpm) < 100;
  $("speed").textContent = typeof speed_rpm === "number" ? `${fixed(speed_rpm, slow ? 1 : 0)} r/min` : "–";
  $("time").textContent = Number.isFinite(t_s) ? clock(t_s) : "–";
}

/** How old the newest sample is; null before the first. */
export function showAge(ms, old) {
  $("age").textContent = ms === null ? "–" : ageText(ms);
  $("age").classList.toggle("wrong", old);
}

export function showProgress({ stage, step, done, total, left_s }) {
  $("stage").textContent = stage || "Running";
  $("step").textContent = step || "";
  const bar = $("bar");
  if (total) {
    bar.max = total;
    bar.value = Math.min(done, total);
  } else {
    bar.removeAttribute("value");
  }
  bar.hidden = false; // without a count it moves: something goes on
  $("count").textContent = total && done <= total ? `${done} of ${total} steps` : done ? `${done} steps` : "";
  $("left").textContent = typeof left_s === "number" ? `${clock(left_s)} left` : "";
}

/** Findings by effect, then in the order in which they came; one with the id of another takes its place (its count has grown). */
export function findingsView() {
  const told = new Map();
  const draw = () => {
    $("nofinding").hidden = told.size > 0;
    const sorted = [...told.values()].sort((a, b) => (LOUD[a.effect] ?? 2) - (LOUD[b.effect] ?? 2));
    $("findinglist").replaceChildren(...sorted.map(findingNode));
  };
  return {
    clear() { told.clear(); draw(); },
    add(finding) { told.set(finding.id ?? told.size, finding); draw(); },
  };
}

export function findingNode({ code, text, where, effect }) {
  const node = element("div", `finding ${effect in LOUD ? effect : "note"}`);
  node.append(element("p", "", text));
  const small = element("p", "small soft");
  small.append(element("code", "", code));
  const says = effect === "note" ? "note" : `affects the outcome: ${effect}`;
  small.append([where && ` · ${where}`, ` · ${says}`].filter(Boolean).join(""));
  node.append(small);
  return node;
}

/** The last lines of the log; it follows the newest one while nobody has scrolled up. */
export function logView() {
  const list = $("loglist");
  return {
    clear() { list.replaceChildren(); },
    add(text) {
      const follows = list.scrollHeight - list.scrollTop - list.clientHeight < 30;
      list.append(element("li", "", text));
      while (list.children.length > MOST_LINES) list.firstChild.remove();
      if (follows) list.scrollTop = list.scrollHeight;
    },
  };
}
