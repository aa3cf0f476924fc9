// What is looked at: a material, directions, a wavelength, a view; as a link, and back from one.

// compare: nothing, the model of the material itself, or the name of another one
export const MODEL = ":model";

// Of colours; D65 first, as in the list
export const ILLUMINANTS = ["D65", "D50", "A", "FL2"];

// nm: a wavelength, or null for luminance and colours under an illuminant; turn is phi_r - phi_i
const DEFAULTS = {
  material: "", view: "cut", theta_i: 45, phi_i: 0, theta_r: 45, turn: 180, nm: null, scale: "log", compare: "",
  illuminant: "D65",
};
const CHOICES = { scale: ["log", "linear"], illuminant: ILLUMINANTS };
const RANGES = { theta_i: [0, 89.5], phi_i: [0, 360], theta_r: [0, 89.5], turn: [0, 360], nm: [1, 1e6] };

/** The state that a link holds, of some views; what it does not hold, or holds wrongly, is as at the start. */
export function fromHash(hash, views) {
  const state = { ...DEFAULTS }, choices = { ...CHOICES, view: Object.keys(views) };
  for (const [key, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (key in RANGES) {
      const value = Number(text), [low, high] = RANGES[key];
      if (text !== "" && value >= low && value <= high) state[key] = value;
    } else if (key in choices ? choices[key].includes(text) : key in DEFAULTS) {
      state[key] = text;
    }
  }
  return state;
}

/** The end of a link: what differs from the start. */
export function toHash(state) {
  const held = Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key] && value !== null);
  return `#${new URLSearchParams(held)}`;
}
