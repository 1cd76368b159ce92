// Numbers and words: display units, digits, times. Nothing here touches the document.

/** SI to the unit that people are told: {unit, factor, offset} with SI = shown * factor + offset. */
export function shownIn(thing) {
  const told = typeof thing.display_unit === "string";
  const unit = told ? thing.display_unit : thing.unit;
  return { unit: unit === "1" ? "" : pretty(unit), factor: told ? thing.factor || 1 : 1, offset: told ? thing.offset || 0 : 0 };
}

/** Units as they are printed: µm and °C, not um and degC. */
export function pretty(unit) {
  return unit.replace(/^u(?=[a-zA-Z])/, "µ").replace(/^degC$/, "°C").replace(/^deg$/, "°").replace(/\^2/g, "²").replace(/\^3/g, "³");
}

/** Decimals that resolve a thousandth of a span, 0 to 6. */
export function decimalsOf(span) {
  return span > 0 ? Math.min(6, Math.max(0, Math.ceil(-Math.log10(span / 1000)))) : 3;
}

export function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

/** A value and its expanded uncertainty as a report prints them: U to two digits, the value to the same place, very small
 * ones with a power of ten. */
export function withUncertainty(value, U) {
  if (typeof value !== "number") return ["–", "–"];
  if (!(U > 0) || !Number.isFinite(U)) return [Number(value.toPrecision(6)).toString().replace("-", "−"), "–"];
  const last = Number(U.toExponential(1).split("e")[1]) - 1;
  const power = last < -6 ? 3 * Math.floor(Math.log10(Math.max(Math.abs(value), U)) / 3) : 0;
  const told = (x) => {
    if (last > 0) return fixed(Math.round(x / 10 ** last) * 10 ** last, 0);
    return fixed(x / 10 ** power, power - last) + (power ? `·10${String(power).replace(/[-0-9]/g, (c) => SUPERSCRIPTS[c])}` : "");
  };
  return [told(value), told(U)];
}

/** 01:05, or 1:01:05 from an hour on. */
export function clock(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  const two = (n) => String(n).padStart(2, "0");
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return hours ? `${hours}:${two(minutes)}:${two(rest)}` : `${two(minutes)}:${two(rest)}`;
}

/** An age in words: 40 ms, 3.2 s, 75 s, 04:10. */
export function ageText(ms) {
  if (ms < 995) return `${Math.round(ms / 10) * 10} ms`;
  return ms < 9950 ? `${(ms / 1000).toFixed(1)} s` : ms < 99500 ? `${Math.round(ms / 1000)} s` : clock(ms / 1000);
}

/** `K@inboard` is K at the place inboard. */
export function quantityText(name) {
  const [quantity, ...where] = name.split("@");
  return where.length ? `${quantity} (${where.join("@")})` : quantity;
}
