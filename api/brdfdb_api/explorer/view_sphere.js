// A sphere of the material, lit from one direction and looked at from far away, drawn pixel by pixel.

import { address, lookup } from "./api.js";
import { element } from "./dom.js";
import { unseenWords } from "./scales.js";
import { azimuth, quantity } from "./series.js";

const SIZE = 96; // pixels across
const DEGREE = 180 / Math.PI;

const WORDS = "The viewer is far above the page; the light is θᵢ away from the viewer, to the right (+x) at φᵢ = 0 and to the " +
  "top (+y) at 90°, and as bright as makes a white matt surface white. The x axis of the surface runs around the vertical " +
  "axis of the sphere.";
const MIRROR = " The mirror image, a specular part, is not drawn.";

export default {
  name: "sphere",
  title: "Sphere",
  order: 6,
  place: "spheres",
  idle: ["log"],
  turned: true, // phi_i moves the light, of isotropic materials, too
  /** Of the middle of the sphere, to be copied: the picture takes thousands of directions. */
  request(each, state, series) {
    const { theta_i } = state, phi_i = azimuth(state, series);
    const phi_r = ((phi_i ?? 0) + state.turn) % 360;
    return address(each.name, "lookup", { theta_i, phi_i, theta_r: 0, phi_r, ...quantity(each, state, "linear-srgb") });
  },
  /** What the service says of all lit pixels of a series. */
  answer: (each, state, signal) =>
    lookup(each.name, quantity(each, state, "linear-srgb"), geometry(state).directions, signal),
  draw: spheres,
};

/** Draw the sphere of each series into an element; the caption. */
function spheres(into, series, answers, state) {
  const scene = geometry(state);
  while (into.children.length < answers.length) into.append(made());
  while (into.children.length > answers.length) into.lastChild.remove();
  answers.forEach(({ values }, i) => {
    const [canvas, label] = into.children[i].children;
    paint(canvas, values, scene);
    label.textContent = series.length > 1 ? series[i].label : "";
  });
  return WORDS + (series.some(({ info }) => info.specular) ? MIRROR : "") + unseenWords(series[0], state);
}

function made() {
  const canvas = element("canvas", { width: SIZE, height: SIZE });
  return element("figure", {}, canvas, element("figcaption", { className: "quiet" }));
}

/** Lit pixels: directions [degrees], four numbers each, places, and cosines at the light. */
function geometry({ theta_i: theta, phi_i: phi }) {
  const sine = Math.sin(theta / DEGREE);
  const light = [sine * Math.cos(phi / DEGREE), sine * Math.sin(phi / DEGREE), Math.cos(theta / DEGREE)];
  const directions = [], pixels = [], cosines = [];
  for (let row = 0; row < SIZE; row += 1) {
    for (let column = 0; column < SIZE; column += 1) {
      const x = (2 * column + 1) / SIZE - 1, y = 1 - (2 * row + 1) / SIZE;
      const z = Math.sqrt(1 - x * x - y * y); // the normal; the viewer is at (0, 0, 1)
      const cosine = x * light[0] + y * light[1] + z * light[2];
      if (!(cosine > 0)) continue; // past the limb z is not a number
      const across = Math.hypot(x, z); // the tangent runs around the vertical axis: (z, 0, -x) / across
      const tangent = (v) => (z * v[0] - x * v[2]) / across;
      const upward = (v) => (-x * y * v[0] + across * across * v[1] - y * z * v[2]) / across;
      const azimuth = (v) => Math.atan2(upward(v), tangent(v)) * DEGREE;
      directions.push(Math.acos(Math.min(cosine, 1)) * DEGREE, azimuth(light), Math.acos(z) * DEGREE, azimuth([0, 0, 1]));
      pixels.push(row * SIZE + column);
      cosines.push(cosine);
    }
  }
  return { directions: new Float32Array(directions), pixels, cosines };
}

function paint(canvas, values, { pixels, cosines }) {
  const context = canvas.getContext("2d"), image = context.createImageData(SIZE, SIZE);
  const channels = values.length / pixels.length; // three, or one that is grey
  pixels.forEach((pixel, i) => {
    for (let channel = 0; channel < 3; channel += 1) {
      const f_r = values[i * channels + (channels === 3 ? channel : 0)];
      image.data[4 * pixel + channel] = encoded(Math.PI * f_r * cosines[i]);
    }
    image.data[4 * pixel + 3] = 255;
  });
  context.putImageData(image, 0, 0);
}

/** A byte of sRGB (IEC 61966-2-1). */
function encoded(linear) {
  const value = Math.min(Math.max(linear, 0), 1);
  return Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));
}
