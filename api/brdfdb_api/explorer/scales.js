// Scales of f_r, linear or logarithmic, and the words that captions share.

import { steps } from "./chart.js";
import { closest, element, percent, short } from "./dom.js";
import { makesColour, nearest } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */

const [APART, SHORT] = [0.13, 5]; // share of a colour bar between its marks of so many letters
const FEW = 3; // numbers that a logarithmic axis has at least
const DECADES = 5; // of a logarithmic scale, below its largest value

/** Ends of an axis over some values: of a logarithmic one in decades, which moves less while one turns.
 * @param {number[]} values
 * @param {Pick<State, "scale">} state
 * @returns {[number, number]} */
export function span(values, { scale }) {
  const most = values.reduce((a, b) => Math.max(a, b), 0) || 1; // there may be too many to be arguments
  if (scale === "linear") return [0, most];
  const least = values.reduce((a, b) => (b > 0 ? Math.min(a, b) : a), most);
  const top = Math.ceil(Math.log10(most) + 1e-9);
  return [Math.max(Math.floor(Math.log10(least)), top - DECADES), top];
}

/** A function from values to a scale that begins at `bottom`.
 * @param {Pick<State, "scale">} state
 * @param {number} bottom
 * @returns {(value: number) => number} */
export const scaled =
  ({ scale }, bottom) =>
  (value) =>
    scale === "linear" ? value : Math.max(Math.log10(Math.max(value, 1e-300)), bottom);

/** Places on a scale and what to write there; of a logarithmic one less than a decade and a half long at 1, 2 and 5,
 *   too.
 * @param {[number, number]} range
 * @param {Pick<State, "scale">} state
 * @returns {[number, string][]} */
export function ticks([low, high], { scale }) {
  if (scale === "log") {
    const powers = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, i) => Math.floor(low) + i);
    const between = high - low > 3 ? [1] : [1, 2, 5];
    const all = powers.flatMap((power) => between.map((digit) => digit * 10 ** power));
    const inside = all.filter((value) => Math.log10(value) >= low - 1e-9 && Math.log10(value) <= high + 1e-9);
    const few = inside.length < FEW ? steps([10 ** low, 10 ** high], 6) : inside; // round numbers are closer together
    return few.map((value) => [Math.log10(value), short(Number(value.toPrecision(3))).replace("1 × ", "")]);
  }
  const rough = high / 4,
    power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5, 10].find((each) => each * power >= rough) ?? 10) * power;
  return Array.from({ length: Math.floor(high / step) + 1 }, (_, i) => [i * step, short(i * step)]);
}

/** Which of some theta_r are short of the horizon, where models have poles that no scale can show.
 * @param {number[]} theta_r */
export const shortOfHorizon = (theta_r) => theta_r.flatMap((theta, i) => (Math.abs(theta) <= 89 ? [i] : []));

/** The floor of the stated error [1/sr]: at a wavelength, of a luminance the largest; 0 where no error was measured.
 * @param {any} info
 * @param {number | null} nm */
export function floorOf(info, nm) {
  const floor = info.error?.floor ?? [0];
  if (floor.length === 1 || (nm === null && makesColour(info))) return Math.max(...floor);
  return floor[closest(info.wavelength_nm, nearest(info, nm))];
}

/** What a table is off as it states its error, (table - model) / max(model, floor); null where that is 0.
 * @param {number[]} table
 * @param {number[]} model
 * @param {number} floor */
export const relative = (table, model, floor) =>
  table.map((value, i) => {
    const by = Math.max(model[i], floor);
    return by > 0 ? (value - model[i]) / by : null;
  });

/** What that is relative to, in words. */
export const RELATIVE = "relative to the model, or to the floor of the error where that is larger";

// Colours of maps, from the least to the most
const VIRIDIS = [
  [68, 1, 84],
  [72, 40, 120],
  [62, 74, 137],
  [49, 104, 142],
  [38, 130, 142],
  [31, 158, 137],
  [53, 183, 121],
  [110, 206, 88],
  [181, 222, 43],
  [253, 231, 37],
];

/** Red, green and blue of a share of a scale of colours, shaded.
 * @param {number} share
 * @param {number} shaded
 * @param {number[][]} colours */
export function mapped(share, shaded = 1, colours = VIRIDIS) {
  const at = Math.min(Math.max(share, 0), 1) * (colours.length - 1),
    low = Math.min(Math.floor(at), colours.length - 2);
  return [0, 1, 2].map((i) =>
    Math.round(shaded * (colours[low][i] + (at - low) * (colours[low + 1][i] - colours[low][i]))),
  );
}

/** What colours mean: a bar with marks at shares of it.
 * @param {[number, string][]} marks */
export function colourBar(marks) {
  const stripe = element("div", { className: "stripe" });
  stripe.style.background = `linear-gradient(to right, ${VIRIDIS.map((each) => `rgb(${each})`)})`;
  const texts = [];
  let last = -1;
  for (const [share, text] of marks) {
    if (share - last < APART * Math.max(text.length / SHORT, 1)) continue;
    last = share;
    const mark = element("span", {}, text);
    mark.style.left = `${100 * share}%`;
    texts.push(mark);
  }
  return element("div", { className: "bar quiet" }, stripe, ...texts);
}

/** A sentence on a wavelength outside the visible range, which a sphere shows as grey.
 * @param {Series} of
 * @param {State} state */
export function unseenWords({ info }, { nm }) {
  if (info.wavelength_nm === null || (nm === null && makesColour(info))) return "";
  const at = nearest(info, nm);
  if (at >= 380 && at <= 780) return "";
  return ` It is grey, because ${at} nm is ${at > 780 ? "infrared" : "ultraviolet"}.`;
}

/** A sentence on specular parts.
 * @param {Series[]} series
 * @param {number[]} parts the specular reflectance of each, 0 for none */
export function specularWords(series, parts) {
  const words = series.flatMap(({ label }, i) =>
    parts[i] ? [series.length > 1 ? `${percent(parts[i])} (${label})` : percent(parts[i])] : [],
  );
  return words.length ? ` The spike is the specular part, which has no f_r: ${words.join(", ")} of the light.` : "";
}
