// Sliders, switches and the choice of a view: they show the state and change it.

import { byId, element } from "./dom.js";
import { anisotropic, makesColour, nearest } from "./series.js";
import { CHOICES, ILLUMINANTS, MODEL } from "./link.js";
import { VIEWS } from "./views.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */

const form = byId("controls", HTMLFormElement),
  views = byId("views", HTMLElement),
  beside = byId("beside", HTMLElement);
const CHOSEN = ["axes", "curves", "illuminant", "surround"];

/** A control of the form.
 * @param {string} name
 * @returns {any} an input or a select: both have value and disabled */
const field = (name) => form.elements.namedItem(name);

for (const { name, title } of Object.values(VIEWS)) {
  views.append(element("label", {}, element("input", { type: "radio", name: "view", value: name }), title));
}

field("illuminant").append(...ILLUMINANTS.map((name) => new Option(name)));

/** Call `choose` with the changed part of the state.
 * @param {(part: Partial<State>) => void} choose
 * @param {() => State} now */
export function listen(choose, now) {
  views.addEventListener(
    "change",
    ({ target }) => target instanceof HTMLInputElement && choose({ view: target.value }),
  );
  form.addEventListener("submit", (event) => event.preventDefault());
  const compare = () => {
    const { value } = field("compare");
    if (value && !now().compare.includes(value)) choose({ compare: [...now().compare, value] });
  };
  let typed = false; // keys in a closed list pass over other names; Enter confirms
  field("compare").addEventListener("pointerdown", () => (typed = false));
  field("compare").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Enter" && typed) compare();
    typed = !["Enter", "Tab"].includes(event.key) && !event.altKey && (event.key !== " " || typed);
  });
  form.addEventListener("input", ({ target }) => {
    const { name, checked, value } = /** @type {HTMLInputElement} */ (target);
    if (name === "colour") choose({ nm: checked ? null : Number(field("nm").value) });
    else if (name === "log") choose({ scale: checked ? "log" : "linear" });
    else if (CHOSEN.includes(name)) choose({ [name]: value });
    else if (name !== "compare") choose({ [name]: Number(value) });
    else if (!typed) compare();
  });
  beside.addEventListener("click", ({ target }) => {
    const text = target instanceof HTMLElement && target.dataset.text;
    if (text) choose({ compare: now().compare.filter((each) => each !== text) });
  });
}

/** Offer materials to compare with.
 * @param {any[]} materials */
export function offer(materials) {
  field("compare").replaceChildren(
    new Option("add … (Enter confirms)", ""),
    new Option("model or table of the material", MODEL),
    ...materials.filter((each) => !each.damaged).map((each) => new Option(each.title, each.name)),
  );
}

const all = [views, form, byId("copies", HTMLElement), beside];

/** Disable all controls while there is nothing to show. */
export function forget() {
  for (const each of all) each.inert = true;
}

/** Show a state; controls without an effect on the picture are disabled.
 * @param {State} state
 * @param {Series[]} series */
export function show(state, series) {
  for (const each of all) each.inert = false;
  const chosen = views.querySelector(`[value="${state.view}"]`);
  if (chosen instanceof HTMLInputElement) chosen.checked = true;
  for (const name of /** @type {const} */ (["theta_i", "phi_i", "theta_r", "turn"])) {
    field(name).value = state[name];
    said(name, `${state[name]}°`);
  }
  const { idle = [], also = [], turned = false, shapes = false, lit = false } = VIEWS[state.view];
  const drop = (/** @type {string} */ name, /** @type {boolean} */ hidden) => {
    field(name).closest("label").hidden = hidden;
  };
  for (const name of ["theta_r", "turn"]) drop(name, !also.includes(name));
  for (const name of ["axes", "curves"]) drop(name, !shapes);
  for (const name of ["exposure", "surround"]) drop(name, !lit);
  for (const name of CHOSEN) if (name in CHOICES) field(name).value = state[/** @type {keyof State} */ (name)];
  field("exposure").value = state.exposure;
  said("exposure", `${state.exposure > 0 ? "+" : ""}${state.exposure} EV`.replace("-", "−"));
  field("theta_i").disabled = idle.includes("theta_i");
  field("phi_i").disabled = idle.includes("phi_i") || !(turned || anisotropic(series));
  field("log").checked = state.scale === "log";
  drop("log", idle.includes("log"));
  field("compare").value = "";
  beside.replaceChildren(
    ...series
      .slice(1)
      .map(({ label }, i) => element("button", { type: "button", title: "remove" }, `${label} ×`)),
  );
  series.slice(1).forEach((_, i) => {
    /** @type {HTMLElement} */ (beside.children[i]).dataset.text = state.compare[i];
  });

  const spectral = series.find(({ info }) => info.wavelength_nm)?.info,
    range = spectral?.wavelength_nm ?? [550];
  field("nm").min = range[0];
  field("nm").max = range.at(-1);
  const one = range.length === 1 || idle.includes("nm"),
    coloured = spectral !== undefined && makesColour(spectral);
  field("nm").disabled = one || (coloured && state.nm === null);
  if (spectral && state.nm !== null) field("nm").value = nearest(spectral, state.nm);
  said(
    "nm",
    !spectral
      ? "grey: the same at all wavelengths"
      : idle.includes("nm") || (field("nm").disabled && !one)
        ? "all"
        : `${nearest(spectral, state.nm)} nm`,
  );
  drop("nm", !spectral || idle.includes("nm"));
  field("colour").checked = coloured && state.nm === null;
  drop("colour", !coloured || idle.includes("colour"));
  drop("illuminant", !field("colour").checked || idle.includes("illuminant"));
}

/** @param {string} name
 * @param {string} text */
function said(name, text) {
  field(name).closest("label").querySelector(".said").textContent = text;
}
