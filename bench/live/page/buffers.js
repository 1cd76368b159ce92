// What the plots show: min and max of each channel in buckets of time, for the last minutes. Nothing here touches the document.

const FINE = 12000; // buckets of 10 ms: two minutes
const COARSE = 12000; // buckets of 100 ms: twenty minutes
const COARSE_S = 0.1;

function bytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw.charCodeAt(k);
  return out;
}

/** Numbers of a base64 text, little-endian as they are sent. */
export const float64 = (text) => new Float64Array(bytes(text).buffer);
export const float32 = (text) => new Float32Array(bytes(text).buffer);

/** Rows in order of time; the oldest give way. Twice the room, so that a window is one slice. */
class Rows {
  constructor(names, kept) {
    this.kept = kept;
    this.n = 0;
    this.t = new Float64Array(2 * kept);
    this.low = new Map(names.map((name) => [name, new Float32Array(2 * kept)]));
    this.high = new Map(names.map((name) => [name, new Float32Array(2 * kept)]));
  }

  /** Index of a new row. */
  add(t) {
    if (this.n === this.t.length) {
      for (const column of [this.t, ...this.low.values(), ...this.high.values()]) column.copyWithin(0, this.kept);
      this.n = this.kept;
    }
    this.t[this.n] = t;
    return this.n++;
  }

  /** Least and greatest of a channel in a row: anew, or beside what is there; NaN is nothing. */
  put(name, row, low, high, anew) {
    const [lows, highs] = [this.low.get(name), this.high.get(name)];
    if (anew || !(lows[row] <= low)) lows[row] = anew || !Number.isNaN(low) ? low : lows[row];
    if (anew || !(highs[row] >= high)) highs[row] = anew || !Number.isNaN(high) ? high : highs[row];
  }

  /** First row at or after a time. */
  from(t) {
    let [a, b] = [0, this.n];
    while (a < b) {
      const middle = (a + b) >> 1;
      if (this.t[middle] < t) a = middle + 1;
      else b = middle;
    }
    return a;
  }
}

export class History {
  constructor(names) {
    this.names = names;
    this.fine = new Rows(names, FINE);
    this.coarse = new Rows(names, COARSE);
    this.last = -Infinity; // time of the newest row
    this.bucket = NaN;
  }

  /** Takes a block of `samples`. Its first bucket may be the last one of the block before, which was not full then; what is
   * older comes again after a reconnection, and is left out. */
  append(block) {
    const t = float64(block.t);
    const columns = this.names.map((name) => {
      const of = block.channels[name];
      return of ? [name, float32(of.min), float32(of.max)] : [name, null, null];
    });
    for (let k = 0; k < t.length; k++) {
      if (!(t[k] >= this.last)) continue;
      const again = t[k] === this.last;
      this.last = t[k];
      const row = again ? this.fine.n - 1 : this.fine.add(t[k]);
      const bucket = Math.floor(t[k] / COARSE_S + 1e-6);
      const begins = bucket !== this.bucket;
      this.bucket = bucket;
      const wide = begins ? this.coarse.add(t[k]) : this.coarse.n - 1;
      for (const [name, low, high] of columns) {
        const [a, b] = low ? [low[k], high[k]] : [NaN, NaN];
        this.fine.put(name, row, a, b, !again);
        this.coarse.put(name, wide, a, b, begins);
      }
    }
  }

  /** The last seconds as at most about `points` spans of rows: {x, spans, rows}. A span is null where nothing came between:
   * the line breaks there. */
  view(seconds, points, end = this.last) {
    const rows = seconds <= FINE / 100 ? this.fine : this.coarse;
    const step = Math.max(seconds / points, rows === this.fine ? 0 : COARSE_S);
    const gap = Math.max(0.25, 3 * step);
    const [x, spans] = [[], []];
    const stop = Number.isFinite(end) ? rows.from(end + 1e-9) : 0;
    let key = NaN;
    for (let k = rows.from(end - seconds); k < stop; k++) {
      const at = rows.t[k];
      if (x.length && at - rows.t[k - 1] > gap) {
        x.push((at + rows.t[k - 1]) / 2);
        spans.push(null);
        key = NaN;
      }
      const now = Math.floor(at / step);
      if (now === key && spans.length) {
        spans[spans.length - 1][1] = k + 1;
      } else {
        x.push(at);
        spans.push([k, k + 1]);
        key = now;
      }
    }
    return { x, spans, rows };
  }
}

/** Least and greatest of a channel over the spans of a view, in shown units: [low, high], null in gaps. */
export function bandOf({ spans, rows }, name, { factor, offset }) {
  const [lows, highs] = [rows.low.get(name), rows.high.get(name)];
  const [low, high] = [new Array(spans.length), new Array(spans.length)];
  for (let k = 0; k < spans.length; k++) {
    let [a, b] = [Infinity, -Infinity];
    if (spans[k]) {
      for (let row = spans[k][0]; row < spans[k][1]; row++) {
        if (lows[row] < a) a = lows[row];
        if (highs[row] > b) b = highs[row];
      }
    }
    low[k] = a <= b ? (a - offset) / factor : null;
    high[k] = a <= b ? (b - offset) / factor : null;
  }
  return [low, high];
}
