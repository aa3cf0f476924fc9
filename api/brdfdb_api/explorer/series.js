// What a picture shows, one or two series of values: of which material, from table or model, at which wavelength.

import { address, json } from "./api.js";
import { MODEL } from "./state.js";

/** The series of a state: label, material, source, and what is known of the material. */
export async function seriesOf(state, signal) {
  const other = ![MODEL, "", state.material].includes(state.compare);
  const [info, second] = await Promise.all(
    [state.material, ...(other ? [state.compare] : [])].map((name) => json(address(name), signal)));
  const first = { label: info.title, name: info.name, source: "table", info };
  if (other) return [first, { label: second.title, name: second.name, source: "table", info: second }];
  if (state.compare !== MODEL) return [first];
  return [{ ...first, label: "table" }, { ...first, label: "model", source: "model" }];
}

/** Whether any of them turns with phi_i. */
export const anisotropic = (series) => series.some(({ info }) => info.anisotropic);

/** Whether the wavelengths of a material make a colour, by the rule of the service. */
export function makesColour({ wavelength_nm: at }) {
  return at !== null && at[0] <= 420 && at.at(-1) >= 680 && at.every((nm, i) => i === 0 || nm - at[i - 1] <= 20);
}

/** The wavelength [nm] closest to one that is asked for, within those of a material; else its middle one. */
export function nearest({ wavelength_nm: at }, nm) {
  return nm === null ? at[at.length >> 1] : Math.min(Math.max(nm, at[0]), at.at(-1));
}

/** The part of a query that makes values numbers: luminance, one wavelength, or what a grey material has. */
export function quantity({ info, source }, { nm, illuminant }, colour = "xyz") {
  const from = source === "model" ? { from: "model" } : {};
  if (info.wavelength_nm === null) return from; // white under any illuminant
  if (nm === null && makesColour(info)) return { ...from, output: colour, illuminant };
  return { ...from, wavelength_nm: nearest(info, nm) };
}

/** In words, what those numbers are. */
export function quantityWords({ info }, { nm, illuminant }) {
  if (info.wavelength_nm === null) return "fᵣ";
  return nm === null && makesColour(info) ? `Luminance of fᵣ under ${illuminant}` : `fᵣ at ${nearest(info, nm)} nm`;
}

/** Whether albedos are those of the audit: it alone knows that of a model, unless the table was audited without one. */
export const againstAudit = ({ info }, { compare }) => compare === MODEL && Boolean(info.audit?.model);

/** The azimuth of the light, where any of the series turns with it. */
export const azimuth = ({ phi_i }, series) => (anisotropic(series) ? phi_i : undefined);

/** The address of f_r over the viewers of one light, of a view that the service knows. */
export const lobe = (each, state, series) => address(each.name, "lobe", {
  view: state.view, theta_i: state.theta_i, phi_i: azimuth(state, series), ...quantity(each, state),
});

/** A function that makes a number of what an answer holds at a point. */
export const number = (document) => (document.output === "xyz" ? (value) => value[1] : (value) => value);
