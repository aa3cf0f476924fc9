// The view of the directional albedo over the angle of the light.

import { chart, steps, valueAt } from "./chart.js";
import { closest, ink, short } from "./dom.js";
import { against, nearest, question } from "./series.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */

const NM = [450, 550, 650]; // of albedos, where none is chosen

/** Whether albedos are those of the audit: it alone knows that of the model of a table, unless that was audited
 *   without one.
 * @param {Series} each
 * @param {Series[]} series */
const audited = ({ info }, series) => against(series) && Boolean(info.audit?.model);

/** @type {import("./main.js").View} */
export default {
  name: "albedo",
  title: "Albedo",
  order: 5,
  idle: ["theta_i", "phi_i", "log", "illuminant"],
  request: (each, _, series) =>
    audited(each, series) ? question({ ...each, source: "table" }, "audit") : question(each, "albedo"),
  // the service does not know that of the model of a table
  known: (each, _, series) => each.source !== "model" || audited(each, series),
  draw: albedo,
};

/** Albedos of an answer of the service, or of the audit, which has that of the model, too.
 * @param {any} answer
 * @param {Series} each */
function albedosOf(answer, { source }) {
  const found = answer.finding?.findings.energy[source];
  if (found) return { theta_i: found.theta_i_deg, at: found.wavelength_nm, total: found.albedo };
  const total = answer.albedo.map((/** @type {number[]} */ row, /** @type {number} */ k) =>
    row.map((value, i) => value + (answer.specular_reflectance?.[k][i] ?? 0)),
  );
  return { theta_i: answer.theta_i, at: answer.wavelength_nm, total };
}

/** @param {HTMLElement} into
 * @param {Series[]} series those that are known
 * @param {any[]} answers
 * @param {State} state
 * @param {Series[]} all */
function albedo(into, series, answers, state, all) {
  const curves = answers.flatMap((answer, i) => {
    const { theta_i, at, total } = albedosOf(answer, series[i]);
    const asked =
      at === null ? [null] : state.nm === null && at.length > 1 ? NM : [nearest({ wavelength_nm: at }, state.nm)];
    return asked.map((nm) => {
      const column = nm === null ? 0 : closest(at, nm);
      const words = [
        ...(answers.length > 1 || nm === null ? [series[i].label] : []),
        ...(nm === null ? [] : [`${at[column]} nm`]),
      ];
      return {
        x: theta_i,
        y: total.map((/** @type {number[]} */ row) => row[column]),
        label: words.join(", "),
        dash: series[i].dash,
        colour: ink(asked.length > 1 ? `hue-${nm}` : series[i].colour),
      };
    });
  });
  const limit = { x: [0, 90], y: [1, 1], label: "all that arrives", colour: ink("muted"), dash: "2 3" };
  const most = 1.05 * Math.max(1, ...curves.flatMap(({ y }) => y));
  /** @type {[number, number]} */
  const range = [0, most];
  const up = {
    title: "albedo",
    range,
    ticks: steps(range, 6).map((at) => /** @type {[number, string]} */ ([at, short(at)])),
    height: Number,
  };
  chart(
    into,
    [...curves, limit],
    { title: "θᵢ [degrees]", range: [0, 90], every: 30 },
    up,
    (theta) => `θᵢ ${Math.round(theta)}°: ${curves.map((curve) => valueAt(curve, theta)).join(", ")}`,
  );
  const of = answers.some(({ finding }) => finding);
  return (
    "The share of light from θᵢ that is reflected, specular part included; " +
    `over φᵢ the ${of ? "most, as the audit found it" : "mean"}.` +
    (series.length < all.length ? " That of a model behind a table is known where an audit found it." : "")
  );
}
