// Sliders, switches and the choice of a view: they show the state, and tell what a hand changes of it.

import { element } from "./dom.js";
import { ILLUMINANTS, MODEL } from "./state.js";
import { anisotropic, makesColour, nearest } from "./series.js";
import { VIEWS } from "./views.js";

const form = document.getElementById("controls");
const views = document.getElementById("views");
const fields = form.elements;

for (const { name, title } of Object.values(VIEWS)) {
  views.append(element("label", {}, element("input", { type: "radio", name: "view", value: name }), title));
}

fields.illuminant.append(...ILLUMINANTS.map((name) => new Option(name)));

/** Call `change` with what a hand changes of the state. */
export function listen(change) {
  views.addEventListener("change", (event) => change({ view: event.target.value }));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", ({ target: { name, checked, value } }) => {
    if (name === "colour") change({ nm: checked ? null : Number(fields.nm.value) });
    else if (name === "log") change({ scale: checked ? "log" : "linear" });
    else if (["compare", "illuminant"].includes(name)) change({ [name]: value });
    else change({ [name]: Number(value) });
  });
}

/** Offer materials to compare with. */
export function offer(materials) {
  fields.compare.replaceChildren(new Option("nothing", ""), new Option("its model", MODEL),
    ...materials.filter((each) => !each.damaged).map((each) => new Option(each.title, each.name)));
}

const all = [views, form, document.getElementById("copies")];

/** Nothing can be moved while there is nothing to look at. */
export function forget() {
  for (const each of all) each.inert = true;
}

/** Show a state of some series; what has no effect on the picture cannot be moved. */
export function show(state, series) {
  for (const each of all) each.inert = false;
  views.querySelector(`[value="${state.view}"]`).checked = true;
  for (const name of ["theta_i", "phi_i", "theta_r", "turn"]) {
    fields[name].value = state[name];
    said(name, `${state[name]}°`);
  }
  const { idle = [], also = [], turned = false } = VIEWS[state.view];
  for (const name of ["theta_r", "turn"]) fields[name].closest("label").hidden = !also.includes(name);
  fields.theta_i.disabled = idle.includes("theta_i");
  fields.phi_i.disabled = idle.includes("phi_i") || !(turned || anisotropic(series));
  fields.log.checked = state.scale === "log";
  fields.log.disabled = idle.includes("log");
  fields.compare.value = state.compare;

  const spectral = series.find(({ info }) => info.wavelength_nm)?.info;
  const range = spectral?.wavelength_nm ?? [550];
  fields.nm.min = range[0];
  fields.nm.max = range.at(-1);
  const one = range.length === 1 || idle.includes("nm");
  const coloured = spectral !== undefined && makesColour(spectral);
  fields.nm.disabled = one || (coloured && state.nm === null);
  if (spectral && state.nm !== null) fields.nm.value = nearest(spectral, state.nm);
  said("nm", !spectral ? "grey: the same at all" : fields.nm.disabled && !one ? "all" : `${nearest(spectral, state.nm)} nm`);
  if (idle.includes("nm")) said("nm", "all");
  fields.colour.checked = coloured && state.nm === null;
  fields.colour.disabled = !coloured || idle.includes("colour");
  fields.illuminant.value = state.illuminant;
  fields.illuminant.closest("label").hidden = !fields.colour.checked || idle.includes("illuminant");
}

function said(name, text) {
  fields[name].closest("label").querySelector(".said").textContent = text;
}
