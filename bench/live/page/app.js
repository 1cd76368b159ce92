// The live page of a run: what the stream says, handed to the views; how old it is, said at all times.

import { History, float32 } from "./buffers.js";
import { offerReport, showEnd, showGone, stopView } from "./ending.js";
import { orbitOf } from "./orbits.js";
import { picturesView } from "./pictures.js";
import { keepName, promptView, who } from "./prompt.js";
import { listen, post, reportOf, takeToken } from "./stream.js";
import { findingsView, logView, showAge, showHello, showProgress, showSample } from "./told.js";
import { ageText } from "./text.js";

const OLD_MS = 1000; // data older than this are shown as old
const TICK_MS = 200;
const $ = (id) => document.getElementById(id);

const run = { token: takeToken(), hello: null, ended: null, asked: false, stopping: false, link: "connecting", why: "", retryAt: 0, retry: () => {} };
const newest = { receivedAt: null, ageThen: 0, lost: 0, told: null, t_s: NaN };
const clockDifference = { least: Infinity }; // least of received - sent, ms: what is over it is delay on the way

const findings = findingsView();
const log = logView();
const pictures = picturesView(orbitOf);
const stop = stopView(() => post(run.token, "stop", { by: who() }), () => { run.stopping = true; showLink(); });
const prompt = promptView((id, answer) => post(run.token, "answer", { id, answer, by: who() }), (open) => { run.asked = open; showTitle(); });

const heard = {
  hello(hello) {
    if (run.hello?.run_id !== hello.run_id) {
      Object.assign(newest, { receivedAt: null, ageThen: 0, lost: 0, told: null, t_s: NaN });
      pictures.begin(hello, new History(hello.channels.map((c) => c.name)));
      stop.begin();
      stop.allow(hello.may_stop !== false);
      run.stopping = false;
      $("ending").hidden = true;
    }
    run.hello = hello;
    findings.clear();
    log.clear();
    prompt.heardHello();
    document.body.classList.add("told");
    showHello(hello);
    showTitle();
  },
  samples(block) {
    if (!run.hello) return;
    const now = Date.now();
    const onTheWay = typeof block.sent_ms === "number" ? now - block.sent_ms : 0;
    clockDifference.least = Math.min(clockDifference.least, onTheWay);
    newest.receivedAt = now;
    newest.ageThen = block.age_ms + onTheWay - clockDifference.least;
    newest.lost += block.lost || 0;
    pictures.take(block, float32);
    newest.t_s = pictures.newestTime();
    newest.told = { state: block.state, fault: block.fault, speed_rpm: block.speed_rpm, t_s: newest.t_s };
    pictures.draw(newest.lost, () => document.dispatchEvent(new CustomEvent("drawn", { detail: { sent_ms: block.sent_ms, age_ms: block.age_ms } })));
  },
  progress: showProgress,
  finding: findings.add,
  log: ({ text }) => log.add(text),
  prompt: prompt.show,
  answered: prompt.answered,
  end(end) {
    run.ended = end;
    prompt.close();
    stop.end();
    showEnd(end);
    if (end.report) keepReport(end);
    showLink();
    showTitle();
  },
};

/** Asks for the report at once: the run stays a while for who did. */
async function keepReport(end) {
  const blob = await reportOf(run.token, end.report);
  if (blob && run.ended === end) offerReport(blob, run.hello?.run_id || "report");
}

/** Age of the newest sample, ms: when it was sent, the way, and since then; null before the first. */
function age() {
  return newest.receivedAt === null ? null : newest.ageThen + Date.now() - newest.receivedAt;
}

function showTitle() {
  const what = run.hello ? `${run.hello.procedure} on ${run.hello.rig}` : "Levbench";
  document.title = run.ended ? `${run.ended.outcome} · ${what}` : run.asked ? `? ${what}` : what;
}

/** The line under the top: what the page hears, in words, and since when it hears nothing. */
function showLink() {
  const ms = age();
  const stands = run.hello && !run.ended && (run.link !== "live" || (ms !== null && ms > OLD_MS));
  const seconds = Math.max(0, Math.ceil((run.retryAt - Date.now()) / 1000));
  const since = ms === null ? "" : ` The newest data are ${ageText(ms)} old.`;
  const texts = {
    connecting: "Connecting to the run …",
    live: !run.hello ? "Connected. The run has not begun yet." : run.stopping ? "STOP was taken: the machine is made safe." : "",
    lost: `Connection lost: ${run.why}.${since} What is shown may be out of date. Trying again ${seconds ? `in ${seconds} s` : "now"}.`,
    refused: `The run refuses this page: ${run.why || "its token is missing or another run's"}. Open the address that the run printed.`,
  };
  const state = run.ended ? "ended" : run.link;
  document.body.dataset.link = state === "live" && run.stopping ? "stopping" : state;
  const text = run.ended ? "" : texts[run.link];
  if ($("link").textContent !== text) $("link").textContent = text;
  $("link").hidden = !text;
  document.body.classList.toggle("stale", Boolean(stands));
  stop.link(!run.hello || run.link === "live");
  $("old").hidden = !stands;
  const waits = run.asked && run.hello?.backend === "sim" && run.link === "live"; // its clock goes on with the answer
  $("old").textContent = ms === null ? "No data yet."
    : waits ? `The simulation waits for the answer: the plots stand still, their data are ${ageText(ms)} old.`
    : `No new data for ${ageText(ms)}: the plots stand still.`;
  if (newest.told) showSample(newest.told);
  if (!run.ended) showAge(ms, Boolean(stands));
  $("age").closest("div").hidden = Boolean(run.ended);
}

function start() {
  run.link = run.token ? "connecting" : "refused";
  run.why = run.token ? "" : "this address has no token";
  if (!run.token) return showLink();
  const mine = run.token;
  run.retry = listen(run.token, {
    heard: (name, data) => { if (mine === run.token) heard[name]?.(data); },
    opened: () => { run.link = "live"; clockDifference.least = Infinity; showLink(); },
    lost: ({ inMs, why }) => { Object.assign(run, { link: "lost", why, retryAt: Date.now() + inMs }); showLink(); },
    refused: (why) => { Object.assign(run, { link: "refused", why }); showLink(); },
    gone: () => { if (mine === run.token) showGone(); },
    over: () => run.ended !== null || mine !== run.token,
  });
  return showLink();
}

keepName();
start();
setInterval(showLink, TICK_MS);
addEventListener("online", () => run.retry());
addEventListener("hashchange", () => { // another run's address in the same tab
  const token = takeToken();
  if (!token || token === run.token) return;
  Object.assign(run, { token, hello: null, ended: null, stopping: false });
  start();
});
