// The view of f_r over wavelengths at one pair of directions.

import { address } from "./api.js";
import { short } from "./dom.js";
import { line, plotted } from "./plot.js";
import { azimuth } from "./series.js";

const LEAST_DECADES = 0.2; // of the logarithmic axis of a spectrum: a factor of 1.6

export default {
  name: "spectrum",
  title: "Spectrum",
  order: 4,
  idle: ["nm", "colour", "illuminant"],
  also: ["theta_r", "turn"],
  request(each, state, series) {
    const of = each.source === "model" ? { from: "model" } : each.info.error ? { error: true } : {};
    const phi_i = azimuth(state, series);
    const phi_r = ((phi_i ?? 0) + state.turn) % 360;
    return address(each.name, "lookup", { theta_i: state.theta_i, phi_i, theta_r: state.theta_r, phi_r, ...of });
  },
  ...plotted(spectrum),
};

/** Ends of the axis of a spectrum, in decades of a logarithmic one, wide enough that rounding is no picture. */
function ends(values, { scale }) {
  const some = values.filter((value) => value > 0);
  const most = Math.max(...some), least = Math.min(...some);
  if (!some.length) return scale === "log" ? [-1, 0] : [0, 1];
  if (scale === "linear") return [0, 1.08 * most];
  const middle = Math.log10(most * least) / 2, half = Math.max(Math.log10(most / least) * 0.54, LEAST_DECADES / 2);
  return [middle - half, middle + half];
}

/** Ticks at 1, 2 and 5 of each decade of a logarithmic axis, where it is long enough for three of them. */
function decades([low, high], { scale }) {
  if (scale !== "log" || high - low < 1) return {};
  const powers = Array.from({ length: Math.ceil(high) - Math.floor(low) }, (_, i) => 10 ** (Math.floor(low) + i));
  const tickvals = powers.flatMap((power) => [power, 2 * power, 5 * power]);
  return { tickvals, ticktext: tickvals.map(short) };
}

function spectrum(series, answers, state, ink) {
  const data = answers.flatMap((answer, i) => {
    const grey = answer.wavelength_nm === null;
    const x = grey ? [380, 780] : answer.wavelength_nm;
    const all = (value) => (grey ? [value, value] : value);
    const y = all(answer.brdf);
    const mode = x.length === 1 ? "markers" : "lines";
    const curve = { type: "scatter", mode, name: series[i].label, x, y, line: line(ink, i), marker: { color: line(ink, i).color, size: 9 },
      hovertemplate: "%{x} nm: %{y:.4g} /sr<extra></extra>" };
    if (answer.error === null) return [curve];
    const error = all(answer.error);
    const edge = { type: "scatter", mode: "lines", x, line: { width: 0 }, hoverinfo: "skip", showlegend: false };
    return [
      { ...edge, y: y.map((value, j) => Math.max(value - error[j], 0)) },
      { ...edge, y: y.map((value, j) => value + error[j]), fill: "tonexty", fillcolor: `${line(ink, i).color}44` },
      curve,
    ];
  });
  const range = ends(data.flatMap(({ y }) => y), state);
  const layout = {
    showlegend: series.length > 1,
    xaxis: { title: { text: "wavelength [nm]" } },
    yaxis: {
      title: { text: "f<sub>r</sub> [1/sr]" }, type: state.scale, exponentformat: "power", automargin: true, range,
      ...decades(range, state),
    },
  };
  const said = answers.map((answer, i) => answer.wavelength_nm === null && answer.brdf !== undefined ?
    ` ${series[i].label} is grey: ${short(answer.brdf)} /sr${answer.error === null ? "" : ` ± ${short(answer.error)}`} at every wavelength.` : "");
  const caption = `fᵣ at one pair of directions${answers.some((answer) => answer.error !== null) ? ", with the band that 99 of 100 values of the table keep to" : ""}.`;
  return { data, layout, caption: caption + said.join("") };
}
