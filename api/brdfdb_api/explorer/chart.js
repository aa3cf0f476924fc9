// A chart of curves over an axis, as SVG: linear or logarithmic, read by pointer and by arrow keys.

import { closest, element, path, short, svg } from "./dom.js";

/** @typedef {{ x: number[], y: (number | null)[], label: string, colour: string, dash?: string, low?: number[],
 *   high?: number[],
 *   dashed?: boolean[] }} Curve low and high are the ends of a band; dashed tells which points are */
/** @typedef {{ title: string, range: [number, number], every?: number }} Across */
/** @typedef {{ title: string, range: [number, number], ticks: [number, string][],
 *   height: (value: number) => number }} Up range, ticks and height are on the scale, which may be logarithmic */

const [LEFT, RIGHT, TOP, BOTTOM] = [62, 14, 12, 46]; // pixels around the frame
const TALL = 330; // pixels of the frame

/** Draw a chart into an element; `reads` makes words of a place on the axis across.
 * @param {HTMLElement} into
 * @param {Curve[]} curves
 * @param {Across} across
 * @param {Up} up
 * @param {(x: number) => string} reads
 * @param {(place: (x: number, y: number) => [number, number]) => SVGElement[]} more what is drawn below the curves
 * @param {{ label: string, colour: string, dash?: string }[]} lines what the legend says of that */
export function chart(into, curves, across, up, reads, more = () => [], lines = []) {
  const width = Math.max(into.clientWidth, 240),
    tall = Math.min(TALL, Math.max(200, 0.75 * width));
  const [right, bottom] = [width - RIGHT, TOP + tall];
  const atX = (/** @type {number} */ x) =>
    LEFT + ((x - across.range[0]) / (across.range[1] - across.range[0])) * (right - LEFT);
  const atY = (/** @type {number} */ y) => bottom - ((up.height(y) - up.range[0]) / (up.range[1] - up.range[0])) * tall;
  /** @type {(x: number, y: number) => [number, number]} */
  const place = (x, y) => [atX(x), Math.min(Math.max(atY(y), TOP - 1e4), bottom + 1e4)];

  /** @type {SVGElement[]} */
  const parts = [svg("rect", { x: LEFT, y: TOP, width: right - LEFT, height: tall, class: "frame" })];
  const inside = svg("g", { "clip-path": "url(#frame)" });
  const clip = svg(
    "clipPath",
    { id: "frame" },
    svg("rect", { x: LEFT, y: TOP - 1, width: right - LEFT, height: tall + 2 }),
  );
  for (const x of steps(across.range, (right - LEFT) / 70, across.every)) {
    parts.push(
      path(
        [
          [atX(x), TOP],
          [atX(x), bottom],
        ],
        "grid",
      ),
      svg("text", { x: atX(x), y: bottom + 17, class: "middle" }, String(x).replace("-", "−")),
    );
  }
  for (const [at, text] of up.ticks) {
    const y = bottom - ((at - up.range[0]) / (up.range[1] - up.range[0])) * tall;
    parts.push(
      path(
        [
          [LEFT, y],
          [right, y],
        ],
        "grid",
      ),
      svg("text", { x: LEFT - 6, y: y + 4, class: "end" }, text),
    );
  }
  parts.push(
    svg("text", { x: (LEFT + right) / 2, y: bottom + 38, class: "middle" }, across.title),
    svg(
      "text",
      { x: 0, y: 0, class: "middle", transform: `translate(13 ${(TOP + bottom) / 2}) rotate(-90)` },
      up.title,
    ),
  );
  for (const { x, low, high, colour } of curves) {
    if (!low || !high) continue;
    const edge = x.map((each, i) => place(each, high[i])),
      back = x.map((each, i) => place(each, low[i])).reverse();
    inside.append(path([...edge, ...back], "band", { style: `fill: ${colour}` }));
  }
  inside.append(...more(place));
  for (const curve of curves) inside.append(...strokes(curve, place));
  const cursor = path(
    [
      [0, TOP],
      [0, bottom],
    ],
    "cursor",
  );
  cursor.style.visibility = "hidden";
  const picture = svg("svg", { width, height: bottom + BOTTOM, class: "chart" }, clip, ...parts, inside, cursor);
  const read = element("span", { className: "read" }, "point at the picture to read it");
  picture.dataset.range = up.range.join(" ");
  into.replaceChildren(
    picture,
    element("p", { className: "legend quiet" }, ...[...(curves.length > 1 ? curves : []), ...lines].map(legend), read),
  );
  reader(
    into,
    picture,
    read,
    (clientX) => {
      const share = (clientX - LEFT) / (right - LEFT),
        [low, high] = across.range;
      return Math.min(Math.max(low + share * (high - low), low), high);
    },
    across.range,
    (x) => {
      cursor.setAttribute("transform", `translate(${atX(x)} 0)`);
      cursor.style.visibility = "visible";
      return reads(x);
    },
  );
}

/** Let a pointer and arrow keys read a picture.
 * @param {HTMLElement} into
 * @param {SVGElement} picture
 * @param {HTMLElement} read where the words go
 * @param {(x: number, y: number) => number} placeOf what a point [pixel] stands for
 * @param {[number, number]} range
 * @param {(at: number) => string} reads */
export function reader(into, picture, read, placeOf, range, reads) {
  let at = (range[0] + range[1]) / 2;
  const step = (range[1] - range[0]) / 180;
  picture.onpointermove = ({ clientX, clientY }) => {
    const { left, top } = picture.getBoundingClientRect();
    at = placeOf(clientX - left, clientY - top);
    read.textContent = reads(at);
  };
  into.tabIndex = 0;
  into.onkeydown = (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    at = Math.min(Math.max(at + by * step, range[0]), range[1]);
    read.textContent = reads(at);
    event.preventDefault();
  };
}

/** The line of a curve: pieces of it that are dashed are lines of their own, and single points are dots.
 * @param {Curve} curve
 * @param {(x: number, y: number) => [number, number]} place
 * @returns {SVGElement[]} */
export function strokes({ x, y, colour, dash, dashed, label }, place) {
  const points = x.map((each, i) => (y[i] === null ? null : place(each, Number(y[i]))));
  const stroke = (/** @type {([number, number] | null)[]} */ some, kind = dash ?? "") =>
    path(some, "curve", { style: `stroke: ${colour}; stroke-dasharray: ${kind || "none"}`, "data-label": label });
  if (points.length === 1 && points[0]) {
    return [svg("circle", { cx: points[0][0], cy: points[0][1], r: 4, style: `fill: ${colour}`, "data-label": label })];
  }
  if (!dashed?.some(Boolean)) return [stroke(points)];
  return [
    stroke(points.map((point, i) => (dashed[i] ? null : point))),
    stroke(
      points.map((point, i) => (dashed[i] || dashed[i - 1] || dashed[i + 1] ? point : null)),
      "3 4",
    ),
  ];
}

/** A line and what it stands for.
 * @param {{ label: string, colour: string, dash?: string }} curve */
export const legend = ({ label, colour, dash = "none" }) =>
  element(
    "span",
    {},
    svg(
      "svg",
      { width: 28, height: 10, "aria-hidden": "true" },
      path(
        [
          [0, 5],
          [28, 5],
        ],
        "curve",
        { style: `stroke: ${colour}; stroke-dasharray: ${dash}` },
      ),
    ),
    ` ${label}`,
  );

/** Round places between the ends of an axis.
 * @param {[number, number]} range
 * @param {number} most how many fit
 * @param {number} [every] their distance */
export function steps([low, high], most, every) {
  const rough = (high - low) / Math.max(most, 2),
    power = 10 ** Math.floor(Math.log10(rough));
  let step = every ?? [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough) ?? 10 * power;
  while (every && (high - low) / step > most) step *= 2;
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) =>
    Number(((first + i) * step).toPrecision(12)),
  );
}

/** The value of a curve at a place across, in words.
 * @param {Curve} curve
 * @param {number} at
 * @param {string} [unit] */
export function valueAt({ x, y, label }, at, unit = "") {
  const value = y[closest(x, at)];
  return `${label} ${value === null ? "–" : short(value)}${unit}`;
}
