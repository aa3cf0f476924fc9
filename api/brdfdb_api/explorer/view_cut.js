// The polar cut in the plane of incidence, as SVG: the first picture need not wait for a library of megabytes.

import { element, percent, short } from "./dom.js";
import { RELATIVE, floorOf, mirrorWords, relative, scaled, shortOfHorizon, span, ticks } from "./scales.js";
import { lobe, number, quantityWords } from "./series.js";
import { MODEL } from "./state.js";

const SVG = "http://www.w3.org/2000/svg";
const RADIAN = Math.PI / 180;
const TOP = 26, STRIP = 110, LABEL = 40; // pixels: room above, height of what tells the difference, width of a number

export default { name: "cut", title: "Cut", order: 1, request: lobe, draw: cut };

/** Draw the cut into an element; its caption. */
function cut(into, series, answers, state) {
  const width = into.clientWidth, radius = Math.min((width - 80) / 2, 300);
  const against = state.compare === MODEL;
  const kept = answers.map((answer) => shortOfHorizon(answer.axes_deg.theta_r));
  const curves = answers.map((answer, i) => kept[i].map((k) => number(answer)(answer.brdf[k])));
  const range = span(curves.flat(), state), height = scaled(state, range[0]);
  const out = (value) => ((height(value) - range[0]) / (range[1] - range[0])) * radius;
  const at = (theta, r) => [width / 2 + r * Math.sin(theta * RADIAN), TOP + radius - r * Math.cos(theta * RADIAN)];
  const thetas = answers.map((answer, i) => kept[i].map((k) => answer.axes_deg.theta_r[k]));
  const guessed = answers.map(({ extrapolated }, i) => kept[i].map((k) => Boolean(extrapolated?.[k])));
  const faint = (i, k) => guessed[i][k] || guessed[i][k - 1];

  const parts = [...frame(at, radius, range, state)];
  for (const [theta, kind] of [[-state.theta_i, "light"], [state.theta_i, "mirror"]]) {
    parts.push(path([at(theta, 0), at(theta, radius)], kind));
  }
  curves.forEach((curve, i) => {
    const points = curve.map((value, k) => at(thetas[i][k], out(value))), kind = i ? "second" : "first";
    parts.push(pieces(points, (k) => !faint(i, k), kind));
    if (guessed[i].includes(true)) parts.push(pieces(points, (k) => faint(i, k), `${kind} guess`));
  });
  const rows = series.map(({ label }, i) => [i ? "second" : "first", label]);
  const some = guessed.findIndex((each) => each.includes(true));
  if (some >= 0) rows.push([`${rows[some][0]} guess`, "extrapolated: not measured"]);
  let words = `${quantityWords(series[0], state)} in 1/sr over θᵣ in the plane of incidence, negative back towards the light.`;
  let bottom = TOP + radius + 24;
  if (against) {
    const off = relative(...curves, floorOf(series[0].info, state.nm));
    const worst = Math.max(...off.map((value) => Math.abs(value ?? 0)));
    parts.push(...strip(thetas[0], off, worst || 1, bottom + 24, at, radius));
    words += ` Below, to 89°, table − model, ${RELATIVE}: ${percent(worst)} at most.`;
    bottom += STRIP + 50;
  }
  const picture = svg("svg", { width, height: bottom }, ...parts);
  const legend = [...rows, ["light", "light"], ["mirror", "mirror direction"]].map(([kind, label]) =>
    element("span", {}, svg("svg", { width: 28, height: 10 }, path([[0, 5], [28, 5]], kind)), ` ${label}`));
  const read = element("span", { id: "read" }, "point at the picture to read it");
  picture.addEventListener("pointermove", ({ clientX, clientY }) => {
    const { left, top } = picture.getBoundingClientRect();
    const theta = Math.atan2(clientX - left - width / 2, top + TOP + radius - clientY) / RADIAN;
    const found = thetas.map((each) => closest(each, theta));
    read.textContent = `θᵣ ${degrees(thetas[0][found[0]])}: ${curves.map((curve, i) => `${short(curve[found[i]])} /sr`).join(", ")}`;
  });
  into.replaceChildren(picture, element("p", { className: "legend quiet" }, ...legend, read));
  return words + mirrorWords(series, answers);
}

/** Rings of the scale and spokes of the angle. */
function* frame(at, radius, range, state) {
  const rings = ticks(range, state), every = Math.ceil((LABEL * (rings.length - 1)) / radius);
  for (const [i, [value, label]] of rings.entries()) {
    const r = ((value - range[0]) / (range[1] - range[0])) * radius;
    const [x, y] = at(90, r);
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

/** The difference over theta_r, between its largest sizes. */
function* strip(theta, off, worst, top, at, radius) {
  const middle = top + STRIP / 2, left = at(-90, radius)[0];
  const place = (each, value) => [left + ((each + 90) / 180) * 2 * radius, middle - (value / worst) * (STRIP / 2)];
  for (const share of [-worst, 0, worst]) {
    const [x, y] = place(-90, share);
    yield path([[x, y], place(90, share)], "grid");
    if (share !== 0) yield svg("text", { x: x + 2, y: y - 4 }, `${share > 0 ? "+" : ""}${percent(share).replace("-", "−")}`);
  }
  for (let each = -90; each <= 90; each += 30) {
    const [x, y] = place(each, -worst);
    yield svg("text", { x, y: y + 17, class: "middle" }, degrees(each));
  }
  yield path(theta.map((each, i) => place(each, off[i] ?? 0)), "off");
}

const degrees = (theta) => `${String(theta).replace("-", "−")}°`;

const closest = (values, to) => values.reduce((best, value, i) => (Math.abs(value - to) < Math.abs(values[best] - to) ? i : best), 0);

/** The pieces of a line that end at points that are chosen. */
const pieces = (points, chosen, kind) => svg("path", { class: kind, d: points.map(([x, y], k) =>
  `${k && chosen(k) ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") });

const path = (points, kind) => svg("path", { d: `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`, class: kind });

function svg(tag, attributes, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}
