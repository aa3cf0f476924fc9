// Sliders for the parameters of a model, with published values as marks, and their values as a recipe.

import { address, json } from "./api.js";
import { copyText } from "./copy.js";
import { byId, closest, element, short } from "./dom.js";
import { check } from "./list.js";
import { PICTURE_NM, changedText, subjectOf } from "./link.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {{ name: string, unit: string, low: number, high: number, meaning: string, default: number | boolean |
 *   null,
 *   typical: [number, number] | null, published: { material: string, value: number }[] }} Parameter */
/** @typedef {{ at: (share: number) => number, share: (value: number) => number }} Track value at a place, and back */

const panel = byId("parameters", HTMLElement);
const BEYOND = 3; // factor beyond the published values that a slider reaches, within the limits of the parameter
const DECADES = 30; // ratio of published values above which a slider is logarithmic

/** Whether a base is a model, and no material.
 * @param {string} base */
export const isModel = (base) => base.startsWith(OF_MODEL);

const OF_MODEL = "*"; // before the name of a model: a material with typical parameters
const [N, K] = ["n", "k"];
const GREEN_NM = 550; // wavelength of n and k if a picture has all wavelengths [nm]
/** @type {Parameter[]} */
const INDEX = [
  { name: N, unit: "1", low: 0.05, high: 4, meaning: "refractive index", default: 1.5, typical: null, published: [] },
  { name: K, unit: "1", low: 0, high: 8, meaning: "extinction coefficient", default: 0, typical: null, published: [] },
];

/** @type {Map<string, Promise<any>>} */
const documents = new Map(); // of models and of the materials of the sliders, by path
let shown = ""; // name of the material of the sliders
let calls = 0; // number of calls of show and forget; only the last call has an effect

/** @param {string} path
 * @returns {Promise<any>} */
function known(path) {
  const found = documents.get(path) ?? json(path);
  documents.set(path, found);
  found.catch(() => documents.delete(path));
  return found;
}

const modelOf = (/** @type {string} */ name) => known(`v1/models/${encodeURIComponent(name)}`);

/** The material of a base; a model is a material with typical parameters.
 * @param {string} base
 * @returns {Promise<{ material: any, model: any }>} */
async function begun(base) {
  if (!isModel(base)) {
    await check(base);
    const material = await known(address(base));
    return { material, model: await modelOf(material.model) };
  }
  const model = await modelOf(base.slice(1));
  const parameters = model.parameters.map((/** @type {Parameter} */ each) => ({
    name: each.name,
    value: typical(each),
  }));
  const material = {
    name: base,
    title: model.title,
    model: model.name,
    parameters,
    anisotropic: turned(model),
    wavelength_nm: model.spectral ? PICTURE_NM : null,
    specular: model.specular,
    attributes: { source: model.paper, refractive_index: model.spectral ? "constant/1.5/0" : "" },
  };
  return { material, model };
}

/** Whether a model is anisotropic: it has parameters along x and y.
 * @param {any} model */
const turned = (model) => model.parameters.some((/** @type {Parameter} */ { name }) => /_x(_|$)/.test(name));

/** A value to begin with.
 * @param {Parameter} parameter */
function typical({ default: given, typical: ends, low, high }) {
  if (given !== null) return given;
  return ends ? Number(((ends[0] + ends[1]) / 2).toPrecision(3)) : Math.min(Math.max(0.3, low), high);
}

/** The document of a material with other parameters, and its recipe.
 * @param {string} base
 * @param {Record<string, number>} changes
 * @returns {Promise<{ info: any, recipe: Record<string, any> }>} */
export async function described(base, changes) {
  const { material, model } = await begun(base),
    { [N]: n, [K]: k, ...moved } = changes;
  const parameters = {
    ...Object.fromEntries(material.parameters.map((/** @type {any} */ { name, value }) => [name, value])),
    ...moved,
  };
  const own = indexOf(material, null);
  const index =
    n === undefined && k === undefined
      ? material.attributes.refractive_index
      : `constant/${n ?? own.n}/${k ?? own.k}`;
  const info = {
    ...material,
    error: null,
    audit: null,
    measured: null,
    parameters: [],
    changes,
    base: material,
    model_title: model.title,
    title: isModel(base) ? material.title : `${material.title}, changed`,
  };
  return { info, recipe: { parameters, ...(model.spectral && { refractive_index: index }) } };
}

/** The changed parameters in words.
 * @param {any} info */
export const changed = ({ base, changes }) =>
  [base.title, ...Object.entries(changes).map(([name, value]) => `${name} ${short(value)}`)].join(", ");

/** No sliders. */
export function forget() {
  calls += 1;
  panel.hidden = true;
  shown = "";
}

/** Show the sliders of a series; measured data have none.
 * @param {Series} series
 * @param {State} state */
export async function show({ info, name, source }, { nm }) {
  if (source === "table") documents.set(address(name), Promise.resolve(info));
  calls += 1;
  const call = calls,
    changes = source === "parameters" ? info.changes : {},
    found = info.model && !info.measured ? await begun(name).catch(() => null) : null;
  const made = found && (await described(name, changes));
  if (call !== calls) return undefined;
  if (!found || !made) return forget();
  const { recipe } = made,
    index = indexOf(N in changes || K in changes ? { attributes: recipe } : found.material, nm);
  /** @type {Record<string, any>} */
  const values = { ...recipe.parameters, [N]: index.n, [K]: index.k };
  if (shown !== name) build(found.model, values, name);
  panel.hidden = false;
  for (const input of panel.querySelectorAll("input")) {
    const { at, share } = tracks[input.name],
      value = values[input.name],
      unit = input.dataset.unit ?? "";
    if (at(Number(input.value)) !== value) input.value = String(share(value));
    const where = [N, K].includes(input.name) ? index.where : "",
      text = `${short(value)}${unit}${where}`;
    input.setAttribute("aria-valuetext", text);
    const said = input.closest("label")?.querySelector(".said");
    if (said) said.textContent = text;
  }
  return undefined;
}

/** n and k of a material, and their wavelength; a constant index has none.
 * @param {{ attributes: any, n?: number[], k?: number[], wavelength_nm?: number[] }} material
 * @param {number | null} nm
 * @returns {{ n: number, k: number, where: string }} */
function indexOf({ attributes, n, k, wavelength_nm: at }, nm) {
  const [kind, ...constants] = (attributes.refractive_index ?? "").split("/");
  if (kind === "constant") return { n: Number(constants[0]), k: Number(constants[1]), where: "" };
  if (!n || !k || !at) return { n: 1.5, k: 0, where: "" };
  const i = closest(at, nm ?? GREEN_NM);
  const [there, lost] = [n[i], k[i]].map((value) => Number(value.toPrecision(4)));
  return { n: there, k: lost, where: at.length > 1 ? ` at ${at[i]} nm` : "" };
}

/** @type {Record<string, Track>} */
let tracks = {};

/** Make the sliders of a model: for its numeric parameters and its refractive index.
 * @param {any} model
 * @param {Record<string, any>} values
 * @param {string} name */
function build(model, values, name) {
  shown = name;
  tracks = {};
  const all = [...model.parameters, ...(model.spectral ? INDEX : [])];
  const numbers = all.filter((/** @type {Parameter} */ each) =>
    ["number", "undefined"].includes(typeof values[each.name]),
  );
  const sliders = numbers.map((/** @type {Parameter} */ parameter) => {
    const { name: key, unit, meaning } = parameter,
      others = published(parameter),
      track = trackOf(
        parameter,
        others.map(({ value }) => value),
      );
    tracks[key] = track;
    const input = element("input", { type: "range", name: key, min: "0", max: "1", step: "0.0025" });
    input.dataset.unit = ["1", ""].includes(unit) ? "" : ` ${unit === "degree" ? "°" : unit}`;
    const marks = element(
      "span",
      { className: "track" },
      ...others.map(({ value, names }) => {
        const made = element("button", { type: "button", tabIndex: -1, title: `${short(value)}: ${names.join(", ")}` });
        made.style.left = `${100 * track.share(value)}%`;
        Object.assign(made.dataset, { key, value });
        made.setAttribute("aria-hidden", "true"); // keys use the list of materials
        return made;
      }),
    );
    return element(
      "div",
      {},
      element(
        "label",
        { title: meaning },
        `${key} `,
        element("span", { className: "said" }),
        " ",
        element("span", { className: "quiet" }, meaning.split(/[;:,]/)[0]),
        input,
      ),
      marks,
    );
  });
  const buttons = [
    ["reset", "As published"],
    ["keep", "Keep beside"],
    ["recipe", "Copy as recipe"],
  ].map(([action, text]) => {
    const made = element("button", { type: "button" }, text);
    made.dataset.action = action;
    return made;
  });
  panel.replaceChildren(
    element("h3", {}, `Parameters of ${model.title}`),
    ...sliders,
    element("div", { className: "buttons" }, ...buttons),
  );
}

/** The published values of a parameter, and the materials of each.
 * @param {Parameter} parameter
 * @returns {{ value: number, names: string[] }[]} */
function published(parameter) {
  /** @type {Map<number, string[]>} */
  const found = new Map();
  for (const { value, material } of parameter.published) found.set(value, [...(found.get(value) ?? []), material]);
  return [...found].map(([value, names]) => ({ value, names })).sort((a, b) => a.value - b.value);
}

/** The values of a slider: within the limits of a parameter, around its published values; logarithmic over decades.
 * @param {Parameter} parameter
 * @param {number[]} values
 * @returns {Track} */
function trackOf(parameter, values) {
  const { low, high } = parameter,
    some = values.length ? values : [Number(typical(parameter)), Math.min(high, 10)],
    most = Math.max(...some, 1e-6);
  const least = Math.min(...some.filter((value) => value > 0), most),
    near = high <= DECADES * most;
  const end = near ? high : Math.min(BEYOND * most, high),
    from = low < -end ? -end : low;
  const share = (
    /** @type {number} */ value,
    /** @type {(value: number) => number} */ scale,
    /** @type {number} */ first,
  ) => Math.min(Math.max((scale(value) - scale(first)) / (scale(end) - scale(first)), 0), 1);
  if (from >= 0 && end / least > DECADES) {
    const first = Math.max(least / BEYOND, low),
      decades = Math.log10(end / first);
    return {
      at: (to) => Number((to <= 0 && low === 0 ? 0 : first * 10 ** (to * decades)).toPrecision(4)),
      share: (value) => (value > 0 ? share(value, Math.log10, first) : 0),
    };
  }
  return {
    at: (to) => Number((from + to * (end - from)).toPrecision(4)),
    share: (value) => share(value, Number, from),
  };
}

/** Fill the list of models, which start from typical parameters.
 * @param {(part: Partial<State>) => void} choose */
export async function offer(choose) {
  const { models } = await json("v1/models"),
    select = byId("models", HTMLSelectElement);
  select.append(...models.map((/** @type {any} */ { name, title }) => new Option(title, `${OF_MODEL}${name}()`)));
  select.addEventListener("change", () => {
    if (select.value) choose({ material: select.value });
    select.value = "";
  });
}

/** Make sliders, marks and buttons work.
 * @param {(part: Partial<State>) => void} choose
 * @param {() => State} now
 * @param {(sentence: string, tone: string) => void} say */
export function listen(choose, now, say) {
  const move = (/** @type {string} */ key, /** @type {number} */ value) => {
    const { base, changes } = subjectOf(now().material);
    choose({ material: changedText(base, { ...changes, [key]: value }) });
  };
  panel.addEventListener("input", ({ target }) => {
    if (target instanceof HTMLInputElement) move(target.name, tracks[target.name].at(Number(target.value)));
  });
  panel.addEventListener("click", ({ target }) => {
    const { key, value, action } = target instanceof HTMLElement ? target.dataset : {},
      { material, compare } = now();
    if (key) move(key, Number(value));
    const { base, changes } = subjectOf(material);
    if (action === "reset") choose({ material: isModel(base) ? `${base}()` : base });
    if (action === "keep" && !compare.includes(material)) choose({ compare: [...compare, material] });
    if (action === "recipe")
      described(base, changes ?? {}).then(({ info, recipe }) => copyText(written(recipe, info), say));
  });
}

/** A recipe of one material, as `brdfdb build` reads it.
 * @param {Record<string, any>} recipe
 * @param {any} info */
function written({ parameters, refractive_index }, { base, model, title, wavelength_nm }) {
  const slug = `my-${base.name.replace(/[^a-z0-9]+/g, "-").replace(/^-/, "")}`;
  const toml = (/** @type {any} */ value) =>
    typeof value === "object"
      ? `{ ${Object.entries(value)
          .map(([key, each]) => `${key} = ${JSON.stringify(each)}`)
          .join(", ")} }`
      : JSON.stringify(value);
  return [
    `title = ${JSON.stringify(title)}`,
    `materials = ["${slug}"]`,
    ...(wavelength_nm ? [`wavelengths_nm = ${JSON.stringify(wavelength_nm)}`] : []),
    "tolerance = 0.01",
    "",
    `[define.${slug}]`,
    `title = ${JSON.stringify(title)}`,
    `model = "${model}"`,
    `source = ${JSON.stringify(`changed by hand from ${base.title}`)}`,
    ...(refractive_index ? [`refractive_index = "${refractive_index}"`] : []),
    "",
    `[define.${slug}.parameters]`,
    ...Object.entries(parameters).map(([key, value]) => `${key} = ${toml(value)}`),
    "",
  ].join("\n");
}
