// Scales of f_r, linear or logarithmic, and the words that captions share.

import { short } from "./dom.js";
import { makesColour, nearest, number } from "./series.js";

const DECADES = 5; // of a logarithmic scale, below its largest value

/** Ends of an axis over some values: of a logarithmic one in decades, which moves less while one turns. */
export function span(values, { scale }) {
  const most = values.reduce((a, b) => Math.max(a, b), 0) || 1; // there may be too many to be arguments
  if (scale === "linear") return [0, most];
  const least = values.reduce((a, b) => (b > 0 ? Math.min(a, b) : a), most);
  const top = Math.ceil(Math.log10(most) + 1e-9);
  return [Math.max(Math.floor(Math.log10(least)), top - DECADES), top];
}

/** A function from values to a scale that begins at `bottom`. */
export const scaled = ({ scale }, bottom) => (value) =>
  scale === "linear" ? value : Math.max(Math.log10(Math.max(value, 1e-300)), bottom);

/** Places on a scale and what to write there. */
export function ticks([low, high], { scale }) {
  if (scale === "log") {
    return Array.from({ length: high - low + 1 }, (_, i) => [low + i, short(10 ** (low + i)).replace("1 × ", "")]);
  }
  const rough = high / 4, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((each) => each * power >= rough) * power;
  return Array.from({ length: Math.floor(high / step) + 1 }, (_, i) => [i * step, short(i * step)]);
}

/** Which of some theta_r are short of the horizon, where models have poles that no scale can show. */
export const shortOfHorizon = (theta_r) => theta_r.flatMap((theta, i) => (Math.abs(theta) <= 89 ? [i] : []));

/** The floor of the stated error [1/sr]: at a wavelength, of a luminance the largest; 0 where no error was measured. */
export function floorOf(info, nm) {
  const at = info.wavelength_nm, floor = info.error?.floor ?? [0];
  if (floor.length === 1 || (nm === null && makesColour(info))) return Math.max(...floor);
  const asked = nearest(info, nm);
  return floor[at.reduce((best, each, i) => (Math.abs(each - asked) < Math.abs(at[best] - asked) ? i : best), 0)];
}

/** What a table is off as it states its error, (table - model) / max(model, floor); null where that is 0. */
export const relative = (table, model, floor) => table.map((value, i) => {
  const by = Math.max(model[i], floor);
  return by > 0 ? (value - model[i]) / by : null;
});

/** What that is relative to, in words. */
export const RELATIVE = "relative to the model, or to the floor of the error where that is larger";

/** A sentence on what no eye sees: one wavelength out of the visible, which a sphere shows as grey. */
export function unseenWords({ info }, { nm }) {
  if (info.wavelength_nm === null || (nm === null && makesColour(info))) return "";
  const at = nearest(info, nm);
  if (at >= 380 && at <= 780) return "";
  return ` It is grey for what no eye sees: ${at} nm is ${at > 780 ? "infrared" : "ultraviolet"}.`;
}

/** A sentence on specular parts. */
export function mirrorWords(series, answers) {
  const parts = answers.map((answer) => answer.specular_reflectance && number(answer)(answer.specular_reflectance));
  const said = series.flatMap(({ label }, i) => (parts[i] ? [series.length > 1 ? `${short(parts[i])} (${label})` : short(parts[i])] : []));
  return said.length ? ` Not drawn is the mirror image, a specular part: ${said.join(", ")} of the light.` : "";
}
