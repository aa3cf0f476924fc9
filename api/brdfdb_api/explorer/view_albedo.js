// The view of the directional albedo over the angle of the light.

import { address } from "./api.js";
import { line, plotted } from "./plot.js";
import { againstAudit, nearest } from "./series.js";
import { MODEL } from "./state.js";

const NM = [450, 550, 650]; // of albedos, where none is chosen
const BANDS = ["#4f7df0", "#2f9e6b", "#d8503f"]; // their colours

export default {
  name: "albedo",
  title: "Albedo",
  order: 5,
  idle: ["theta_i", "phi_i", "log", "illuminant"],
  request: (each, state) => address(each.name, againstAudit(each, state) ? "audit" : "albedo"),
  known: (each, state) => each.source === "table" || againstAudit(each, state), // the service does not know that of a model
  ...plotted(albedo),
};

/** Albedos of an answer of the service, or of the audit, which tells that of the model, too. */

function albedosOf(answer, source) {
  const found = answer.finding?.findings.energy[source];
  if (found) return { theta_i: found.theta_i_deg, at: found.wavelength_nm, total: found.albedo };
  const total = answer.albedo.map((row, k) => row.map((value, i) => value + answer.specular_reflectance[k][i]));
  return { theta_i: answer.theta_i, at: answer.wavelength_nm, total };
}

function albedo(series, answers, state, ink) {
  const data = answers.flatMap((answer, i) => {
    const { theta_i, at, total } = albedosOf(answer, series[i].source);
    const asked = at === null ? [null] : state.nm === null && at.length > 1 ? NM : [nearest({ wavelength_nm: at }, state.nm)];
    return asked.map((nm, j) => {
      const column = nm === null ? 0 : at.reduce((best, each, k) => (Math.abs(each - nm) < Math.abs(at[best] - nm) ? k : best), 0);
      const words = [...(answers.length > 1 || nm === null ? [series[i].label] : []), ...(nm === null ? [] : [`${at[column]} nm`])];
      return {
        type: "scatter", mode: "lines", name: words.join(", "), x: theta_i, y: total.map((row) => row[column]),
        line: { ...line(ink, i), ...(asked.length > 1 && { color: BANDS[j] }) },
        hovertemplate: "θ<sub>i</sub> %{x}°: %{y:.4f}<extra></extra>",
      };
    });
  });
  data.push({
    type: "scatter", mode: "lines", name: "all that arrives", x: [0, 90], y: [1, 1], hoverinfo: "skip",
    line: { color: ink("muted"), dash: "dot", width: 1.5 },
  });
  const most = Math.max(...data.flatMap(({ y }) => y));
  const layout = {
    xaxis: { title: { text: "θ<sub>i</sub> [degrees]" }, range: [0, 90], dtick: 30 },
    yaxis: { title: { text: "albedo" }, range: [0, 1.05 * most] },
  };
  const audited = answers[0].finding !== undefined;
  const caption = `The share of light from θᵢ that is reflected, specular part included; over φᵢ the ${audited ? "most, as the audit found it" : "mean"}.` +
    (state.compare === MODEL && !audited ? " Nobody audited it, so that of the model is not known." : "");
  return { data, layout, caption };
}
