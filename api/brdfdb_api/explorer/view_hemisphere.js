// The lobe: f_r over all viewers as the distance from the centre; a hand moves the light or turns the picture.

import { json } from "./api.js";
import { element, ink, short } from "./dom.js";
import { colourBar, mapped, scaled, span, specularWords, ticks } from "./scales.js";
import { anisotropic, azimuth, lobe, number, quantity, quantityWords, question } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {[number, number, number]} Vector */
/** @typedef {{ corners: number[], colour?: string, ink?: string, width?: number, depth?: number }} Piece corners are
 *   numbers of points */
/** @typedef {{ points: Vector[], pieces: Piece[] }} Scene */

const RADIAN = Math.PI / 180;
const START = { azimuth: 115, elevation: 27 }; // degrees: the light of phi_i = 0 is at the left, as in the cut
const LAMP = [0.3, 0.5, 0.81]; // that shades the surface, so that its form is seen
const ROUND = 1.15; // half the width of the picture, in radii
const STEPS = 24; // a line goes in and out of the surface in so many pieces
const [PER_PIXEL, PER_KEY, NEAR] = [0.5, 5, 24]; // degrees, degrees, and pixels from the light in which a hand takes it
const OFF = [1, 2, 3, 5, 8, 12]; // degrees from the mirror direction of more viewers
const LAST = 88; // degrees: of the viewers next to the horizon, where models have poles that no scale can show

const camera = { ...START };
let repaint = () => {}; // what is shown, from where the camera is now
let light = { theta: 0, phi: 0 }; // of what is shown [degrees]

/** @type {import("./main.js").View} */
export default {
  name: "hemisphere",
  title: "Lobe",
  order: 2,
  turned: true,
  draw: hemisphere,
  begin: turns,
  request: (each, state, series) => lobe("hemisphere", each, state, series),
  answer: async (each, state, series, signal) => ({
    ...(await json(asked(each, state, series), signal)),
    grid: grid(state, series),
  }),
};

/** The angles of all viewers [degrees], closer together around the mirror direction; of what is isotropic one half.
 * @param {State} state
 * @param {Series[]} series */
function grid({ theta_i, quick }, series) {
  const every = quick ? 2 : 1,
    around = [-1, 1].flatMap((sign) => OFF.filter((_, i) => i % every === 0).map((each) => sign * each)),
    wide = Math.max(Math.sin(theta_i * RADIAN), 0.15);
  const within = (/** @type {number[]} */ values, /** @type {number} */ end) =>
    [...new Set(values.filter((value) => value >= 0 && value <= end))].sort((a, b) => a - b);
  const theta_r = within(
    [...Array.from({ length: 23 }, (_, i) => 4 * every * i), theta_i, ...around.map((each) => theta_i + each), LAST],
    LAST,
  );
  const end = anisotropic(series) ? 360 : 180;
  const turn = within(
    [...Array.from({ length: 73 }, (_, i) => 5 * every * i), ...around.map((each) => 180 + each / wide)],
    end,
  );
  return { theta_r, turn };
}

/** @param {Series} each
 * @param {State} state
 * @param {Series[]} series */
function asked(each, state, series) {
  const { theta_r, turn } = grid(state, series),
    phi_i = azimuth(state, series) ?? 0;
  const angles = {
    theta_i: state.theta_i,
    phi_i,
    theta_r: theta_r.map((theta) => [theta]),
    phi_r: turn.map((by) => phi_i + by),
  };
  return question(each, "lookup", quantity(each, state), angles);
}

/** Draw the lobe of each series into an element; the caption.
 * @param {HTMLElement} into
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
function hemisphere(into, series, answers, state) {
  const { theta_r, turn } = answers[0].grid,
    half = turn[turn.length - 1] === 180;
  /** @type {number[][][]} */
  const values = answers.map((answer) => answer.brdf.map((/** @type {any[]} */ row) => row.map(number(answer))));
  const range = span(values.flat(2), state),
    height = scaled(state, range[0]);
  const share = (/** @type {number} */ value) => (height(value) - range[0]) / (range[1] - range[0]);
  /** @type {[number, string][]} */
  const marks = ticks(range, state).map(([at, text]) => [(at - range[0]) / (range[1] - range[0]), text]);
  const specular = answers.map((answer) =>
    answer.specular_reflectance ? number(answer)(answer.specular_reflectance) : 0,
  );
  const across = half
    ? [
        ...turn,
        ...turn
          .slice(0, -1)
          .reverse()
          .map((/** @type {number} */ each) => 360 - each),
      ]
    : turn;
  const scenes = values.map((rows, i) => {
    /** @type {Scene} */
    const scene = { points: [], pieces: [] };
    const whole = rows.map((row) => (half ? [...row, ...row.slice(0, -1).reverse()] : row));
    surface(
      scene,
      theta_r,
      across.map((/** @type {number} */ each) => state.phi_i + each),
      whole.map((row) => row.map(share)),
    );
    line(scene, towards(0, 0, 1), "grid", 1);
    line(scene, towards(state.theta_i, state.phi_i, 1), "third", 3);
    line(scene, towards(state.theta_i, state.phi_i + 180, 1), specular[i] ? "spike" : "muted", specular[i] ? 4 : 1.5);
    return scene;
  });
  light = { theta: state.theta_i, phi: state.phi_i };
  const stands = element(
    "div",
    { className: "side" },
    ...series.map(({ label }) =>
      element(
        "figure",
        {},
        element("canvas"),
        element("figcaption", { className: "quiet" }, series.length > 1 ? label : ""),
      ),
    ),
  );
  into.replaceChildren(stands, colourBar(marks));
  const canvases = [...stands.querySelectorAll("canvas")];
  repaint = () => canvases.forEach((canvas, i) => paint(canvas, scenes[i], marks));
  repaint();
  const scale = state.scale === "log" ? `its logarithm, from ${short(10 ** range[0])}` : "the value itself, from 0";
  return (
    `${quantityWords(series[0], state)} in 1/sr over all viewers to θᵣ = ${LAST}°: ` +
    `the distance from the centre is ${scale}. ` +
    "Drag the light to move it, or any other point to turn the picture; arrow keys turn it, too." +
    specularWords(series, specular)
  );
}

/** Let a hand move the light, and hand and keys turn what is drawn into an element.
 * @param {HTMLElement} into
 * @param {(part: Partial<State>) => void} choose */
function turns(into, choose) {
  into.tabIndex = 0;
  let [moving, turning] = [false, false];
  const turn = (/** @type {number} */ around, /** @type {number} */ elevation) => {
    camera.azimuth -= around;
    camera.elevation = Math.min(Math.max(camera.elevation + elevation, 5), 88);
    repaint();
  };
  into.addEventListener("pointerdown", (event) => {
    const canvas = event.target instanceof HTMLCanvasElement ? event.target : null;
    if (!canvas) return;
    const { left, top } = canvas.getBoundingClientRect(),
      [x, y] = projection(canvas).place(towards(light.theta, light.phi, 1));
    moving = Math.hypot(event.clientX - left - x, event.clientY - top - y) < NEAR;
    turning = !moving;
    into.setPointerCapture(event.pointerId);
  });
  into.addEventListener("pointermove", (event) => {
    if (turning) turn(PER_PIXEL * event.movementX, PER_PIXEL * event.movementY);
    const canvas = moving && into.querySelector("canvas");
    if (!canvas) return;
    const { left, top } = canvas.getBoundingClientRect();
    const [x, y, z] = projection(canvas).back(event.clientX - left, event.clientY - top);
    const phi = Math.round(Math.atan2(y, x) / RADIAN);
    choose({ theta_i: Math.round(2 * Math.min(Math.acos(z) / RADIAN, 89.5)) / 2, phi_i: (phi + 360) % 360 });
  });
  for (const end of /** @type {const} */ (["pointerup", "pointercancel"]))
    into.addEventListener(end, () => {
      moving = turning = false;
    });
  into.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-PER_KEY, 0], ArrowRight: [PER_KEY, 0], ArrowUp: [0, -PER_KEY], ArrowDown: [0, PER_KEY] }[
      event.key
    ];
    if (event.key === "Home") Object.assign(camera, START);
    else if (!by) return;
    turn(by?.[0] ?? 0, by?.[1] ?? 0);
    event.preventDefault();
  });
}

/** @param {number} theta
 * @param {number} phi
 * @param {number} r
 * @returns {Vector} */
const towards = (theta, phi, r) => [
  r * Math.sin(theta * RADIAN) * Math.cos(phi * RADIAN),
  r * Math.sin(theta * RADIAN) * Math.sin(phi * RADIAN),
  r * Math.cos(theta * RADIAN),
];

/** Four-cornered pieces of a surface at angles [degrees].
 * @param {Scene} scene
 * @param {number[]} thetas
 * @param {number[]} phis
 * @param {number[][]} radii */
function surface({ points, pieces }, thetas, phis, radii) {
  radii.forEach((row, j) => row.forEach((r, k) => points.push(towards(thetas[j], phis[k], r))));
  const along = phis.length;
  for (let j = 1; j < thetas.length; j += 1) {
    for (let k = 1; k < along; k += 1) {
      const last = j * along + k,
        corners = [last - along - 1, last - 1, last, last - along];
      const mean = (radii[j - 1][k - 1] + radii[j][k - 1] + radii[j][k] + radii[j - 1][k]) / 4;
      pieces.push({ corners, colour: `rgb(${mapped(mean, shade(corners.map((at) => points[at])))})` });
    }
  }
}

/** How bright a piece is: by how much it faces the lamp, from either side.
 * @param {Vector[]} corners */
function shade([a, b, c, d]) {
  const ux = c[0] - a[0],
    uy = c[1] - a[1],
    uz = c[2] - a[2];
  const vx = d[0] - b[0],
    vy = d[1] - b[1],
    vz = d[2] - b[2];
  const x = uy * vz - uz * vy,
    y = uz * vx - ux * vz,
    z = ux * vy - uy * vx;
  return 0.72 + (0.28 * Math.abs(x * LAMP[0] + y * LAMP[1] + z * LAMP[2])) / (Math.hypot(x, y, z) || 1);
}

/** Pieces of a line from the centre, in a colour of the page.
 * @param {Scene} scene
 * @param {Vector} end
 * @param {string} name
 * @param {number} width */
function line({ points, pieces }, end, name, width) {
  const first = points.length;
  for (let i = 0; i <= STEPS; i += 1) points.push([(end[0] * i) / STEPS, (end[1] * i) / STEPS, (end[2] * i) / STEPS]);
  for (let i = first; i < first + STEPS; i += 1) pieces.push({ corners: [i, i + 1], ink: name, width });
}

/** How a canvas shows points, from where the camera is.
 * @param {HTMLCanvasElement} canvas */
function projection({ clientWidth: width, clientHeight: high }) {
  const [[sa, ca], [se, ce]] = [camera.azimuth, camera.elevation].map((each) => [
    Math.sin(each * RADIAN),
    Math.cos(each * RADIAN),
  ]);
  const scale = Math.min(width / (2 * ROUND), high / (1.25 + se)),
    down = 1.1 * scale + (high - (1.25 + se) * scale) / 2;
  return {
    scale,
    down,
    flat: se,
    /** @type {(point: Vector) => [number, number]} */
    place: ([x, y, z]) => [width / 2 + scale * (ca * y - sa * x), down - scale * (ce * z - se * (ca * x + sa * y))],
    /** @type {(point: Vector) => number} */
    depth: ([x, y, z]) => ce * (ca * x + sa * y) + se * z,
    /** The direction above the horizon that is shown at a point, the nearer one of two. @type {(x: number, y:
     *   number) => Vector} */
    back: (x, y) => {
      let right = (x - width / 2) / scale,
        up = (down - y) / scale;
      const size = Math.hypot(right, up);
      if (size > 1) [right, up] = [right / size, up / size];
      const near = Math.sqrt(Math.max(1 - right * right - up * up, 0));
      const forward = ce * near - se * up,
        z = Math.max(ce * up + se * near, 0);
      const length = Math.hypot(forward, right, z) || 1;
      return [(ca * forward - sa * right) / length, (sa * forward + ca * right) / length, z / length];
    },
  };
}

/** Paint pieces from the far ones to the near ones, over rings at the marks of the scale.
 * @param {HTMLCanvasElement} canvas
 * @param {Scene} scene
 * @param {[number, string][]} marks */
function paint(canvas, { points, pieces }, marks) {
  const { clientWidth: width, clientHeight: high } = canvas,
    context = canvas.getContext("2d");
  if (!context) return;
  Object.assign(canvas, { width: width * devicePixelRatio, height: high * devicePixelRatio });
  const { scale, down, flat, place, depth } = projection(canvas);
  context.scale(devicePixelRatio, devicePixelRatio);
  context.strokeStyle = ink("grid");
  for (const [share] of marks) {
    context.beginPath();
    context.ellipse(width / 2, down, share * scale, share * scale * flat, 0, 0, 2 * Math.PI);
    context.stroke();
  }
  context.fillStyle = ink("muted");
  context.font = `12px ${getComputedStyle(canvas).fontFamily}`;
  context.textAlign = "center";
  /** @type {[string, Vector][]} */
  const axes = [
    ["+x", [1, 0, 0]],
    ["+y", [0, 1, 0]],
    ["", [-1, 0, 0]],
    ["", [0, -1, 0]],
  ];
  for (const [text, end] of axes) {
    trace(context, [place([0, 0, 0]), place(end)]);
    context.stroke();
    const [x, y] = place([1.07 * end[0], 1.07 * end[1], 0]);
    context.fillText(text, x, y + 4);
  }
  const [x, y] = place([0, 0, 1.04]);
  context.fillText("normal", x, y);
  context.lineCap = context.lineJoin = "round";
  const places = points.map(place),
    depths = points.map(depth);
  const sorted = pieces
    .map((each) => ({ ...each, depth: each.corners.reduce((sum, at) => sum + depths[at], 0) / each.corners.length }))
    .sort((a, b) => a.depth - b.depth);
  for (const { corners, colour: fill, ink: name, width: thick = 0.8 } of sorted) {
    trace(
      context,
      corners.map((at) => places[at]),
    );
    context.strokeStyle = fill ?? ink(name ?? "muted");
    context.lineWidth = thick;
    context.stroke(); // around surfaces, too: there are gaps between them otherwise
    if (!fill) continue;
    context.fillStyle = fill;
    context.fill();
  }
  const [u, v] = place(towards(light.theta, light.phi, 1));
  context.beginPath();
  context.arc(u, v, 7, 0, 2 * Math.PI);
  context.fillStyle = ink("third");
  context.fill();
}

/** @param {CanvasRenderingContext2D} context
 * @param {[number, number][]} places */
function trace(context, places) {
  context.beginPath();
  for (const [x, y] of places) context.lineTo(x, y); // the first one begins
}
