// The scene of a sphere: the directions that its pixels need, and what is seen of light, surroundings and mirror.

/** @typedef {[number, number, number]} Vector x to the right, y up, z to the viewer */

const DEGREE = 180 / Math.PI;
const RHO = 2.5 / DEGREE; // angular radius of the light, which only a specular part shows
const RADIANCE = 1 / (2 * (1 - Math.cos(RHO))); // over that of a white matt surface that faces the light
/** @typedef {{ rings: number, rays: number, viewers: number[], far: number, around: number }} Detail rings and rays:
 *   directions
 *   around the half vector, along half a turn; viewers [degrees] of which the surroundings are summed, over lights
 *   far and around */
/** @type {Detail} */
const FINE = { rings: 40, rays: 25, viewers: [0, 15, 30, 42, 52, 60, 67, 73, 78, 82, 85, 87.5], far: 20, around: 10 };
/** @type {Detail} */
const QUICK = { rings: 22, rays: 13, viewers: [0, 30, 52, 67, 78, 87.5], far: 12, around: 8 };
const EDGE = 0.99; // of the way to the horizon of light or viewer, next to which models have poles
const SKY = 0.35; // what is seen of the surroundings at the height of the eye, over a white matt surface in the light

const dot = (/** @type {Vector} */ a, /** @type {Vector} */ b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (/** @type {Vector} */ a, /** @type {Vector} */ b) =>
  /** @type {Vector} */ ([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]);
const unit = (/** @type {Vector} */ a) => {
  const size = Math.hypot(...a) || 1;
  return /** @type {Vector} */ ([a[0] / size, a[1] / size, a[2] / size]);
};
const round = (/** @type {number} */ value) => Number(value.toFixed(5));

/** The frame of a light and a viewer at (0, 0, 1): the half vector, where from it the light is, and across.
 * @param {Vector} light */
function frameOf(light) {
  const half = unit([light[0], light[1], light[2] + 1]),
    cosine = dot(half, light),
    sine = Math.sqrt(Math.max(1 - cosine * cosine, 0));
  const towards =
    sine > 1e-6
      ? unit([light[0] - cosine * half[0], light[1] - cosine * half[1], light[2] - cosine * half[2]])
      : /** @type {Vector} */ ([1, 0, 0]);
  return { half, towards, across: cross(half, towards), tangent: sine / cosine };
}

/** The light of angles [degrees].
 * @param {{ theta_i: number, phi_i: number }} state
 * @returns {Vector} */
export function lightOf({ theta_i: theta, phi_i: phi }) {
  const sine = Math.sin(theta / DEGREE);
  return [sine * Math.cos(phi / DEGREE), sine * Math.sin(phi / DEGREE), Math.cos(theta / DEGREE)];
}

/** How far from the half vector normals see light and viewer, along a ray.
 * @param {number} tangent of the angle between half vector and light
 * @param {number} psi */
const reach = (tangent, psi) => Math.atan2(1, tangent * Math.abs(Math.cos(psi)));

/** Angles [degrees] of light and viewer at a normal, whose tangent runs around the vertical axis of the sphere.
 * @param {Vector} n
 * @param {Vector} light */
function anglesAt([x, y, z], light) {
  const width = Math.hypot(x, z) || 1e-9;
  const azimuth = (/** @type {Vector} */ v) =>
    Math.atan2((-x * y * v[0] + width * width * v[1] - y * z * v[2]) / width, (z * v[0] - x * v[2]) / width) * DEGREE;
  const cosine = dot([x, y, z], light);
  return [Math.acos(Math.min(Math.max(cosine, 0), 1)), Math.acos(Math.min(Math.max(z, 0), 1))]
    .map((each) => each * DEGREE)
    .concat(azimuth(light), azimuth([0, 0, 1]));
}

/** Directions that all pixels of one light lie between: rings and rays around the half vector.
 * @param {Vector} light
 * @param {boolean} whole the other half of a turn is not the same
 * @param {boolean} quick */
export function lune(light, whole, quick) {
  const { half, towards, across, tangent } = frameOf(light),
    { rings, rays: some } = quick ? QUICK : FINE;
  const rays = whole ? 2 * some - 1 : some,
    turn = whole ? 2 * Math.PI : Math.PI;
  const found = {
    theta_i: /** @type {number[]} */ ([]),
    phi_i: /** @type {number[]} */ ([]),
    theta_r: /** @type {number[]} */ ([]),
    phi_r: /** @type {number[]} */ ([]),
  };
  for (let j = 0; j < rays; j += 1) {
    const psi = (turn * j) / (rays - 1),
      end = EDGE * reach(tangent, psi);
    for (let i = 0; i < rings; i += 1) {
      const theta = end * (i / (rings - 1)) ** 2,
        [c, s, u, v] = [Math.cos(theta), Math.sin(theta), Math.cos(psi), Math.sin(psi)];
      const n = /** @type {Vector} */ ([0, 1, 2].map((k) => c * half[k] + s * (u * towards[k] + v * across[k])));
      const [theta_i, theta_r, phi_i, phi_r] = anglesAt(n, light);
      found.theta_i.push(round(theta_i));
      found.theta_r.push(round(theta_r));
      found.phi_i.push(round(phi_i));
      found.phi_r.push(round(phi_r));
    }
  }
  return { angles: found, rays, rings, turn };
}

/** A function that gives f_r, three colours, at a normal, between the values at the directions of a lune.
 * @param {Vector} light
 * @param {ArrayLike<number>} values
 * @param {{ rays: number, rings: number, turn: number }} of
 * @returns {(x: number, y: number, z: number, into: Float64Array) => void} */
export function between(light, values, { rays, rings, turn }) {
  const { half, towards, across, tangent } = frameOf(light),
    channels = values.length / (rays * rings);
  return (x, y, z, into) => {
    const cosine = half[0] * x + half[1] * y + half[2] * z;
    let psi = Math.atan2(
      across[0] * x + across[1] * y + across[2] * z,
      towards[0] * x + towards[1] * y + towards[2] * z,
    );
    psi = turn === Math.PI ? Math.abs(psi) : (psi + turn) % turn;
    const along = Math.sqrt(Math.min(Math.acos(Math.min(cosine, 1)) / (EDGE * reach(tangent, psi)), 1)) * (rings - 1);
    const around = (psi / turn) * (rays - 1),
      i = Math.min(Math.floor(along), rings - 2),
      j = Math.min(Math.floor(around), rays - 2);
    const a = along - i,
      b = around - j,
      first = channels * (j * rings + i),
      next = first + channels * rings;
    for (let k = 0; k < 3; k += 1) {
      const of = first + (channels === 3 ? k : 0),
        on = next + (channels === 3 ? k : 0);
      into[k] =
        (1 - b) * ((1 - a) * values[of] + a * values[of + channels]) +
        b * ((1 - a) * values[on] + a * values[on + channels]);
    }
  };
}

/** What is seen of the surroundings, bright above and black below, in a direction.
 * @param {number} y how far up it is */
const sky = (y) => SKY * (1 + y);

/** Lights that sum up the surroundings of some viewers, with the weights of the sum, and the lights as vectors: z is
 *   the
 * normal, x points away from the viewer.
 * @param {number[]} azimuths of the viewers [degrees]
 * @param {boolean} quick */
export function surroundings(azimuths, quick) {
  const { viewers, far, around } = quick ? QUICK : FINE,
    rows = viewers.flatMap((theta) => azimuths.map((phi) => ({ theta, phi })));
  const lights = rows.map(({ theta }) => {
    const mirror = [Math.sin(theta / DEGREE), 0, Math.cos(theta / DEGREE)];
    const found = Array.from({ length: far * around }, (_, k) => {
      const t = (Math.floor(k / around) + 0.5) / far,
        alpha = Math.PI * t * t,
        psi = (2 * Math.PI * ((k % around) + 0.5)) / around;
      const weight = Math.sin(alpha) * ((2 * Math.PI * t) / far) * ((2 * Math.PI) / around);
      const [c, s] = [Math.cos(alpha), Math.sin(alpha)],
        [u, v] = [Math.cos(psi), Math.sin(psi)];
      const l = /** @type {Vector} */ ([c * mirror[0] + s * u * mirror[2], s * v, c * mirror[2] - s * u * mirror[0]]);
      return { l, weight: l[2] > 0.01 ? weight * l[2] : 0 };
    });
    const total = found.reduce((sum, { weight }) => sum + weight, 0); // pi, but for the rim of the hemisphere
    return found.map(({ l, weight }) => ({ l, weight: (weight * Math.PI) / total }));
  });
  const polar = lights.map((row) => row.map(({ l }) => round(Math.acos(Math.max(Math.min(l[2], 1), 0)) * DEGREE)));
  const turned = lights.map((row, i) => row.map(({ l }) => round(rows[i].phi + 180 + Math.atan2(l[1], l[0]) * DEGREE)));
  // of a viewer at theta the lights by reciprocity: the one direction is asked for as the light, all others as viewers
  const angles = {
    theta_i: rows.map(({ theta }) => [theta]),
    phi_i: rows.map(({ phi }) => [phi]),
    theta_r: polar,
    phi_r: turned,
  };
  return { angles, lights, viewers, count: azimuths.length };
}

/** Moments of the surroundings over the viewers of `surroundings`: nine numbers each, albedo and its mean light
 *   along x and z of
 * three colours.
 * @param {ReturnType<typeof surroundings>} scene
 * @param {ArrayLike<number>} values */
export function moments({ lights, viewers, count }, values) {
  const each = lights[0].length,
    channels = values.length / (lights.length * each),
    found = new Float64Array(9 * viewers.length);
  lights.forEach((row, j) =>
    row.forEach(({ l, weight }, i) => {
      for (let k = 0; k < 3 && weight; k += 1) {
        const share = (values[(j * each + i) * channels + (channels === 3 ? k : 0)] * weight) / count,
          at = 9 * Math.floor(j / count) + 3 * k;
        found[at] += share;
        found[at + 1] += share * l[0];
        found[at + 2] += share * l[2];
      }
    }),
  );
  return found;
}

/** Between which of the viewers an angle [degrees] is, and how far.
 * @param {number[]} viewers
 * @param {number} theta */
function viewer(viewers, theta) {
  const next = viewers.findIndex((each) => each > theta),
    i = next < 0 ? viewers.length - 2 : Math.max(next - 1, 0);
  return [i, Math.min((theta - viewers[i]) / (viewers[i + 1] - viewers[i]), 1)];
}

/** Add what a normal reflects of the surroundings and, where it has a specular part, of the light that stands in
 *   them.
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {Vector} light
 * @param {{ viewers: number[], moments: ArrayLike<number> | null, specular: number[][] | null }} of specular: three
 *   colours over the viewers
 * @param {Float64Array} into */
export function add(x, y, z, light, of, into) {
  const [i, a] = viewer(of.viewers, Math.acos(Math.min(z, 1)) * DEGREE);
  const away = z < 1 ? (y * z) / Math.sqrt(1 - z * z) : 0; // how far up the side of the mirror direction leans
  if (of.moments) {
    for (let k = 0; k < 3; k += 1) {
      const m = (/** @type {number} */ j) =>
        (1 - a) * (of.moments?.[9 * i + 3 * k + j] ?? 0) + a * (of.moments?.[9 * i + 9 + 3 * k + j] ?? 0);
      into[k] += SKY * (m(0) + m(1) * away + m(2) * y);
    }
  }
  if (!of.specular) return;
  const mirror = 2 * z,
    cosine = mirror * x * light[0] + mirror * y * light[1] + (mirror * z - 1) * light[2];
  const inside = Math.min(Math.max((RHO - Math.acos(Math.min(Math.max(cosine, -1), 1))) / (0.3 * RHO) + 0.5, 0), 1);
  const seen = (of.moments ? sky(mirror * y) : 0) + RADIANCE * inside;
  for (let k = 0; k < 3; k += 1) into[k] += seen * ((1 - a) * of.specular[i][k] + a * of.specular[i + 1][k]);
}
