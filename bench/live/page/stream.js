// The one connection to the run: events down by a fetch stream, since EventSource cannot send the token; answers and STOP up.

const HEADER = "X-Levbench-Token";
const KEPT = "levbench-token";
const SILENT_MS = 12000; // the server gives a sign of life every 5 s
const FIRST_MS = 500;
const LONGEST_MS = 5000;
const POST_MS = 4000;

/** The token of the address that the run printed. It leaves the address bar (pictures of the screen, history), and a reload
 * finds it where the tab keeps it; where the browser keeps nothing, it stays in the address. */
export function takeToken() {
  const told = location.hash.slice(1);
  try {
    if (!told) return sessionStorage.getItem(KEPT) || "";
    sessionStorage.setItem(KEPT, told);
    history.replaceState(null, "", location.pathname + location.search);
  } catch {
    // storage is switched off
  }
  return told;
}

/** A function that takes pieces of an event stream, cut anywhere, and tells each event: told(name, data). */
export function eventParser(told) {
  let rest = "";
  let name = "";
  let data = [];
  const line = (text) => {
    if (text === "") {
      if (data.length) told(name || "message", data.join("\n"));
      name = "";
      data = [];
    } else if (!text.startsWith(":")) {
      const at = text.indexOf(":");
      const field = at < 0 ? text : text.slice(0, at);
      const value = at < 0 ? "" : text.slice(at + 1).replace(/^ /, "");
      if (field === "event") name = value;
      else if (field === "data") data.push(value);
    }
  };
  return (piece) => {
    const lines = (rest + piece).split("\n");
    rest = lines.pop();
    for (const text of lines) line(text.endsWith("\r") ? text.slice(0, -1) : text);
  };
}

/** What a reply says: an object of JSON, or a refusal's line of text as {error}. */
function read(text) {
  try {
    return JSON.parse(text) ?? {};
  } catch {
    return { error: text.slice(0, 300) };
  }
}

/** One reading of /events until it ends. Throws what fetch throws, and {status} where the server refuses. */
async function readOnce(token, heard, opened) {
  const stopper = new AbortController();
  let silent = setTimeout(() => stopper.abort(), SILENT_MS);
  try {
    const options = { headers: { [HEADER]: token }, cache: "no-store", signal: stopper.signal };
    const reply = await fetch("events", options);
    if (!reply.ok) throw { status: reply.status, text: read(await reply.text()).error };
    opened();
    const push = eventParser(heard);
    const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader();
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      clearTimeout(silent);
      silent = setTimeout(() => stopper.abort(), SILENT_MS);
      push(value);
    }
  } finally {
    clearTimeout(silent);
    stopper.abort();
  }
}

/** The report, which the run keeps serving for a while where it was asked for at once; null where there is none. */
export async function reportOf(token, path) {
  try {
    const reply = await fetch(path, { headers: { [HEADER]: token }, cache: "no-store" });
    return reply.ok ? await reply.blob() : null;
  } catch {
    return null;
  }
}

/** Keeps reading until `over()`, then tells `gone()`; tells `lost({inMs, why})` between two tries and `refused(why)` where no try can help.
 * Returns a function that forgets the pause and tries again at once. */
export function listen(token, { heard, opened, lost, refused, over, gone }) {
  let pause = FIRST_MS;
  let wake = () => {};
  const wait = (ms) => new Promise((done) => {
    const timer = setTimeout(done, ms);
    wake = () => { clearTimeout(timer); done(); };
  });
  const tell = (name, data) => { // what cannot be shown is left out, and the rest goes on
    try {
      heard(name, JSON.parse(data));
    } catch (error) {
      console.error(`event ${name}:`, error);
    }
  };
  (async () => {
    while (!over()) {
      let why = "the run closed the connection";
      try {
        await readOnce(token, tell, () => { pause = FIRST_MS; opened(); });
      } catch (error) {
        if (error.status === 401 || error.status === 403) return refused(error.text);
        why = error.status ? error.text || `the run answered ${error.status}` : "nothing comes from the run";
      }
      if (over()) break;
      lost({ inMs: pause, why });
      await wait(pause);
      pause = Math.min(LONGEST_MS, 2 * pause);
    }
    return gone();
  })();
  return () => { pause = FIRST_MS; wake(); };
}

/** POST as JSON: {ok, status, reply}. A reply that does not come within four seconds is a failure. */
export async function post(token, path, body) {
  try {
    const reply = await fetch(path, {
      method: "POST",
      headers: { [HEADER]: token, "Content-Type": "application/json" },
      body: JSON.stringify(body),
      cache: "no-store",
      signal: AbortSignal.timeout(POST_MS),
    });
    return { ok: reply.ok, status: reply.status, reply: read(await reply.text()) };
  } catch {
    return { ok: false, status: 0, reply: {} };
  }
}
