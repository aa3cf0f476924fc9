// The hemisphere of viewers on canvases, the distance from the centre being f_r; a hand or arrow keys turn it.

import { element, short } from "./dom.js";
import { mirrorWords, scaled, shortOfHorizon, span, ticks } from "./scales.js";
import { lobe, number, quantityWords } from "./series.js";

const RADIAN = Math.PI / 180;
const VIRIDIS = [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121],
  [110, 206, 88], [181, 222, 43], [253, 231, 37]];
const START = { azimuth: 115, elevation: 27 }; // degrees: the light of phi_i = 0 is at the left, as in the cut
const LAMP = [0.3, 0.5, 0.81]; // that shades the surface, so that its form is seen
const ROUND = 1.15; // half the width of the picture, in radii
const STEPS = 24; // a line goes in and out of the surface in so many pieces
const [PER_PIXEL, PER_KEY] = [0.5, 5]; // degrees

const camera = { ...START };
let repaint = () => {}; // what is shown, from where the camera is now

export default { name: "hemisphere", title: "Hemisphere", order: 2, request: lobe, draw: hemisphere, begin: turns };

/** Draw the lobe of each series into an element; the caption. */
function hemisphere(into, series, answers, state) {
  const kept = answers.map((answer) => shortOfHorizon(answer.axes_deg.theta_r));
  const values = answers.map((answer, i) => kept[i].map((k) => answer.brdf[k].map(number(answer))));
  const range = span(values.flat(2), state), height = scaled(state, range[0]);
  const share = (value) => (height(value) - range[0]) / (range[1] - range[0]);
  const marks = ticks(range, state).map(([at, text]) => [(at - range[0]) / (range[1] - range[0]), text]);
  const { phi_i: turned } = answers[0], end = answers[0].axes_deg.theta_r[kept[0].at(-1)];
  const scenes = answers.map((answer, i) => {
    const { theta_r, delta_phi } = answer.axes_deg;
    const scene = { points: [], pieces: [] };
    surface(scene, kept[i].map((k) => theta_r[k]), delta_phi.map((each) => turned + each), values[i].map((row) => row.map(share)));
    line(scene, towards(0, 0, 1), "grid", 1);
    line(scene, towards(state.theta_i, turned, 1), "third", 3);
    line(scene, towards(state.theta_i, turned + 180, 1), "muted", 1.5);
    return scene;
  });
  const stands = element("div", { className: "side" }, ...series.map(({ label }) =>
    element("figure", {}, element("canvas"), element("figcaption", { className: "quiet" }, series.length > 1 ? label : ""))));
  into.replaceChildren(stands, bar(marks));
  const canvases = [...stands.querySelectorAll("canvas")];
  repaint = () => canvases.forEach((canvas, i) => paint(canvas, scenes[i], marks));
  repaint();
  const scale = state.scale === "log" ? `its logarithm, from ${short(10 ** range[0])}` : "the value itself, from 0";
  return `${quantityWords(series[0], state)} in 1/sr over all viewers to θᵣ = ${end}°: the distance from the centre is ${scale}. ` +
    `The thick line points to the light, the thin one to its mirror direction. Drag it or use arrow keys to turn it.` +
    mirrorWords(series, answers);
}

/** Let a hand and keys turn what is drawn into an element. */
function turns(into) {
  into.tabIndex = 0;
  const turn = (azimuth, elevation) => {
    camera.azimuth -= azimuth;
    camera.elevation = Math.min(Math.max(camera.elevation + elevation, 5), 88);
    repaint();
  };
  into.addEventListener("pointerdown", (event) => into.setPointerCapture(event.pointerId));
  into.addEventListener("pointermove", ({ buttons, movementX, movementY }) => {
    if (buttons) turn(PER_PIXEL * movementX, PER_PIXEL * movementY);
  });
  into.addEventListener("keydown", (event) => {
    const { key } = event;
    const by = { ArrowLeft: [-PER_KEY, 0], ArrowRight: [PER_KEY, 0], ArrowUp: [0, -PER_KEY], ArrowDown: [0, PER_KEY] }[key];
    if (key === "Home") Object.assign(camera, START);
    else if (!by) return;
    turn(...(by ?? [0, 0]));
    event.preventDefault();
  });
}

const towards = (theta, phi, r) => [
  r * Math.sin(theta * RADIAN) * Math.cos(phi * RADIAN), r * Math.sin(theta * RADIAN) * Math.sin(phi * RADIAN),
  r * Math.cos(theta * RADIAN)];

/** Four-cornered pieces of a surface at angles [degrees]; their corners are numbers of points. */
function surface({ points, pieces }, thetas, phis, radii) {
  radii.forEach((row, j) => row.forEach((r, k) => points.push(towards(thetas[j], phis[k], r))));
  const along = phis.length;
  for (let j = 1; j < thetas.length; j += 1) {
    for (let k = 1; k < along; k += 1) {
      const last = j * along + k, corners = [last - along - 1, last - 1, last, last - along];
      const share = (radii[j - 1][k - 1] + radii[j][k - 1] + radii[j][k] + radii[j - 1][k]) / 4;
      pieces.push({ corners, colour: colour(share, shade(...corners.map((at) => points[at]))) });
    }
  }
}

/** How bright a piece is: by how much it faces the lamp, from either side. */
function shade(a, b, c, d) {
  const ux = c[0] - a[0], uy = c[1] - a[1], uz = c[2] - a[2];
  const vx = d[0] - b[0], vy = d[1] - b[1], vz = d[2] - b[2];
  const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  return 0.72 + (0.28 * Math.abs(x * LAMP[0] + y * LAMP[1] + z * LAMP[2])) / (Math.hypot(x, y, z) || 1);
}

function colour(share, light) {
  const at = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1), low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  const mixed = (i) => Math.round(light * (VIRIDIS[low][i] + (at - low) * (VIRIDIS[low + 1][i] - VIRIDIS[low][i])));
  return `rgb(${mixed(0)},${mixed(1)},${mixed(2)})`;
}

/** Pieces of a line from the centre, in a colour of the page. */
function line({ points, pieces }, end, ink, width) {
  const first = points.length;
  for (let i = 0; i <= STEPS; i += 1) points.push(end.map((value) => (value * i) / STEPS));
  for (let i = first; i < first + STEPS; i += 1) pieces.push({ corners: [i, i + 1], ink, width });
}

/** Paint pieces from the far ones to the near ones, over rings at the marks of the scale. */
function paint(canvas, { points, pieces }, marks) {
  const { clientWidth: width, clientHeight: high } = canvas;
  Object.assign(canvas, { width: width * devicePixelRatio, height: high * devicePixelRatio });
  const css = getComputedStyle(canvas), ink = (name) => css.getPropertyValue(`--${name}`).trim();
  const [[sa, ca], [se, ce]] = [camera.azimuth, camera.elevation].map((each) => [Math.sin(each * RADIAN), Math.cos(each * RADIAN)]);
  const scale = Math.min(width / (2 * ROUND), high / (1.25 + se));
  const down = 1.1 * scale + (high - (1.25 + se) * scale) / 2;
  const place = ([x, y, z]) => [width / 2 + scale * (ca * y - sa * x), down - scale * (ce * z - se * (ca * x + sa * y))];
  const depth = ([x, y, z]) => ce * (ca * x + sa * y) + se * z;

  const context = canvas.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.strokeStyle = ink("grid");
  for (const [share] of marks) {
    context.beginPath();
    context.ellipse(width / 2, down, share * scale, share * scale * se, 0, 0, 2 * Math.PI);
    context.stroke();
  }
  context.fillStyle = ink("muted");
  context.font = `12px ${css.fontFamily}`;
  context.textAlign = "center";
  for (const [text, end] of [["+x", [1, 0, 0]], ["+y", [0, 1, 0]], ["", [-1, 0, 0]], ["", [0, -1, 0]]]) {
    trace(context, [place([0, 0, 0]), place(end)]);
    context.stroke();
    const [x, y] = place(end.map((each) => 1.07 * each));
    context.fillText(text, x, y + 4);
  }
  const [x, y] = place([0, 0, 1.04]);
  context.fillText("normal", x, y);
  context.lineCap = context.lineJoin = "round";
  const places = points.map(place), depths = points.map(depth);
  for (const each of pieces) each.depth = each.corners.reduce((sum, at) => sum + depths[at], 0) / each.corners.length;
  for (const { corners, colour: fill, ink: name, width: thick = 0.8 } of pieces.sort((a, b) => a.depth - b.depth)) {
    trace(context, corners.map((at) => places[at]));
    context.strokeStyle = fill ?? ink(name);
    context.lineWidth = thick;
    context.stroke(); // around surfaces, too: there are gaps between them otherwise
    if (!fill) continue;
    context.fillStyle = fill;
    context.fill();
  }
}

function trace(context, places) {
  context.beginPath();
  for (const [x, y] of places) context.lineTo(x, y); // the first one begins
}

/** What colours mean: a bar with the marks of the scale. */
function bar(marks) {
  const stripe = element("div", { className: "stripe" });
  stripe.style.background = `linear-gradient(to right, ${VIRIDIS.map((each) => `rgb(${each})`)})`;
  const texts = marks.map(([share, text]) => {
    const mark = element("span", {}, text);
    mark.style.left = `${100 * share}%`;
    return mark;
  });
  return element("div", { className: "bar quiet" }, stripe, ...texts);
}
