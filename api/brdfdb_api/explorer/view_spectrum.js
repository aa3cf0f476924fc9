// The view of f_r over wavelengths at one pair of directions.

import { chart, steps, valueAt } from "./chart.js";
import { ink, short } from "./dom.js";
import { scaled, ticks } from "./scales.js";
import { azimuth, question } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */

const LEAST_DECADES = 0.2; // of the logarithmic axis of a spectrum: a factor of 1.6

/** @type {import("./main.js").View} */
export default {
  name: "spectrum",
  title: "Spectrum",
  order: 4,
  idle: ["nm", "colour", "illuminant"],
  also: ["theta_r", "turn"],
  request(each, state, series) {
    const phi_i = azimuth(state, series),
      phi_r = ((phi_i ?? 0) + state.turn) % 360;
    const of = each.source === "table" && each.info.error ? { error: true } : {};
    return question(each, "lookup", { theta_i: state.theta_i, phi_i, theta_r: state.theta_r, phi_r, ...of });
  },
  draw: spectrum,
};

/** Ends of the axis of a spectrum, in decades of a logarithmic one, wide enough that rounding is no picture.
 * @param {number[]} values
 * @param {State} state
 * @returns {[number, number]} */
function ends(values, { scale }) {
  const some = values.filter((value) => value > 0),
    most = Math.max(...some),
    least = Math.min(...some);
  if (!some.length) return scale === "log" ? [-1, 0] : [0, 1];
  if (scale === "linear") return [0, 1.08 * most];
  const middle = Math.log10(most * least) / 2,
    half = Math.max(Math.log10(most / least) * 0.54, LEAST_DECADES / 2);
  return [middle - half, middle + half];
}

/** @param {HTMLElement} into
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
function spectrum(into, series, answers, state) {
  const spectra = answers
    .filter(({ wavelength_nm }) => wavelength_nm !== null)
    .flatMap(({ wavelength_nm }) => wavelength_nm);
  const [low, high] = [Math.min(...spectra, 780), Math.max(...spectra, 380)];
  /** @type {[number, number]} */
  const across = spectra.length && low < high ? [low, high] : spectra.length ? [low - 50, low + 50] : [380, 780];
  const curves = answers.map((answer, i) => {
    const grey = answer.wavelength_nm === null,
      all = (/** @type {any} */ value) => (grey ? [value, value] : value);
    const x = grey ? across : answer.wavelength_nm,
      y = all(answer.brdf),
      error = answer.error && all(answer.error);
    const curve = { x, y, label: series[i].label, colour: ink(series[i].colour), dash: series[i].dash };
    const off = (/** @type {number} */ sign) =>
      y.map((/** @type {number} */ value, /** @type {number} */ j) => Math.max(value + sign * (error[j] ?? 0), 1e-300));
    return error ? { ...curve, low: off(-1), high: off(1) } : curve;
  });
  const range = ends(
    curves.flatMap(({ y }) => y),
    state,
  );
  const marked =
    state.scale === "log"
      ? ticks(range, state)
      : steps(range, 6).map((at) => /** @type {[number, string]} */ ([at, short(at)]));
  const up = { title: "fᵣ [1/sr]", range, ticks: marked, height: scaled(state, range[0] - 1) };
  chart(
    into,
    curves,
    { title: "wavelength [nm]", range: across },
    up,
    (nm) => `${Math.round(nm)} nm: ${curves.map((curve) => valueAt(curve, nm, " /sr")).join(", ")}`,
  );
  const words = answers.map((answer, i) =>
    answer.wavelength_nm === null && answer.brdf !== undefined
      ? ` ${series[i].label} is grey: ${short(answer.brdf)} /sr${answer.error ? ` ± ${short(answer.error)}` : ""} at every wavelength.`
      : "",
  );
  const band = answers.some(({ error }) => error) ? ", with the band of the error that 99 of 100 values of the table stay within" : "";
  return `fᵣ at one pair of directions${band}.${words.join("")}`;
}
