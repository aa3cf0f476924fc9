// What a picture shows, one or more series of values: of a table, of its model, or of a model with other parameters.

import { address, json, withQuery } from "./api.js";
import { check } from "./list.js";
import { changed, described, isModel } from "./parameters.js";
import { PICTURE_NM, subjectOf } from "./link.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./api.js").Question} Question */
/** @typedef {{ text: string, label: string, name: string, source: "table" | "model" | "parameters", info: any,
 *   recipe?: Record<string, any>, colour: string, dash: string }} Series recipe: the material of a model with
 *   parameters */

const DASHES = ["none", "6 5", "2 4", "9 4 2 4", "none", "6 5", "2 4", "9 4 2 4"];
const FEW_NM = [450, 500, 550, 600, 650]; // of curves at wavelengths

/** The series of a state.
 * @param {State} state
 * @param {AbortSignal} signal
 * @returns {Promise<Series[]>} */
export async function seriesOf(state, signal) {
  const texts = [
    state.material,
    ...state.compare.map((text) => (text.startsWith(":") ? ownModel(state.material, text) : text)),
  ];
  const found = await Promise.all(texts.map((text) => oneOf(text, signal)));
  return found.map((each, i) => ({ ...each, label: labelOf(each, found), colour: `series-${i + 1}`, dash: DASHES[i] }));
}

/** The model of a material, or of one with other parameters the material's table.
 * @param {string} material
 * @param {string} text */
const ownModel = (material, text) => subjectOf(material).base + (subjectOf(material).changes ? "" : text);

/** @param {string} text
 * @param {AbortSignal} signal
 * @returns {Promise<Series>} */
async function oneOf(text, signal) {
  const { base, model, changes } = subjectOf(text);
  const rest = { text, name: base, label: "", colour: "", dash: "" };
  if (!isModel(base)) await check(base);
  if (changes) return { ...rest, source: "parameters", ...(await described(base, changes)) };
  return { ...rest, source: model ? "model" : "table", info: await json(address(base), signal) };
}

/** Whether a picture is of a table and of its own model, whose difference is what the stated error is about.
 * @param {Series[]} series */
export const against = (series) =>
  series.length === 2 &&
  series[0].name === series[1].name &&
  series[0].source === "table" &&
  series[1].source === "model";

/** @param {Series} each
 * @param {Series[]} all */
function labelOf(each, all) {
  if (against(all)) return each.source;
  if (each.source === "parameters") return changed(each.info);
  return each.source === "model" ? `model of ${each.info.title}` : each.info.title;
}

/** A question about a series, at directions where there are some: angles [degrees], numbers or lists that broadcast.
 * @param {Series} each
 * @param {string} kind
 * @param {Record<string, unknown>} query
 * @param {Angles} [angles]
 * @returns {Question} */
export function question(each, kind, query = {}, angles = undefined) {
  const own = each.source === "parameters",
    { theta_i, phi_i, theta_r, phi_r, wavelength_nm, ...rest } = query;
  const held = angles ?? { theta_i, phi_i, theta_r, phi_r };
  const body =
    angles || (own && kind === "lookup")
      ? { ...held, wavelength_nm: wavelength_nm ?? (own ? (each.info.wavelength_nm ?? undefined) : undefined) }
      : undefined;
  if (own)
    return {
      path: withQuery(`v1/models/${each.info.model}/${kind}`, body ? rest : query),
      body: { ...each.recipe, ...body },
    };
  const from = each.source === "model" ? { from: "model" } : {};
  return { path: address(each.name, kind, { ...from, ...(body ? rest : query) }), body };
}

/** Whether any of them turns with phi_i.
 * @param {Series[]} series */
export const anisotropic = (series) => series.some(({ info }) => info.anisotropic);

/** Whether the wavelengths of a material make a colour, by the rule of the service.
 * @param {{ wavelength_nm: number[] | null }} info */
export function makesColour({ wavelength_nm: at }) {
  return (
    at !== null && at[0] <= 420 && at[at.length - 1] >= 680 && at.every((nm, i) => i === 0 || nm - at[i - 1] <= 20)
  );
}

/** The wavelength [nm] closest to one that is asked for, within those of a material; else its middle one.
 * @param {{ wavelength_nm: number[] }} info
 * @param {number | null} nm */
export function nearest({ wavelength_nm: at }, nm) {
  return nm === null ? at[at.length >> 1] : Math.min(Math.max(nm, at[0]), at[at.length - 1]);
}

/** The part of a query that makes values numbers: a colour, one wavelength, or what a grey material has.
 * @param {Series} each
 * @param {State} state
 * @param {string} colour
 * @returns {Record<string, unknown>} */
export function quantity({ info }, { nm, illuminant }, colour = "xyz") {
  if (info.wavelength_nm === null) return {}; // white under any illuminant
  if (nm === null && makesColour(info)) return { output: colour, illuminant, wavelength_nm: PICTURE_NM };
  return { wavelength_nm: nearest(info, nm) };
}

/** In words, what those numbers are.
 * @param {Series} each
 * @param {State} state */
export function quantityWords({ info }, { nm, illuminant }) {
  if (info.wavelength_nm === null) return "fᵣ";
  return nm === null && makesColour(info) ? `Luminance of fᵣ under ${illuminant}` : `fᵣ at ${nearest(info, nm)} nm`;
}

/** The azimuth of the light, where any of the series turns with it.
 * @param {State} state
 * @param {Series[]} series */
export const azimuth = ({ phi_i }, series) => (anisotropic(series) ? phi_i : undefined);

/** The question for f_r over the viewers of one light, of a view that the service knows.
 * @param {string} view
 * @param {Series} each
 * @param {State} state
 * @param {Series[]} series
 * @param {Record<string, unknown>} of */
export const lobe = (view, each, state, series, of = quantity(each, state)) =>
  question(each, "lobe", {
    view,
    theta_i: view === "half-difference" ? undefined : state.theta_i,
    phi_i: azimuth(state, series),
    ...of,
  });

/** A function that makes a number of what an answer holds at a point.
 * @param {{ output: string }} document
 * @returns {(value: any) => number} */
export const number = (document) => (document.output === "xyz" ? (value) => value[1] : (value) => value);

/** @typedef {{ theta_i: any, phi_i: any, theta_r: any, phi_r: any }} Angles */
/** @typedef {{ part: string, colour: string | null, pick: (value: any) => number }} Channel one curve of a series */

/** The query for the curves of a series and what they are: one, of red, green and blue, or at a few wavelengths.
 * @param {Series} each
 * @param {State} state
 * @returns {{ query: Record<string, unknown>, channels: Channel[] }} */
export function channelsOf(each, state) {
  const { info } = each,
    colourful = makesColour(info);
  if (state.curves === "rgb" && colourful) {
    const parts = ["red", "green", "blue"].map((part, i) => ({
      part,
      colour: `channel-${part}`,
      pick: (/** @type {any} */ value) => value[i],
    }));
    return { query: quantity(each, { ...state, nm: null }, "linear-srgb"), channels: parts };
  }
  if (state.curves === "wavelengths" && info.wavelength_nm?.length > 1) {
    const range = info.wavelength_nm,
      low = range[0],
      high = range[range.length - 1];
    const some = FEW_NM.filter((nm) => nm >= low && nm <= high);
    const at = some.length > 1 ? some : [low, high];
    return {
      query: { wavelength_nm: at },
      channels: at.map((nm, i) => ({ part: `${nm} nm`, colour: hue(nm), pick: (value) => value[i] })),
    };
  }
  const one = quantity(each, state);
  return {
    query: one,
    channels: [{ part: "", colour: null, pick: one.output === "xyz" ? (value) => value[1] : (value) => value }],
  };
}

/** The name of a colour for a wavelength.
 * @param {number} nm */
const hue = (nm) => `hue-${FEW_NM.reduce((best, each) => (Math.abs(each - nm) < Math.abs(best - nm) ? each : best))}`;
