// The view of f_r over half angle and difference angle, as a map.

import { plotted } from "./plot.js";
import { RELATIVE, floorOf, relative, scaled, span, ticks } from "./scales.js";
import { lobe, number, quantityWords } from "./series.js";
import { MODEL } from "./state.js";

const HEAT = "Viridis";
const DIFFERENCE = [[0, "#2166ac"], [0.5, "#f7f7f7"], [1, "#b2182b"]];
const [CHARACTER, LINE, BUTTONS] = [7.4, 17, 30]; // pixels: a wide character and a line of titles, the buttons above them

export default {
  name: "half-difference",
  title: "Half–difference",
  order: 3,
  idle: ["theta_i"],
  request: (each, state, series) => lobe(each, { ...state, theta_i: undefined }, series),
  ...plotted(halfDifference, { stacks: true }),
};

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
