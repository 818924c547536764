// Numbers as the markdown reports write them (henon_ref/harness/table.py).

/** A number to so many significant places, without an exponent where that reads well. */
function significant(value, places = 3) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -3 || exponent >= 6) return exponential(value, places);
  return String(Number(value.toPrecision(places)));
}

const exponential = (value, places = 2) => value.toExponential(places - 1).replace("e+", "e");

/** A wall time in seconds, with a unit. */
function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 1e-4) return `${significant(seconds * 1e6)} µs`;
  return seconds < 1 ? `${significant(seconds * 1e3)} ms` : `${significant(seconds)} s`;
}

/** Digits, rounded down. */
const digitsText = (value) => (value === null || value === undefined ? "" : String(Math.floor(value * 10 + 1e-9) / 10));

/** An error; one below what can be claimed is not claimed. */
function errorText(value, floor = 0) {
  if (value === null || value === undefined) return "";
  if (Math.abs(value) < floor) return `< ${exponential(floor, 1)}`;
  return value === 0 ? "0" : exponential(value);
}

const count = (number, noun) => `${number || "no"} ${noun}${number === 1 ? "" : "s"}`;

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** A power of ten as text. */
function powerOfTen(exponent) {
  if (exponent === 0) return "1";
  const digits = [...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[digit]).join("");
  return `10${exponent < 0 ? "⁻" : ""}${digits}`;
}

/** A decade of time, in the unit in which it is said. */
function decadeOfTime(exponent) {
  if (exponent >= 0) return `${10 ** exponent} s`;
  if (exponent >= -3) return `${Math.round(10 ** (exponent + 3))} ms`;
  if (exponent >= -6) return `${Math.round(10 ** (exponent + 6))} µs`;
  return `${Math.round(10 ** (exponent + 9))} ns`;
}
