// Parameters that move: sliders of a model with the published materials as marks, and what they make as a recipe.

import { address, json } from "./api.js";
import { copyText } from "./copy.js";
import { byId, element, short } from "./dom.js";
import { changedText, subjectOf } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {{ name: string, unit: string, low: number | null, high: number | null, meaning: string, typical: number }} Parameter */
/** @typedef {{ name: string, title: string, parameters: Record<string, any> }} Mark a published material of a model */
/** @typedef {{ at: (share: number) => number, share: (value: number) => number, step: number }} Track the values of a slider */

const panel = byId("parameters", HTMLElement);
const BEYOND = 3; // factor by which sliders go beyond what is published, where a parameter has no end of its own
const DECADES = 30; // ratio of published values from which on a slider is logarithmic

/** @type {Map<string, Promise<any>>} */
const documents = new Map(); // what the service says of models and of materials that they begin with, which stays
let shown = ""; // whose sliders there are

/** @param {string} path
 * @returns {Promise<any>} */
function known(path) {
  const found = documents.get(path) ?? json(path);
  documents.set(path, found);
  found.catch(() => documents.delete(path));
  return found;
}

const modelOf = (/** @type {string} */ name) => known(`v1/models/${encodeURIComponent(name)}`);

/** What is known of a material with other parameters, and its recipe.
 * @param {string} base
 * @param {Record<string, number>} changes
 * @returns {Promise<{ info: any, recipe: Record<string, any> }>} */
export async function described(base, changes) {
  const material = await known(address(base)), model = await modelOf(material.model);
  const recipe = recipeOf(material, model, changes);
  const info = {
    ...material, error: null, audit: null, measured: null, changes, base: material, model_title: model.title,
    title: `${material.title}, changed`, attributes: {}, parameters: [],
  };
  return { info, recipe };
}

/** The recipe of a material with other parameters.
 * @param {any} material
 * @param {any} model
 * @param {Record<string, number>} changes */
function recipeOf(material, model, changes) {
  const mark = model.materials.find((/** @type {Mark} */ each) => each.name === material.name);
  const { name: _, title: __, parameters, ...rest } = mark;
  return { ...rest, parameters: { ...parameters, ...changes } };
}

/** What differs from the material, in words.
 * @param {any} info */
export const changed = ({ base, changes }) =>
  `${base.title}, ${Object.entries(changes).map(([name, value]) => `${name} ${short(value)}`).join(", ")}`;

/** No sliders. */
export function forget() {
  panel.hidden = true;
  shown = "";
}

/** Show the sliders of a series: of a measured table there are none.
 * @param {Series} series */
export async function show({ info, name, source }) {
  if (!info.model || info.measured) return forget();
  const model = await modelOf(info.model).catch(() => null), mark = model?.materials.find((/** @type {Mark} */ each) => each.name === name);
  if (!mark) return forget();
  const values = { ...mark.parameters, ...(source === "parameters" ? info.changes : {}) };
  if (shown !== name) build(model, mark, name);
  panel.hidden = false;
  for (const input of panel.querySelectorAll("input")) {
    const { at, share } = tracks[input.name], out = panel.querySelector(`output[name="${input.name}"]`);
    if (document.activeElement !== input || Math.abs(at(Number(input.value)) - values[input.name]) > 1e-6 * Math.abs(values[input.name])) {
      input.value = String(share(values[input.name]));
    }
    const unit = input.dataset.unit ?? "", text = `${short(values[input.name])}${unit}`;
    input.setAttribute("aria-valuetext", text);
    if (out) out.textContent = text;
  }
  return undefined;
}

/** @type {Record<string, Track>} */
let tracks = {};

/** Make the sliders of a model.
 * @param {any} model
 * @param {Mark} mark
 * @param {string} name */
function build(model, mark, name) {
  shown = name;
  tracks = {};
  const numbers = model.parameters.filter((/** @type {Parameter} */ each) => typeof mark.parameters[each.name] === "number");
  const sliders = numbers.map((/** @type {Parameter} */ parameter) => {
    const { name: key, unit, meaning } = parameter, others = published(model, key), track = trackOf(parameter, others.map(({ value }) => value));
    tracks[key] = track;
    const input = element("input", { type: "range", name: key, min: "0", max: "1", step: String(track.step) });
    input.dataset.unit = ["1", ""].includes(unit) ? "" : ` ${unit === "degree" ? "°" : unit}`;
    const output = element("output", { className: "said" });
    output.setAttribute("name", key);
    const marks = element("span", { className: "track" }, ...others.map(({ value, titles }) => {
      const made = element("button", { type: "button", tabIndex: -1, title: `${short(value)}: ${titles.join("; ")}` });
      made.style.left = `${100 * track.share(value)}%`;
      Object.assign(made.dataset, { key, value });
      made.setAttribute("aria-hidden", "true"); // the choice of a published material has the same by keys
      return made;
    }));
    return element("div", {}, element("label", { title: meaning }, key, " ", output, input), marks);
  });
  const choice = element("select", { id: "published" }, new Option("published materials …", ""),
    ...model.materials.map((/** @type {Mark} */ each) => new Option(each.title, each.name)));
  choice.setAttribute("aria-label", "Take the parameters of a published material");
  const buttons = [["reset", "As published"], ["keep", "Keep beside"], ["recipe", "Copy as recipe"]].map(([action, text]) => {
    const made = element("button", { type: "button" }, text);
    made.dataset.action = action;
    return made;
  });
  panel.replaceChildren(element("h3", {}, `Parameters of ${model.title}`), ...sliders, element("div", { className: "buttons" }, choice, ...buttons));
}

/** The published values of a parameter, and of which materials each is.
 * @param {any} model
 * @param {string} key
 * @returns {{ value: number, titles: string[] }[]} */
function published(model, key) {
  /** @type {Map<number, string[]>} */
  const found = new Map();
  for (const { parameters, title } of model.materials) {
    if (typeof parameters[key] === "number") found.set(parameters[key], [...(found.get(parameters[key]) ?? []), title]);
  }
  return [...found].map(([value, titles]) => ({ value, titles })).sort((a, b) => a.value - b.value);
}

/** The values of a slider: between the ends of a parameter, or around what is published; logarithmic over decades.
 * @param {Parameter} parameter
 * @param {number[]} values
 * @returns {Track} */
function trackOf({ low, high, typical }, values) {
  const some = [...values, typical].filter((value) => value !== null && Number.isFinite(value)), most = Math.max(...some, 1e-9);
  const positive = some.filter((value) => value > 0), least = Math.min(...positive, most);
  const bounded = high !== null && high <= 1000 && high / most < DECADES, end = bounded ? high : Math.min(BEYOND * most, high ?? Infinity);
  if (positive.length && (end / least > DECADES || !bounded) && (low ?? 0) >= 0) {
    const [from, to] = [Math.log10(Math.max(least / BEYOND, low || 1e-12)), Math.log10(end)];
    return {
      at: (share) => Number((share <= 0 && low === 0 ? 0 : 10 ** (from + share * (to - from))).toPrecision(4)),
      share: (value) => (value > 0 ? Math.min(Math.max((Math.log10(value) - from) / (to - from), 0), 1) : 0), step: 0.0025,
    };
  }
  const from = low !== null && Number.isFinite(low) ? low : -end;
  return {
    at: (share) => Number((from + share * (end - from)).toPrecision(4)),
    share: (value) => Math.min(Math.max((value - from) / (end - from), 0), 1), step: 0.0025,
  };
}

/** Make sliders, marks and buttons work.
 * @param {(part: Partial<State>) => void} choose
 * @param {() => State} now
 * @param {() => Series} first
 * @param {(sentence: string, tone: string) => void} say */
export function listen(choose, now, first, say) {
  const move = (/** @type {string} */ key, /** @type {number} */ value) => {
    const { base, changes } = subjectOf(now().material);
    choose({ material: changedText(base, { ...changes, [key]: value }) });
  };
  panel.addEventListener("input", ({ target }) => {
    if (target instanceof HTMLInputElement) move(target.name, tracks[target.name].at(Number(target.value)));
    else if (target instanceof HTMLSelectElement && target.value) choose({ material: target.value });
  });
  panel.addEventListener("click", ({ target }) => {
    const { key, value, action } = target instanceof HTMLElement ? target.dataset : {}, { material, compare } = now();
    if (key) move(key, Number(value));
    if (action === "reset") choose({ material: subjectOf(material).base });
    if (action === "keep" && !compare.includes(material)) choose({ compare: [...compare, material] });
    if (action === "recipe") described(subjectOf(material).base, subjectOf(material).changes ?? {}).then(({ recipe }) => copyText(written(recipe, first()), say));
  });
}

/** A recipe of one material, as `brdfdb build` reads it.
 * @param {Record<string, any>} recipe
 * @param {Series} series */
function written({ parameters, wavelengths_nm, ...rest }, { info, name }) {
  const slug = `my-${name}`, toml = (/** @type {unknown} */ value) => (typeof value === "object" && value !== null && !Array.isArray(value)
    ? `{ ${Object.entries(value).map(([key, each]) => `${key} = ${JSON.stringify(each)}`).join(", ")} }` : JSON.stringify(value));
  const lines = (/** @type {Record<string, unknown>} */ of) => Object.entries(of).flatMap(([key, value]) =>
    (value === null || value === undefined ? [] : [`${key} = ${toml(value)}`]));
  const at = wavelengths_nm ?? info.wavelength_nm;
  return [
    `title = ${JSON.stringify(info.title)}`, `materials = ["${slug}"]`, ...(at ? [`wavelengths_nm = ${JSON.stringify(at)}`] : []), "tolerance = 0.01", "",
    `[define.${slug}]`, ...lines({ title: info.title, source: `parameters of one's own, from ${name}`, model: info.model, ...rest }), "",
    `[define.${slug}.parameters]`, ...lines(parameters), "",
  ].join("\n");
}
