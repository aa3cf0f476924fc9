// Pictures that Plotly draws: what they share, and the library, which arrives when the first of them is asked for.

import { Problem } from "./api.js";
import { element } from "./dom.js";

const DRAWN = { // of the buttons, those that save and restore: more would lie over titles and legends
  displaylogo: false, responsive: true, showSendToCloud: false, modeBarButtonsToRemove: [
    "lasso2d", "select2d", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "autoScale2d",
  ],
};
const NARROW = 560; // pixels in which two pictures do not stand side by side

let library; // plotly.js, once it is asked for

/** plotly.js, which takes a second to run: what is known already is shown before. */
export function loaded() {
  library ??= new Promise((go) => requestAnimationFrame(() => setTimeout(go))).then(() => new Promise((resolve, reject) => {
    const script = element("script", { src: document.getElementById("plotly").href });
    script.addEventListener("load", () => resolve(globalThis.Plotly));
    script.addEventListener("error", () => reject(new Problem("plotly.js did not arrive: load this page again")));
    document.head.append(script);
  }));
  return library;
}

/** The part of a view that is drawn by Plotly: `figure` gives `data` and `layout` of Plotly, and a caption; pictures that
 * stand side by side are `stacked` where there is little room. */
export const plotted = (figure, { stacks = false } = {}) => ({
  place: "plot",
  ready: loaded,
  async draw(plot, series, answers, state) {
    const Plotly = await loaded(), width = plot.clientWidth, stacked = stacks && width < NARROW && answers.length > 1;
    plot.classList.toggle("stacked", stacked);
    const css = getComputedStyle(document.documentElement);
    const ink = (name) => css.getPropertyValue(`--${name}`).trim();
    const drawn = figure(series, answers, state, ink, { width, stacked });
    await Plotly.react(plot, drawn.data, laidOut(drawn, series, state, ink), DRAWN);
    return drawn.caption;
  },
});

function laidOut(drawn, series, { view, material }, ink) {
  const touched = matchMedia("(pointer: coarse)").matches; // where a finger scrolls the page, and zooms no picture
  const axis = { fixedrange: touched, gridcolor: ink("grid"), linecolor: ink("grid"), zeroline: false, automargin: true };
  const layout = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink("ink"), size: 13 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("muted"), activecolor: ink("ink") },
    margin: { l: 55, r: 20, t: 55, b: 45 }, showlegend: series.length > 1 || drawn.data.length > 1,
    legend: { orientation: "h", traceorder: "normal", y: 1.02, yanchor: "bottom", x: 0 }, uirevision: `${view} ${material}`,
    ...(touched && { dragmode: false }),
    ...drawn.layout,
  };
  for (const key of ["xaxis", "yaxis", "xaxis2", "yaxis2"]) if (layout[key]) layout[key] = { ...axis, ...layout[key] };
  return layout;
}

/** The line of the first or the second series. */
export const line = (ink, at) => ({ color: ink(at ? "second" : "first"), dash: at ? "dash" : "solid", width: 2 });
