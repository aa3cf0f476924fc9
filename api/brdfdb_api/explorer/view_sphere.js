// A sphere of the material in a light and its surroundings, looked at from far away, drawn pixel by pixel.

import { json, values } from "./api.js";
import { element } from "./dom.js";
import { unseenWords } from "./scales.js";
import { anisotropic, azimuth, quantity, question } from "./series.js";
import { add, between, lightOf, lune, moments, surroundings } from "./sphere_scene.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {{ viewers: number[], moments: Float64Array, specular: number[][] | null }} Around */

const SIZE = 320,
  QUICK = 160; // pixels across, and while a slider moves
const [DARK, BRIGHT, MOST_EV] = [0.03, 0.5, 8]; // largest linear value that is hardly seen; one to brighten it to
const KEPT = 16; // surroundings, which stay the same while the light moves
const ENCODED = Uint8Array.from({ length: 4097 }, (_, i) => {
  // bytes of sRGB (IEC 61966-2-1)
  const value = i / 4096;
  return Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));
});

const WORDS =
  "The viewer is far above the page. The light is θᵢ away from the viewer, to the right (+x) at φᵢ = 0 and to the " +
  "top (+y) at 90°, and so bright that a white matt surface appears white. Drag the light to move it. " +
  "The x axis of the surface runs around the vertical axis of the sphere.";
const STUDIO = "The viewer is far above the page. The light is that of a studio; the specular part reflects it, too.";
const SKY = " The surroundings are bright above and black below.";
const SPECULAR = " The specular part reflects them and the light, a disk of 5°.";

/** @type {Map<string, Promise<Around>>} */
const known = new Map();

/** @type {import("./main.js").View} */
export default {
  name: "sphere",
  title: "Sphere",
  order: 6,
  idle: ["log"],
  lit: true,
  turned: true,
  /** Of the middle of the sphere, to be copied: the picture takes hundreds of directions. */
  request(each, state, series) {
    const { theta_i } = state,
      phi_i = azimuth(state, series),
      phi_r = ((phi_i ?? 0) + state.turn) % 360;
    return question(each, "lookup", { theta_i, phi_i, theta_r: 0, phi_r, ...quantity(each, state, "linear-srgb") });
  },
  answer,
  draw: spheres,
  begin: moves,
};

/** What the service says of a light, and of the surroundings; or its picture in a studio.
 * @param {Series} each
 * @param {State} state
 * @param {Series[]} _
 * @param {AbortSignal} signal */
async function answer(each, state, _, signal) {
  if (state.surround === "studio")
    return values(question(each, "sphere", { size: SIZE, format: "npy" }), SIZE * SIZE, signal);
  const { angles, ...of } = lune(lightOf(state), anisotropic([each]), Boolean(state.quick)),
    query = quantity(each, state, "linear-srgb");
  const [lit, around] = await Promise.all([
    values(question(each, "lookup", query, angles), angles.theta_i.length, signal),
    aroundOf(each, query, Boolean(state.quick), signal),
  ]);
  return { ...lit, of, around };
}

/** @param {Series} each
 * @param {Record<string, unknown>} query
 * @param {boolean} quick
 * @param {AbortSignal} signal
 * @returns {Promise<Around>} */
function aroundOf(each, query, quick, signal) {
  const key = (/** @type {boolean} */ hurried) => JSON.stringify([each.text, each.info.digest, query, hurried]);
  return known.get(key(false)) ?? known.get(key(quick)) ?? kept(key(quick), summed(each, query, quick, signal));
}

/** @param {string} key
 * @param {Promise<Around>} found */
function kept(key, found) {
  known.set(key, found);
  found.catch(() => known.delete(key));
  for (const old of [...known.keys()].slice(0, -KEPT)) known.delete(old);
  return found;
}

/** @param {Series} each
 * @param {Record<string, unknown>} query
 * @param {boolean} quick
 * @param {AbortSignal} signal
 * @returns {Promise<Around>} */
async function summed(each, query, quick, signal) {
  const scene = surroundings(anisotropic([each]) ? [0, 45, 90, 135] : [0], quick);
  const found = await json(question(each, "lookup", query, scene.angles), signal),
    part = found.specular_reflectance;
  const specular =
    part &&
    part
      .filter((/** @type {unknown} */ _, /** @type {number} */ i) => i % scene.count === 0)
      .map((/** @type {any[]} */ row) => (Array.isArray(row[0]) ? row[0] : [row[0], row[0], row[0]]));
  return { viewers: scene.viewers, moments: moments(scene, found.brdf.flat(2)), specular };
}

/** Draw the sphere of each series into an element; the caption.
 * @param {HTMLElement} into
 * @param {Series[]} series
 * @param {any[]} answers
 * @param {State} state */
function spheres(into, series, answers, state) {
  while (into.children.length < answers.length) {
    into.append(
      element(
        "figure",
        {},
        element("canvas", { width: SIZE, height: SIZE }),
        element("figcaption", { className: "quiet" }),
      ),
    );
  }
  while (into.children.length > answers.length) into.lastChild?.remove();
  answers.forEach((found, i) => {
    const [canvas, label] = into.children[i].children;
    const seen = canvas instanceof HTMLCanvasElement ? (found.around ? paint : develop)(canvas, found, state) : 1;
    label.replaceChildren(series.length > 1 ? series[i].label : "", ...(seen < DARK ? brightened(seen, state) : []));
  });
  const specular = answers.some(({ around }) =>
    around?.specular?.flat().some((/** @type {number} */ part) => part > 0),
  );
  if (state.surround === "studio")
    return STUDIO + (series.some(({ info }) => info.measured?.glints) ? " Glints are left out." : "");
  return WORDS + (state.surround === "sky" ? SKY : "") + (specular ? SPECULAR : "") + unseenWords(series[0], state);
}

/** What is said of a sphere that is nearly black, with a button that brightens it.
 * @param {number} seen its largest linear value
 * @param {State} state */
function brightened(seen, { exposure }) {
  const ev = Math.min(Math.ceil(exposure + Math.log2(BRIGHT / Math.max(seen, 1e-9))), MOST_EV);
  if (ev <= exposure) return [];
  const button = element("button", { type: "button" }, `Show at +${ev} EV`);
  button.dataset.exposure = String(ev);
  return [element("p", {}, "Nearly black compared with a white surface"), button];
}

/** Paint a sphere; its largest linear value.
 * @param {HTMLCanvasElement} canvas
 * @param {{ values: ArrayLike<number>, of: { rays: number, rings: number, turn: number }, around: Around }} found
 * @param {State} state */
function paint(canvas, { values: f_r, of: nodes, around }, state) {
  const size = state.quick ? QUICK : SIZE,
    context = canvas.getContext("2d"),
    image = context?.createImageData(size, size);
  if (!context || !image) return 0;
  let most = 0;
  Object.assign(canvas, { width: size, height: size });
  const light = lightOf(state),
    of = { ...around, moments: state.surround === "sky" ? around.moments : null };
  const at = between(light, f_r, nodes),
    seen = new Float64Array(3),
    bright = 4096 * 2 ** state.exposure;
  for (let row = 0; row < size; row += 1) {
    for (let column = 0; column < size; column += 1) {
      const x = (2 * column + 1) / size - 1,
        y = 1 - (2 * row + 1) / size,
        inside = 1 - x * x - y * y;
      if (inside <= 0) continue;
      const z = Math.sqrt(inside),
        cosine = x * light[0] + y * light[1] + z * light[2],
        pixel = 4 * (row * size + column);
      if (cosine > 0) {
        at(x, y, z, seen);
        for (let k = 0; k < 3; k += 1) seen[k] *= Math.PI * cosine;
      } else {
        seen.fill(0);
      }
      add(x, y, z, light, of, seen);
      most = Math.max(most, seen[0], seen[1], seen[2]);
      for (let k = 0; k < 3; k += 1)
        image.data[pixel + k] = ENCODED[Math.round(Math.min(Math.max(bright * seen[k], 0), 4096))];
      image.data[pixel + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return most * 2 ** state.exposure;
}

/** Show a picture of linear colours and their coverage; its largest linear value.
 * @param {HTMLCanvasElement} canvas
 * @param {{ values: ArrayLike<number> }} found
 * @param {State} state */
function develop(canvas, { values: linear }, { exposure }) {
  const context = canvas.getContext("2d"),
    image = context?.createImageData(SIZE, SIZE),
    bright = 4096 * 2 ** exposure;
  if (!context || !image) return 0;
  let most = 0;
  Object.assign(canvas, { width: SIZE, height: SIZE });
  for (let i = 0; i < linear.length; i += 1) {
    if (i % 4 < 3) most = Math.max(most, linear[i]);
    image.data[i] =
      i % 4 === 3 ? 255 * linear[i] : ENCODED[Math.round(Math.min(Math.max(bright * linear[i], 0), 4096))];
  }
  context.putImageData(image, 0, 0);
  return most * 2 ** exposure;
}

/** Let a hand and arrow keys move the light over the sphere.
 * @param {HTMLElement} into
 * @param {(part: Partial<State>) => void} choose
 * @param {() => State} now */
function moves(into, choose, now) {
  into.tabIndex = 0;
  const move = (/** @type {PointerEvent} */ event) => {
    const canvas = event.target instanceof HTMLCanvasElement ? event.target : into.querySelector("canvas");
    if (!canvas || !event.buttons) return;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - left)) / width - 1,
      y = 1 - (2 * (event.clientY - top)) / height,
      size = Math.min(Math.hypot(x, y), 1);
    const phi = Math.round((Math.atan2(y, x) * 180) / Math.PI);
    // the light is where the hand sees its mirror image: the normal there lies half way
    choose({
      theta_i: Math.min(Math.round(4 * Math.asin(size) * (180 / Math.PI)) / 2, 89.5),
      phi_i: (phi + 360) % 360,
    });
  };
  into.addEventListener("pointerdown", (event) => {
    if (!(event.target instanceof HTMLCanvasElement)) return;
    into.setPointerCapture(event.pointerId);
    move(event);
  });
  into.addEventListener("click", ({ target }) => {
    if (target instanceof HTMLButtonElement) choose({ exposure: Number(target.dataset.exposure) });
  });
  into.addEventListener("pointermove", move);
  into.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [0, 5], ArrowRight: [0, -5], ArrowUp: [5, 0], ArrowDown: [-5, 0] }[event.key];
    if (!by) return;
    const { theta_i, phi_i } = now();
    choose({ theta_i: Math.min(Math.max(theta_i + by[0], 0), 89.5), phi_i: (phi_i + by[1] + 360) % 360 });
    event.preventDefault();
  });
}
