// Elements of the page: made in one line, found by id; and numbers and verdicts as people read them.

const SVG = "http://www.w3.org/2000/svg";

/** @type {Record<string, string>} */
const LEVELS = {
  passes: "good",
  conserves: "good",
  inside: "good",
  loses: "calm",
  "at the edge": "calm",
  unknown: "calm",
  "not judged": "calm",
  compared: "calm",
  outside: "note",
  gains: "note",
  "known published excess": "note",
  "accepted excess": "note",
  violates: "bad",
  damaged: "bad",
};

/** The element of the page with an id, of a kind.
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} kind
 * @returns {T} */
export function byId(id, kind) {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new TypeError(`the page has no ${kind.name} #${id}`);
  return found;
}

/** An element with properties and children.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Partial<HTMLElementTagNameMap[T]>} properties
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[T]} */
export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** An element of SVG with attributes and children.
 * @template {keyof SVGElementTagNameMap} T
 * @param {T} tag
 * @param {Record<string, string | number>} attributes
 * @param {(Node | string)[]} children
 * @returns {SVGElementTagNameMap[T]} */
export function svg(tag, attributes, ...children) {
  const made = document.createElementNS(SVG, tag);
  const { style = "", ...rest } = attributes;
  made.style.cssText = String(style); // pages that keep to a policy have no attributes of style
  for (const [name, value] of Object.entries(rest)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

/** A path through points [pixel], to a tenth of a pixel; null begins a new piece.
 * @param {([number, number] | null)[]} points
 * @param {string} kind its class
 * @param {Record<string, string>} more */
export function path(points, kind, more = {}) {
  const pieces = points.map((point, i) =>
    point ? `${i && points[i - 1] ? "L" : "M"}${point[0].toFixed(1)} ${point[1].toFixed(1)}` : "",
  );
  return svg("path", { d: pieces.join(""), class: kind, ...more });
}

/** A verdict: its words, or others for it, and a colour that repeats them.
 * @param {string} verdict */
export function chip(verdict, text = verdict) {
  return element("span", { className: `chip ${LEVELS[verdict] ?? "none"}` }, text ?? "not audited");
}

/** Whether a verdict is a plain pass.
 * @param {string} verdict */
export const isGood = (verdict) => LEVELS[verdict] === "good";

/** Whether a verdict says that something is wrong.
 * @param {string} verdict */
export const isWrong = (verdict) => ["note", "bad"].includes(LEVELS[verdict]);

/** A number with three digits.
 * @param {number} value */
export function short(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
    const [digits, power] = value.toExponential(2).split("e");
    return `${Number(digits)} × 10${[...String(Number(power))].map((each) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(each)] ?? "⁻").join("")}`;
  }
  return String(Number(value.toPrecision(3)));
}

/** A share as a percentage.
 * @param {number} share */
export const percent = (share) => `${short(100 * share)} %`;

/** An angle in degrees, with a minus that is as wide as a plus.
 * @param {number} angle */
export const degrees = (angle) => `${String(angle).replace("-", "−")}°`;

/** The place of the value that is closest to another.
 * @param {ArrayLike<number>} values
 * @param {number} to */
export function closest(values, to) {
  let best = 0;
  for (let i = 1; i < values.length; i += 1) if (Math.abs(values[i] - to) < Math.abs(values[best] - to)) best = i;
  return best;
}

/** A colour of the page, by its name in the style sheet.
 * @param {string} name */
export const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
