// Figures, as Plotly takes them, and their captions, of the answers to the requests of a view.

import { short } from "./dom.js";
import { RELATIVE, floorOf, relative, scaled, span, ticks } from "./scales.js";
import { nearest, number, quantityWords } from "./series.js";
import { MODEL } from "./state.js";

const NM = [450, 550, 650]; // of albedos, where none is chosen
const BANDS = ["#4f7df0", "#2f9e6b", "#d8503f"]; // their colours
const HEAT = "Viridis";
const DIFFERENCE = [[0, "#2166ac"], [0.5, "#f7f7f7"], [1, "#b2182b"]];
const [CHARACTER, LINE, BUTTONS] = [7.4, 17, 30]; // pixels: a wide character and a line of titles, the buttons above them
const LEAST_DECADES = 0.2; // of the logarithmic axis of a spectrum: a factor of 1.6

/** The figure of a view: `data` and `layout` of Plotly, and a caption; in a place of some `width` [pixel], `stacked` where
 * two stand on each other. */
export function figure(view, series, answers, state, place) {
  const css = getComputedStyle(document.documentElement);
  const ink = (name) => css.getPropertyValue(`--${name}`).trim();
  const drawn = { "half-difference": halfDifference, spectrum, albedo }[view](
    series, answers, state, ink, place);
  const touched = matchMedia("(pointer: coarse)").matches; // where a finger scrolls the page, and zooms no picture
  const axis = { fixedrange: touched, gridcolor: ink("grid"), linecolor: ink("grid"), zeroline: false, automargin: true };
  const layout = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink("ink"), size: 13 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("muted"), activecolor: ink("ink") },
    margin: { l: 55, r: 20, t: 55, b: 45 }, showlegend: series.length > 1 || drawn.data.length > 1,
    legend: { orientation: "h", traceorder: "normal", y: 1.02, yanchor: "bottom", x: 0 }, uirevision: `${view} ${state.material}`,
    ...(touched && { dragmode: false }),
    ...drawn.layout,
  };
  for (const key of ["xaxis", "yaxis", "xaxis2", "yaxis2"]) if (layout[key]) layout[key] = { ...axis, ...layout[key] };
  return { ...drawn, layout };
}

const line = (ink, at) => ({ color: ink(at ? "second" : "first"), dash: at ? "dash" : "solid", width: 2 });

/** Text in lines of at most so many characters, where its words are not longer. */
const wrapped = (text, most) => text.match(new RegExp(`\\S.{0,${most - 1}}(?=\\s|$)|\\S+`, "g"));

/** The part of the figure for one of some pictures, and a title above it. */
function part(i, count, stacked, gap) {
  const half = 0.5 - gap / 2, [low, high] = count === 1 ? [0, 1] : (i === 0) === !stacked ? [0, half] : [1 - half, 1];
  const x = stacked ? [0, 1] : [low, high], y = stacked ? [low, high] : [0, 1];
  const title = (lines) => ({
    text: lines.join("<br>"), showarrow: false, xref: "paper", yref: "paper",
    x: (x[0] + x[1]) / 2, y: y[1], xanchor: "center", yanchor: "bottom",
  });
  return { x, y, title };
}

/** Ticks of a colour bar. */
function bars(range, state) {
  const found = ticks(range, state);
  return { tickvals: found.map(([at]) => at), ticktext: found.map(([, text]) => text) };
}

function halfDifference(series, answers, state, ink, { width, stacked }) {
  const against = state.compare === MODEL;
  const values = answers.map((answer) => answer.brdf.map((row) => row.map(number(answer))));
  const shown = against ? values.slice(0, 1) : values;
  const range = span(shown.flat(2), state), height = scaled(state, range[0]);
  const bar = { thickness: 12, outlinewidth: 0, ...(stacked && { len: 0.42 }) };
  const title = (text) => ({ text, standoff: 6 });
  const titles = series.length === 1 ? [] : series.map(({ label }, i) =>
    wrapped(against && i ? "table − model, relative" : label, Math.floor((width * (stacked ? 0.85 : 0.42)) / CHARACTER)));
  const top = titles.length ? LINE * Math.max(...titles.map((each) => each.length)) : 0;
  const layout = { showlegend: false, margin: { l: 55, r: 10, t: BUTTONS + top, b: 50 }, annotations: [] };
  const data = series.map((_, i) => {
    const difference = against && i === 1;
    const { x, y, title: above } = part(i, series.length, stacked, 0.16);
    const suffix = i ? "2" : "";
    layout[`xaxis${suffix}`] = { domain: x, title: title("θ<sub>d</sub> [degrees]"), dtick: 30, range: [0, 90], anchor: `y${suffix}` };
    layout[`yaxis${suffix}`] = { title: title(i && !stacked ? "" : "θ<sub>h</sub> [degrees]"), domain: y, dtick: 30, range: [90, 0], anchor: `x${suffix}` };
    if (titles.length) layout.annotations.push(above(titles[i]));
    const { theta_d, theta_h } = answers[i].axes_deg;
    const map = { type: "heatmap", x: theta_d, y: theta_h, xaxis: `x${suffix}`, yaxis: `y${suffix}` };
    const where = "θ<sub>h</sub> %{y}°, θ<sub>d</sub> %{x}°";
    if (difference) {
      const floor = floorOf(series[0].info, state.nm);
      const off = values[0].map((row, j) => relative(row, values[1][j], floor));
      const sizes = off.flat().filter((each) => each !== null).map(Math.abs).sort((a, b) => a - b);
      const most = sizes[Math.floor(0.99 * sizes.length)] || 1e-9;
      return { ...map, z: off, colorscale: DIFFERENCE, zmin: -most, zmax: most, hovertemplate: `${where}: %{z:.2%}<extra></extra>`,
        colorbar: { ...bar, x: x[1], y: (y[0] + y[1]) / 2, tickformat: "~%" } };
    }
    const z = values[i].map((row) => row.map((value) => (value > 0 ? height(value) : null)));
    return { ...map, z, customdata: values[i], colorscale: HEAT, zmin: range[0], zmax: range[1], showscale: i === 0,
      hovertemplate: `${where}: %{customdata:.4g} /sr<extra></extra>`,
      colorbar: { ...bar, x: x[1], y: (y[0] + y[1]) / 2, ...bars(range, state) } };
  });
  const caption = `${quantityWords(series[0], state)} in 1/sr over the half angle, down, and the difference angle; φ of the half vector is ${answers[0].phi_i}°, that of the difference 90°.` +
    (against ? ` ${stacked ? "Below" : "Right"}, how far the table is off, ${RELATIVE}; the scale ends at the 99th percentile, and what is beyond has the colour of its end.` : "");
  return { data, layout, caption };
}

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
  const caption = `The share of light from θᵢ that is reflected, Dirac part included; over φᵢ the ${audited ? "most, as the audit found it" : "mean"}.` +
    (state.compare === MODEL && !audited ? " Nobody audited it, so that of the model is not known." : "");
  return { data, layout, caption };
}
