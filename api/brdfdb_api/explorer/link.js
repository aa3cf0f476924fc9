// The link of the page: the state of the current view as the end of an address, and back.

/** @typedef {{ base: string, model: boolean, changes: Record<string, number> | null }} Subject the table of a material;
 *   with `model` the model that it was made from; with `changes` that model, or a named model, with other parameters */
/** @typedef {{ material: string, view: string, theta_i: number, phi_i: number, theta_r: number, turn: number,
 *   nm: number | null, scale: string, axes: string, curves: string, compare: string[], illuminant: string,
 *   exposure: number, surround: string, quick?: boolean }} State the current view. material and compare are subjects
 *   as text; turn is phi_r - phi_i; nm null: luminance and colours; quick: coarse pictures while a slider moves */

// Subject: the model of the material itself
export const MODEL = ":model";

// Illuminants of colours; D65 is the first in the list
export const ILLUMINANTS = ["D65", "D50", "A", "FL2"];

/** @type {State} */
const DEFAULTS = {
  material: "",
  view: "together",
  theta_i: 45,
  phi_i: 0,
  theta_r: 45,
  turn: 180,
  nm: null,
  scale: "log",
  axes: "polar",
  curves: "one",
  compare: [],
  illuminant: "D65",
  exposure: 0,
  surround: "sky",
};
/** @type {Record<string, string[]>} */
export const CHOICES = {
  scale: ["log", "linear"],
  axes: ["polar", "cartesian"],
  curves: ["one", "rgb", "wavelengths"],
  illuminant: ILLUMINANTS,
  surround: ["sky", "dark", "studio"],
};
/** @type {Record<string, [number, number]>} */
const RANGES = {
  theta_i: [0, 89.5],
  phi_i: [0, 360],
  theta_r: [0, 89.5],
  turn: [0, 360],
  nm: [1, 1e6],
  exposure: [-8, 8],
};
// Wavelengths of pictures, as in `brdfdb render`
export const PICTURE_NM = Array.from({ length: 14 }, (_, i) => 420 + 20 * i);
const CHANGED = /^(.*?)\((.*)\)$/; // NAME(parameter=value,...)
const MOST = 7; // number of comparisons: there are eight colours

/** The state of a link, and sentences on its wrong parts. A number out of range becomes the nearest allowed number;
 * other parts that are wrong or missing have their default.
 * @param {string} hash
 * @param {Record<string, unknown>} views
 * @returns {{ state: State, wrong: string[] }} */
export function fromHash(hash, views) {
  /** @type {Record<string, any>} */
  const state = { ...DEFAULTS, compare: [] };
  /** @type {string[]} */
  const wrong = [];
  /** @type {Record<string, string[]>} */
  const choices = { ...CHOICES, view: Object.keys(views) };
  for (const [key, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (key in RANGES) {
      const value = text.trim() ? Number(text) : NaN,
        [low, high] = RANGES[key];
      if (!Number.isNaN(value)) state[key] = Math.min(Math.max(value, low), high);
      if (state[key] !== value)
        wrong.push(`${key}: '${text}' is not a number from ${low} to ${high}; ${state[key] ?? "all"} is shown.`);
    } else if (key === "compare") {
      const kept = numbersOf(text, wrong);
      if (kept && !state.compare.includes(kept)) state.compare = [...state.compare, kept].slice(0, MOST);
    } else if (key === "material") {
      state.material = numbersOf(text, wrong);
    } else if (key in choices) {
      if (choices[key].includes(text)) state[key] = text;
      else wrong.push(`${key}: '${text}' is not one of ${choices[key].join(", ")}; ${state[key]} is shown.`);
    }
  }
  return { state: /** @type {State} */ (state), wrong };
}

/** A subject without parameters that are not numbers; a material without parameters is the published one.
 * @param {string} text
 * @param {string[]} wrong sentences, to which sentences on these parameters are added */
function numbersOf(text, wrong) {
  const [, base, inside] = CHANGED.exec(text) ?? [];
  if (base === undefined) return text;
  const own = base.startsWith("*") ? "typical" : "published";
  const kept = inside.split(",").filter((pair) => {
    const [name, value = ""] = pair.split("=");
    if (value.trim() && Number.isFinite(Number(value))) return true;
    if (pair) wrong.push(`${name}: '${value}' is not a number; the ${own} value is shown.`);
    return false;
  });
  return kept.length || base.startsWith("*") ? `${base}(${kept.join(",")})` : base;
}

/** The link of a state: all values that differ from the defaults.
 * @param {State} state */
export function toHash(state) {
  const { quick: _, ...all } = state;
  const held = Object.entries(all).flatMap(([key, value]) =>
    Array.isArray(value)
      ? value.map((each) => [key, each])
      : value === null || value === DEFAULTS[/** @type {keyof State} */ (key)]
        ? []
        : [[key, value]],
  );
  return `#${held.map(([key, value]) => `${key}=${plain(String(value))}`).join("&")}`;
}

/** Text as in a link: characters without a meaning after # are not escaped.
 * @param {string} text */
const plain = (text) => encodeURIComponent(text).replace(/%3A|%3D|%2C/g, (code) => decodeURIComponent(code));

/** A subject from its text: NAME, NAME:model or NAME(parameter=value,...).
 * @param {string} text
 * @returns {Subject} */
export function subjectOf(text) {
  const [, base, changed] = CHANGED.exec(text) ?? [];
  if (base !== undefined) {
    const pairs = changed
      .split(",")
      .map((each) => each.split("="))
      .filter(([name, value]) => name && value && Number.isFinite(Number(value)));
    return { base, model: true, changes: Object.fromEntries(pairs.map(([name, value]) => [name, Number(value)])) };
  }
  return text.endsWith(MODEL)
    ? { base: text.slice(0, -MODEL.length), model: true, changes: null }
    : { base: text, model: false, changes: null };
}

/** The text of a subject with parameters.
 * @param {string} base
 * @param {Record<string, number>} changes */
export const changedText = (base, changes) =>
  `${base}(${Object.entries(changes)
    .map(([name, value]) => `${name}=${Number(value.toPrecision(6))}`)
    .join(",")})`;
