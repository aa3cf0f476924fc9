// The reducer: the page as one value, and the only function that makes the next value from it and an event.

import { subjectOf } from "./link.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */

/** @typedef {{
 *   state: State,
 *   wrong: string[],
 *   series: Series[],
 *   missing: string,
 *   learn: "everything" | "parameters" | "nothing",
 *   moving: boolean,
 *   asked: number | null,
 *   pictures: "none" | "first" | "all",
 * }} Page
 *   state: the state of the link. wrong: sentences on the link, until the user changes something. series: the series in
 *   the picture; empty until they are loaded. missing: why a comparison is not shown. learn: what to load before the
 *   next picture. moving: a slider moves, so pictures are coarse. asked: time of the request for the next picture [ms],
 *   or null. pictures: those that the page has shown since it was opened */

/** @typedef {{ kind: "changed", part: Partial<State>, wrong?: string[], at: number }
 *   | { kind: "asked" | "rested", at: number }
 *   | { kind: "begun" | "outdated" }
 *   | { kind: "found", of: State, series: Series[], missing: string }
 *   | { kind: "shown", pictures: "first" | "all" }} PageEvent */

const MOVED = ["theta_i", "phi_i", "theta_r", "turn", "nm", "exposure"]; // values of the sliders of the form

/** The page before its first picture.
 * @param {{ state: State, wrong: string[] }} link
 * @returns {Page} */
export const opened = ({ state, wrong }) => ({
  state,
  wrong,
  series: [],
  missing: "",
  learn: "everything",
  moving: false,
  asked: null,
  pictures: "none",
});

/** The page after an event.
 * @param {Page} page
 * @param {PageEvent} event
 * @returns {Page} */
export function after(page, event) {
  switch (event.kind) {
    case "changed":
      return changed(page, event.part, event.wrong ?? [], event.at);
    case "asked":
      return { ...page, asked: event.at };
    case "rested":
      return { ...page, asked: event.at, moving: false };
    case "begun":
      return { ...page, asked: null };
    case "outdated":
      return { ...page, learn: "everything" };
    case "found": {
      const { of, series, missing } = event;
      const current = of.material === page.state.material && of.compare === page.state.compare;
      const state = missing ? { ...page.state, compare: [] } : page.state;
      return { ...page, state, series, missing: missing || page.missing, learn: current ? "nothing" : page.learn };
    }
    case "shown":
      return { ...page, pictures: event.pictures };
  }
}

/** The page with another state. While a slider of a model moves, the series stay until the next picture.
 * @param {Page} page
 * @param {Partial<State>} part
 * @param {string[]} wrong
 * @param {number} at
 * @returns {Page} */
function changed(page, part, wrong, at) {
  const to = subjectOf(part.material ?? "");
  const slid =
    page.series[0]?.source === "parameters" &&
    to.changes !== null &&
    to.base === subjectOf(page.state.material).base;
  const moving = slid || Object.keys(part).every((key) => MOVED.includes(key));
  const next = { ...page, state: { ...page.state, ...part }, wrong, moving, asked: at };
  if (!("material" in part || "compare" in part)) return next;
  return slid
    ? { ...next, missing: "", learn: "parameters" }
    : { ...next, missing: "", learn: "everything", series: [] };
}
