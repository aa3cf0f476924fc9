// The page in the browser: events change its value, and one loop draws the pictures.

import { answersTo, outdates } from "./answers.js";
import { AGAIN_MS, Problem } from "./api.js";
import * as begin from "./begin.js";
import * as controls from "./controls.js";
import * as copy from "./copy.js";
import { byId, element } from "./dom.js";
import * as facts from "./facts.js";
import * as list from "./list.js";
import { after, opened } from "./reducer.js";
import * as parameters from "./parameters.js";
import { seriesOf } from "./series.js";
import { fromHash, subjectOf, toHash } from "./link.js";
import { VIEWS } from "./views.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {import("./api.js").Question} Question */
/** @typedef {import("./reducer.js").PageEvent} PageEvent */
/** @typedef {(part: Partial<State>) => void} Choose */
/** @typedef {{
 *   name: string, title: string, order: number,
 *   parts?: string[],
 *   idle?: string[], also?: string[], turned?: boolean, shapes?: boolean, lit?: boolean,
 *   request?: (each: Series, state: State, series: Series[]) => Question,
 *   answer?: (each: Series, state: State, series: Series[], signal: AbortSignal) => Promise<any>,
 *   known?: (each: Series, state: State, series: Series[]) => boolean,
 *   draw?: (into: HTMLElement, series: Series[], answers: any[], state: State, all: Series[]) => string,
 *   begin?: (into: HTMLElement, choose: Choose, now: () => State) => void,
 * }} View parts: views side by side, or the view itself; idle: controls without effect; also: controls that few views
 *   have; request: the request that can be copied; answer: the requests of the picture, if there are others; known: the
 *   series that the service can answer for; draw: draw the picture, return its caption; begin: add pointer and keys */

const title = byId("title", HTMLElement);
const message = byId("message", HTMLElement);
const caption = byId("caption", HTMLElement);
const picture = byId("picture", HTMLElement);
const SLOW_MS = 200; // time after which the caption says that a picture is loading
const REST_MS = 250; // time without a move after which a slider rests
const LINK_MS = 200; // time between two links: browsers slow down pages that write their address at every move

let page = opened(fromHash(location.hash, VIEWS));
let stop = new AbortController(); // aborts the current picture
let drawing = false;
/** @type {Map<string, ReturnType<typeof setTimeout>>} */
const timers = new Map();

/** Act later, and once: it replaces an earlier action of the same name.
 * @param {"link" | "rest" | "again"} name
 * @param {number} ms
 * @param {() => void} act */
function later(name, ms, act) {
  clearTimeout(timers.get(name));
  timers.set(name, setTimeout(act, ms));
}

/** Let an event change the page and the controls, and draw. The next picture of a slider waits for the current one; any
 * other change aborts it.
 * @param {PageEvent} event */
function dispatch(event) {
  const { state, series } = page;
  page = after(page, event);
  if (page.series.length && (page.state !== state || page.series !== series)) controls.show(page.state, page.series);
  if (event.kind === "changed") {
    clearTimeout(timers.get("rest"));
    if (page.moving) later("rest", REST_MS, () => dispatch({ kind: "rested", at: performance.now() }));
    else {
      stop.abort();
      stop = new AbortController();
    }
  }
  if (page.asked === null) return;
  clearTimeout(timers.get("again"));
  if (!drawing) work();
}

const redraw = () => dispatch({ kind: "asked", at: performance.now() });

/** Change the state: another material or view is a step of the history, any other change replaces the link.
 * @type {Choose} */
function choose(part) {
  const before = toHash(page.state),
    from = subjectOf(page.state.material).base;
  dispatch({ kind: "changed", part, at: performance.now() });
  clearTimeout(timers.get("link"));
  const link = toHash(page.state);
  if (("view" in part || subjectOf(page.state.material).base !== from) && link !== before) {
    history.replaceState(null, "", before); // a timer may not have written it yet
    history.pushState(null, "", link);
  } else {
    later("link", LINK_MS, () => history.replaceState(null, "", toHash(page.state)));
  }
}

/** Draw pictures until no further one is requested. */
async function work() {
  drawing = true;
  picture.ariaBusy = "true";
  while (page.asked !== null) {
    const now = { ...page.state, quick: page.moving },
      start = page.asked,
      { signal } = stop;
    dispatch({ kind: "begun" });
    const slow = setTimeout(() => {
      caption.textContent = "Loading …";
    }, SLOW_MS);
    try {
      await draw(now, start, signal);
      say([...page.wrong, page.missing].filter(Boolean).join(" "));
      picture.dataset.shown = toHash(now);
      picture.dataset.detail = now.quick ? "quick" : "fine";
    } catch (problem) {
      if (signal.aborted) continue;
      const error = problem instanceof Error ? problem : new Error(String(problem));
      forget(now);
      say(error instanceof Problem ? error.message : `This cannot be drawn: ${error.message}`);
      if (!(error instanceof Problem)) console.error(error);
      if (error instanceof Problem && error.passes) later("again", AGAIN_MS, redraw);
    } finally {
      clearTimeout(slow);
    }
  }
  drawing = false;
  picture.ariaBusy = "false";
}

/** The views that a view consists of.
 * @param {string} name */
const partsOf = (name) => (VIEWS[name].parts ?? [name]).map((part) => VIEWS[part]);

/** @param {State} now
 * @param {number} start
 * @param {AbortSignal} signal */
async function draw(now, start, signal) {
  if (page.series.length && page.learn === "nothing") facts.band(page.series[0].info, now);
  else await know(now, signal);
  const places = shown(now.view),
    views = partsOf(now.view);
  performance.clearMeasures("first");
  performance.clearMeasures("picture");
  const one = async (/** @type {View} */ view, /** @type {number} */ i) => {
    const { known, answers } = await currentAnswersTo(view, now, signal);
    const said = view.draw?.(places[i], known, answers, now, page.series) ?? "";
    if (!performance.getEntriesByName("first").length) performance.measure("first", { start, end: performance.now() });
    return said;
  };
  const words = page.pictures === "none" ? [await one(views[0], 0)] : []; // alone, for slow connections
  if (page.pictures === "none") {
    dispatch({ kind: "shown", pictures: "first" });
    begin.early.clear();
    parameters.offer(choose).catch((error) => say(error.message));
  }
  parameters.show(page.series[0], now);
  words.push(...(await Promise.all(views.slice(words.length).map((view, i) => one(view, i + words.length)))));
  signal.throwIfAborted();
  performance.measure("picture", { start, end: performance.now() });
  if (page.pictures === "first") list.paint();
  dispatch({ kind: "shown", pictures: "all" });
  caption.replaceChildren(...words.map((text) => element("p", {}, text)));
}

/** Show the places of the pictures of a view and hide the others; a hidden place has no size to draw into.
 * @param {string | null} name */
function shown(name) {
  const parts = name ? partsOf(name).map((view) => view.name) : [];
  const stage = byId("stage", HTMLElement);
  stage.classList.toggle("several", parts.length > 1);
  for (const each of stage.children) if (each instanceof HTMLElement) each.hidden = !parts.includes(each.id);
  return parts.map((id) => byId(id, HTMLElement));
}

/** Remove the picture, which would be of an earlier state.
 * @param {State} now */
function forget(now) {
  shown(null);
  list.paint();
  caption.textContent = "";
  if (page.series.length) {
    parameters.show(page.series[0], now); // so that a refused parameter can be moved
    return;
  }
  title.textContent = now.material;
  facts.forget();
  parameters.forget();
  controls.forget();
}

/** Load the series and show what is known of them, without a comparison that is refused.
 * @param {State} now
 * @param {AbortSignal} signal */
async function know(now, signal) {
  const anew = page.learn === "everything";
  list.mark(subjectOf(now.material).base);
  let missing = "";
  const series = await seriesOf(now, signal).catch((error) => {
    if (!(error instanceof Problem && !error.passes && now.compare.length)) throw error;
    missing = error.message;
    return seriesOf({ ...now, compare: [] }, signal);
  });
  signal.throwIfAborted();
  dispatch({ kind: "found", of: now, series, missing });
  const { info } = series[0];
  title.textContent = info.title;
  document.title = `${info.title} – brdfdb explorer`;
  if (anew) facts.show(series[0]);
  facts.band(info, now);
  updateList();
}

/** Update the lines of the list from the loaded series. */
function updateList() {
  for (const each of page.series) if (each.source !== "parameters") list.update(each.info);
}

/** Answers for the loaded series; if a newer table was published meanwhile, it is loaded first, once.
 * @param {View} view
 * @param {State} now
 * @param {AbortSignal} signal */
async function currentAnswersTo(view, now, signal) {
  const found = await answersTo(view, now, page.series, signal);
  signal.throwIfAborted();
  if (!found.answers.some((answer, i) => outdates(answer, found.known[i]))) return found;
  dispatch({ kind: "outdated" });
  await know(now, signal);
  const again = await answersTo(view, now, page.series, signal);
  signal.throwIfAborted();
  return again;
}

/** Show a message, `bad` or `calm`; the names of the closest materials in it are links.
 * @param {string} sentence */
function say(sentence, tone = "bad") {
  const [, before, names] = /^(.*closest: )(.+)$/.exec(sentence) ?? [];
  message.className = tone;
  if (!names) message.textContent = sentence;
  else
    message.replaceChildren(
      before,
      ...names.split(", ").flatMap((name, i) => [i ? ", " : "", element("a", { href: `#material=${name}` }, name)]),
    );
}

for (const view of Object.values(VIEWS)) {
  if (!view.draw) continue;
  const place = element("div", { id: view.name, hidden: true });
  place.setAttribute("role", "group");
  place.setAttribute("aria-label", `${view.title}: the picture`);
  byId("stage", HTMLElement).append(place);
  view.begin?.(place, choose, () => page.state);
}
controls.listen(choose, () => page.state);
parameters.listen(choose, () => page.state, say);
copy.listen(
  () => new URL(toHash(page.state), location.href),
  () => {
    const { state, series } = page,
      [first] = series;
    return (first && partsOf(state.view).at(-1)?.request?.(first, state, series)) || { path: "v1/materials" };
  },
  say,
);
addEventListener("popstate", () => clearTimeout(timers.get("link"))); // it would overwrite the new link
addEventListener("hashchange", () => {
  const { state, wrong } = fromHash(location.hash, VIEWS);
  const material = state.material || page.state.material;
  dispatch({ kind: "changed", part: { ...state, material }, wrong, at: performance.now() });
});
let width = picture.clientWidth;
new ResizeObserver(() => {
  if (picture.clientWidth === width) return;
  width = picture.clientWidth;
  if (page.series.length) redraw();
}).observe(picture);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => page.series.length && redraw());
for (const link of document.querySelectorAll("a[href^='#']")) {
  link.addEventListener("click", (event) => {
    event.preventDefault(); // the address is the link of the view
    byId(link.getAttribute("href")?.slice(1) ?? "", HTMLElement).focus();
  });
}
shown(page.state.view); // an empty frame
if (page.state.material) dispatch({ kind: "asked", at: 0 });
list
  .load(
    (material) => choose({ material }),
    (materials) => {
      controls.offer(materials);
      if (page.series.length) controls.show(page.state, page.series);
      updateList();
      list.mark(subjectOf(page.state.material).base);
      const first = begin.first(materials);
      if (!page.state.material && first) {
        dispatch({ kind: "changed", part: { material: first.name }, wrong: page.wrong, at: 0 });
      } else if (!page.state.material) {
        forget(page.state);
        say("The store has no material to show.");
      }
    },
    () => page.state.material || forget(page.state),
  )
  .catch((error) => say(error.message));
