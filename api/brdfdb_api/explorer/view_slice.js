// The view of f_r over half angle, across, and difference angle, up, as a map; a click picks directions.

import { steps } from "./chart.js";
import { element, percent, short, svg } from "./dom.js";
import { RELATIVE, colourBar, floorOf, mapped, relative, scaled, span, ticks } from "./scales.js";
import { against, anisotropic, lobe, number, quantityWords } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {{ label: string, text: (j: number, i: number) => string, colour: (j: number, i: number) => number[] }}
 *   Map j of theta_h, i of theta_d */

const RADIAN = Math.PI / 180;
const SIZE = 90; // nodes along theta_h and theta_d
const DIFFERENCE = [
  [33, 102, 172],
  [247, 247, 247],
  [178, 24, 43],
];
const [LEFT, RIGHT, BOTTOM, TOP, SIDE] = [44, 18, 42, 10, 300]; // pixels around a map and along its sides

/** @type {import("./main.js").View} */
export default {
  name: "slice",
  title: "Slice",
  order: 3,
  draw: slice,
  begin: picks,
  request: (each, state, series) => lobe("half-difference", each, state, series),
};

/** The light and the viewer [degrees] of half and difference angles, where phi of the difference is 90 degrees.
 * @param {number} theta_h
 * @param {number} theta_d
 * @param {number} phi_h */
function directions(theta_h, theta_d, phi_h) {
  const [sh, ch, sd, cd] = [
    Math.sin(theta_h * RADIAN),
    Math.cos(theta_h * RADIAN),
    Math.sin(theta_d * RADIAN),
    Math.cos(theta_d * RADIAN),
  ];
  // of the half vector at phi 0, along (sh, 0, ch); the difference leans to the sides
  const theta = Math.acos(cd * ch) / RADIAN,
    side = Math.atan2(sd, cd * sh) / RADIAN;
  const round = (/** @type {number} */ angle) => Math.round(2 * angle) / 2,
    turn = Math.round((720 - 2 * side) % 360);
  return {
    theta_i: Math.min(round(theta), 89.5),
    theta_r: Math.min(round(theta), 89.5),
    phi_i: Math.round((phi_h + side + 360) % 360),
    turn,
  };
}

/** Half angle and difference angle [degrees] of the directions of a state.
 * @param {State} state
 * @returns {[number, number]} */
function halfDifference({ theta_i, theta_r, turn }) {
  const [si, ci, sr, cr] = [
    Math.sin(theta_i * RADIAN),
    Math.cos(theta_i * RADIAN),
    Math.sin(theta_r * RADIAN),
    Math.cos(theta_r * RADIAN),
  ];
  const together = Math.cos(turn * RADIAN) * si * sr + ci * cr,
    size = Math.sqrt(Math.max(2 + 2 * together, 1e-12)); // of their sum
  return [
    Math.acos(Math.min((ci + cr) / size, 1)) / RADIAN,
    Math.acos(Math.min(Math.max(together, -1), 1)) / RADIAN / 2,
  ];
}

/** Draw a map of each series, or of a table and how far it is off; the caption.
 * @param {HTMLElement} into
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
function slice(into, series, answers, state) {
  const differ = against(series);
  /** @type {number[][][]} */
  const values = answers.map((answer) => answer.brdf.map((/** @type {any[]} */ row) => row.map(number(answer))));
  const shown = differ ? values.slice(0, 1) : values,
    range = span(shown.flat(2), state),
    height = scaled(state, range[0]);
  const share = (/** @type {number} */ value) => (height(value) - range[0]) / (range[1] - range[0]);
  /** @type {Map[]} */
  const maps = shown.map((rows, i) => ({
    label: series.length > 1 ? series[i].label : "",
    text: (j, k) => `${short(rows[j][k])} /sr`,
    colour: (j, k) => mapped(share(rows[j][k])),
  }));
  if (differ) maps.push(difference(values, floorOf(series[0].info, state.nm)));
  const here = halfDifference(state),
    read = element("span", { className: "read" }, "point at the picture to read it; a click picks the directions");
  into.replaceChildren(
    element("div", { className: "side" }, ...maps.map((map) => figure(map, read, here))),
    colourBar(ticks(range, state).map(([at, text]) => [(at - range[0]) / (range[1] - range[0]), text])),
    element("p", { className: "legend quiet" }, read),
  );
  const turned = anisotropic(series) ? `; φ of the half vector is ${answers[0].phi_i}°` : "";
  return (
    `${quantityWords(series[0], state)} in 1/sr over the half angle, across, ` +
    `and the difference angle, up, of φ 90°${turned}.` +
    (differ ? ` On the right, how far the table is off, ${RELATIVE}; the scale ends at the 99th percentile.` : "")
  );
}

/** How far a table is off, from blue to red.
 * @param {number[][][]} values
 * @param {number} floor
 * @returns {Map} */
function difference([table, model], floor) {
  const off = table.map((row, j) => relative(row, model[j], floor));
  const sizes = off
    .flat()
    .flatMap((each) => (each === null ? [] : [Math.abs(each)]))
    .sort((a, b) => a - b);
  const most = sizes[Math.floor(0.99 * sizes.length)] || 1e-9;
  return {
    label: `table − model, relative: −${percent(most)} blue, +${percent(most)} red`,
    text: (j, k) => percent(off[j][k] ?? 0),
    colour: (j, k) => mapped(0.5 + (off[j][k] ?? 0) / (2 * most), 1, DIFFERENCE),
  };
}

/** A map with its axes.
 * @param {Map} map
 * @param {HTMLElement} read
 * @param {[number, number]} here theta_h and theta_d of the directions that are picked
 */
function figure({ label, text, colour }, read, here) {
  const canvas = element("canvas", { width: SIZE, height: SIZE, className: "map" }),
    context = canvas.getContext("2d");
  const image = context?.createImageData(SIZE, SIZE);
  if (context && image) {
    for (let j = 0; j < SIZE; j += 1) {
      for (let i = 0; i < SIZE; i += 1) image.data.set([...colour(j, i), 255], 4 * ((SIZE - 1 - i) * SIZE + j));
    }
    context.putImageData(image, 0, 0);
  }
  canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => {
    const [j, i] = nodeAt(canvas, offsetX, offsetY);
    read.textContent = `θh ${j + 0.5}°, θd ${i + 0.5}°: ${text(j, i)}`;
  });
  const wide = LEFT + SIDE + RIGHT,
    tall = TOP + SIDE + BOTTOM;
  const place = (/** @type {number} */ at) => (at / 90) * SIDE;
  const share = (/** @type {number} */ part, /** @type {number} */ all) => `${(100 * part) / all}%`;
  const axes = svg(
    "svg",
    { viewBox: `0 0 ${wide} ${tall}`, "aria-hidden": "true" },
    ...steps([0, 90], 4, 30).flatMap((at) => [
      svg("text", { x: LEFT + place(at), y: TOP + SIDE + 16, class: "middle" }, `${at}°`),
      svg("text", { x: LEFT - 6, y: TOP + SIDE - place(at) + 4, class: "end" }, `${at}°`),
    ]),
    svg("text", { x: LEFT + SIDE / 2, y: TOP + SIDE + 36, class: "middle" }, "half angle θh"),
    svg(
      "text",
      { x: 0, y: 0, class: "middle", transform: `translate(11 ${TOP + SIDE / 2}) rotate(-90)` },
      "difference angle θd",
    ),
  );
  const ring = element("span", { className: "ring" });
  Object.assign(ring.style, {
    left: share(LEFT + place(here[0]), wide),
    top: share(TOP + SIDE - place(here[1]), tall),
  });
  const around = {
    left: share(LEFT, wide),
    top: share(TOP, tall),
    width: share(SIDE, wide),
    height: share(SIDE, tall),
  };
  Object.assign(canvas.style, around);
  return element(
    "figure",
    {},
    element("div", { className: "mapped" }, axes, canvas, ring),
    element("figcaption", { className: "quiet" }, label),
  );
}

/** The node of a map at a point.
 * @param {HTMLCanvasElement} canvas
 * @param {number} x
 * @param {number} y */
function nodeAt({ clientWidth, clientHeight }, x, y) {
  const node = (/** @type {number} */ share) => Math.min(Math.max(Math.floor(share * SIZE), 0), SIZE - 1);
  return [node(x / clientWidth), node(1 - y / clientHeight)];
}

/** Let a click pick the directions of a node, for the other views.
 * @param {HTMLElement} into
 * @param {(part: Partial<State>) => void} choose
 * @param {() => State} now */
function picks(into, choose, now) {
  into.addEventListener("click", ({ target, offsetX, offsetY }) => {
    if (!(target instanceof HTMLCanvasElement)) return;
    const [j, i] = nodeAt(target, offsetX, offsetY);
    choose(directions(j + 0.5, i + 0.5, now().phi_i));
  });
}
