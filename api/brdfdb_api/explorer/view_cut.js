// The cut through the plane of incidence: f_r over the viewer, as a polar picture or a chart.

import { chart, legend, reader, strokes } from "./chart.js";
import { closest, degrees, element, ink, path, percent, short, svg } from "./dom.js";
import { RELATIVE, floorOf, relative, scaled, shortOfHorizon, span, specularWords, ticks } from "./scales.js";
import { against, channelsOf, lobe, quantityWords } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {import("./chart.js").Curve} Curve */

const RADIAN = Math.PI / 180;
const TOP = 26,
  STRIP = 110,
  LABEL = 40; // pixels: room above, height of what tells the difference, width of a number
const NEAR = 24; // pixels from the light in which a hand takes it

let centre = [0, 0]; // of the polar picture [pixel]

/** @type {import("./main.js").View} */
export default { name: "cut", title: "Cut", order: 1, shapes: true, request, draw: cut, begin: moves };

/** @param {Series} each
 * @param {State} state
 * @param {Series[]} series */
function request(each, state, series) {
  return lobe("cut", each, state, series, channelsOf(each, state).query);
}

/** The curves of all series, short of the horizon.
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state
 * @returns {Curve[]} */
function curvesOf(series, answers, state) {
  return series.flatMap((each, i) => {
    const {
        axes_deg: { theta_r },
        brdf,
        extrapolated,
      } = answers[i],
      kept = shortOfHorizon(theta_r);
    return channelsOf(each, state).channels.map(({ part, colour, pick }) => ({
      x: kept.map((k) => theta_r[k]),
      y: kept.map((k) => pick(brdf[k])),
      colour: ink(colour ?? each.colour),
      dash: each.dash,
      label: [series.length > 1 || !part ? each.label : "", part].filter(Boolean).join(", "),
      ...(extrapolated && { dashed: kept.map((k) => extrapolated[k]) }),
    }));
  });
}

/** The specular reflectance of each series, as one number.
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
const specularOf = (series, answers, state) =>
  series.map((each, i) => {
    const part = answers[i].specular_reflectance ?? 0;
    return Math.max(...channelsOf(each, state).channels.map(({ pick }) => (Array.isArray(part) ? pick(part) : part)));
  });

/** Draw the cut into an element; its caption.
 * @param {HTMLElement} into
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
function cut(into, series, answers, state) {
  const curves = curvesOf(series, answers, state),
    range = span(
      curves.flatMap(({ y }) => y.map(Number)),
      state,
    );
  const specular = specularOf(series, answers, state),
    differ = against(series) && curves.length === 2;
  const off = differ
    ? relative(curves[0].y.map(Number), curves[1].y.map(Number), floorOf(series[0].info, state.nm))
    : null;
  const words = state.curves === "one" ? quantityWords(series[0], state) : "fᵣ";
  (state.axes === "cartesian" ? flat : round)(into, curves, range, state, specular, off);
  return (
    `${words} in 1/sr over θᵣ in the plane of incidence, negative back towards the light.` +
    (off
      ? ` ${state.axes === "polar" ? "Below, to 89°, t" : "T"}able − model, ${RELATIVE}: ${percent(worstOf(off))} at most.`
      : "") +
    (answers.some(({ extrapolated }) => extrapolated?.includes(true))
      ? " Dashed lines are extrapolated from the measured directions."
      : "") +
    specularWords(series, specular)
  );
}

/** @param {(number | null)[]} off */
const worstOf = (off) => Math.max(...off.map((value) => Math.abs(value ?? 0)));

/** What the curves say at an angle.
 * @param {Curve[]} curves
 * @param {number} theta */
const reading = (curves, theta) =>
  `θᵣ ${degrees(curves[0].x[closest(curves[0].x, theta)])}: ` +
  `${curves.map(({ x, y }) => `${short(Number(y[closest(x, theta)]))} /sr`).join(", ")}`;

/** The cut as a chart.
 * @param {HTMLElement} into
 * @param {Curve[]} curves
 * @param {[number, number]} range
 * @param {State} state
 * @param {number[]} specular */
function flat(into, curves, range, state, specular) {
  const up = { title: "fᵣ [1/sr]", range, ticks: ticks(range, state), height: scaled(state, range[0]) };
  const top = state.scale === "log" ? 10 ** range[1] : range[1],
    bottom = state.scale === "log" ? 10 ** range[0] : 0,
    part = Math.max(...specular);
  const marks = (/** @type {(x: number, y: number) => [number, number]} */ place) => [
    path([place(-state.theta_i, bottom), place(-state.theta_i, top)], "light"),
    path([place(state.theta_i, bottom), place(state.theta_i, top)], part > 0 ? "spike" : "mirror"),
  ];
  chart(
    into,
    curves,
    { title: "θᵣ [degrees]", range: [-90, 90], every: 30 },
    up,
    (theta) => reading(curves, theta),
    marks,
    rays(part),
  );
}

/** Lines of the legend for the light, and for the specular part or the mirror direction without one.
 * @param {number} part */
const rays = (part) => [
  { label: "light", colour: ink("third"), dash: "2 3" },
  part > 0
    ? { label: `specular part ${percent(part)}`, colour: ink("spike") }
    : { label: "mirror direction", colour: ink("muted"), dash: "2 3" },
];

/** The cut as a polar picture.
 * @param {HTMLElement} into
 * @param {Curve[]} curves
 * @param {[number, number]} range
 * @param {State} state
 * @param {number[]} specular
 * @param {(number | null)[] | null} off */
function round(into, curves, range, state, specular, off) {
  const width = into.clientWidth,
    radius = Math.max(Math.min((width - 80) / 2, 300), 60),
    height = scaled(state, range[0]);
  const out = (/** @type {number} */ value) => ((height(value) - range[0]) / (range[1] - range[0])) * radius;
  /** @type {(theta: number, r: number) => [number, number]} */
  const at = (theta, r) => [width / 2 + r * Math.sin(theta * RADIAN), TOP + radius - r * Math.cos(theta * RADIAN)];
  const part = Math.max(...specular);
  centre = at(0, 0);
  const [x, y] = at(-state.theta_i, radius);
  const parts = [
    ...frame(at, radius, range, state),
    path([at(-state.theta_i, 0), at(-state.theta_i, radius)], "light"),
    path([at(state.theta_i, 0), at(state.theta_i, radius)], "mirror"),
    ...curves.flatMap((curve) => strokes(curve, (theta, value) => at(theta, out(value)))),
    ...(part > 0 ? [path([at(state.theta_i, 0), at(state.theta_i, radius)], "spike")] : []),
    svg("circle", { cx: x, cy: y, r: 7, class: "lamp" }),
  ];
  let bottom = TOP + radius + 24;
  if (off) {
    parts.push(...strip(curves[0].x, off, worstOf(off) || 1, bottom + 24, at, radius));
    bottom += STRIP + 50;
  }
  const picture = svg("svg", { width, height: bottom, class: "polar" }, ...parts);
  const read = element("span", { className: "read" }, "point at the picture to read it");
  reader(
    into,
    picture,
    read,
    (left, top) => Math.atan2(left - width / 2, TOP + radius - top) / RADIAN,
    [-89, 89],
    (theta) => reading(curves, theta),
  );
  into.replaceChildren(
    picture,
    element("p", { className: "legend quiet" }, ...[...(curves.length > 1 ? curves : []), ...rays(part)].map(legend), read),
  );
}

/** Rings of the scale and spokes of the angle.
 * @param {(theta: number, r: number) => [number, number]} at
 * @param {number} radius
 * @param {[number, number]} range
 * @param {State} state
 * @returns {Generator<SVGElement>} */
function* frame(at, radius, range, state) {
  const all = ticks(range, state),
    rings = all.length > 8 ? all.filter(([value]) => Number.isInteger(value)) : all;
  const every = Math.ceil((LABEL * (rings.length - 1)) / radius);
  for (const [i, [value, label]] of rings.entries()) {
    const r = ((value - range[0]) / (range[1] - range[0])) * radius,
      [x, y] = at(90, r);
    yield svg("path", { d: `M${at(-90, r)}A${r} ${r} 0 0 1 ${x} ${y}`, class: "grid" });
    if ((rings.length - 1 - i) % every === 0) yield svg("text", { x, y: y + 17, class: "middle" }, label);
  }
  for (const theta of [-90, -60, -30, 0, 30, 60, 90]) {
    yield path([at(theta, 0), at(theta, radius)], "grid");
    if (Math.abs(theta) === 90) continue; // numbers of the scale stand there
    const [x, y] = at(theta, radius + 12);
    yield svg("text", { x, y: y + 4, class: "middle" }, degrees(theta));
  }
}

/** The difference over theta_r, between its largest sizes.
 * @param {number[]} theta
 * @param {(number | null)[]} off
 * @param {number} worst
 * @param {number} top
 * @param {(theta: number, r: number) => [number, number]} at
 * @param {number} radius
 * @returns {Generator<SVGElement>} */
function* strip(theta, off, worst, top, at, radius) {
  const middle = top + STRIP / 2,
    left = at(-90, radius)[0];
  /** @type {(each: number, value: number) => [number, number]} */
  const place = (each, value) => [left + ((each + 90) / 180) * 2 * radius, middle - (value / worst) * (STRIP / 2)];
  for (const share of [-worst, 0, worst]) {
    const [x, y] = place(-90, share);
    yield path([[x, y], place(90, share)], "grid");
    if (share !== 0)
      yield svg("text", { x: x + 2, y: y - 4 }, `${share > 0 ? "+" : ""}${percent(share).replace("-", "−")}`);
  }
  for (let each = -90; each <= 90; each += 30) {
    const [x, y] = place(each, -worst);
    yield svg("text", { x, y: y + 17, class: "middle" }, degrees(each));
  }
  yield path(
    theta.map((each, i) => place(each, off[i] ?? 0)),
    "off",
  );
}

/** Let a hand move the light around the polar picture.
 * @param {HTMLElement} into
 * @param {(part: Partial<State>) => void} choose */
function moves(into, choose) {
  let moving = false;
  const theta = (/** @type {PointerEvent} */ { clientX, clientY }) => {
    const { left = 0, top = 0 } = into.querySelector("svg")?.getBoundingClientRect() ?? {};
    return Math.atan2(left + centre[0] - clientX, top + centre[1] - clientY) / RADIAN;
  };
  into.addEventListener("pointerdown", (event) => {
    const lamp = into.querySelector(".lamp")?.getBoundingClientRect();
    if (!lamp || Math.hypot(lamp.x + 7 - event.clientX, lamp.y + 7 - event.clientY) > NEAR) return;
    moving = true;
    into.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  into.addEventListener("pointermove", (event) => {
    if (moving) choose({ theta_i: Math.round(2 * Math.min(Math.max(theta(event), 0), 89.5)) / 2 });
  });
  for (const end of /** @type {const} */ (["pointerup", "pointercancel"]))
    into.addEventListener(end, () => {
      moving = false;
    });
}
