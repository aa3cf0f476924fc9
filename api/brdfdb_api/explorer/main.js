// The page: what changes the state, and the one loop that turns the state into pictures.

import { AGAIN_MS, Problem, json } from "./api.js";
import * as begin from "./begin.js";
import * as controls from "./controls.js";
import * as copy from "./copy.js";
import { byId, element } from "./dom.js";
import * as facts from "./facts.js";
import * as list from "./list.js";
import * as parameters from "./parameters.js";
import { seriesOf } from "./series.js";
import { fromHash, subjectOf, toHash } from "./state.js";
import { VIEWS } from "./views.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {import("./api.js").Question} Question */
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
 * }} View parts: views that are shown side by side, or the view itself; idle and also: controls without effect, and
 *   those that few
 *   views have; request: what a copy asks for; answer: what the picture asks for, if that is more; known: the series
 *   that the
 *   service knows there; draw: the picture, and its caption; begin: what hands and keys do in it */

const [title, message, caption, picture] = [
  byId("title", HTMLElement),
  byId("message", HTMLElement),
  byId("caption", HTMLElement),
  byId("picture", HTMLElement),
];
const SLOW_MS = 200; // after which people are told that a picture is on its way
const REST_MS = 250; // after which a slider rests
const LINK_MS = 200; // browsers slow pages down that write their address at every move of a slider
const MOVED = ["theta_i", "phi_i", "theta_r", "turn", "nm", "exposure"];

let { state, wrong } = fromHash(location.hash, VIEWS); // wrong: what is wrong in the link, until a hand changes something
/** @type {Series[]} */
let series = []; // what is shown; emptied when it has to be found anew
let stop = new AbortController();
let asked = 0; // when the picture was asked for; the first one when the page was
let wanted = false,
  working = false;
let linked = 0,
  again = 0;
let stale = false,
  fresh = true; // whether parameters have moved; whether the facts are to be shown anew
let drawn = false, // whether there has been a picture; what is not needed for it waits
  complete = false; // whether all pictures of a view have been there, for which those of the list wait
let quick = false,
  resting = 0; // whether a slider moves; the picture is drawn again, finely, once it rests
/** @type {Map<string, { key: string, hurried: boolean, answers: any[] }>} */
const before = new Map(); // the last answers to each view
/** @type {Map<string, { key: string, problem: Problem }>} */
const refused = new Map(); // the last questions of each view that were, which are not asked again
let missing = ""; // why what is compared with is not shown

/** The views that are drawn for one.
 * @param {string} name */
const partsOf = (name) => (VIEWS[name].parts ?? [name]).map((part) => VIEWS[part]);

/** Change the state by hand: another material or view can be gone back from, anything else is written over its link.
 * @type {Choose} */
function choose(part) {
  const before = toHash(state),
    from = subjectOf(state.material).base;
  change(part);
  clearTimeout(linked);
  const go = ("view" in part || subjectOf(state.material).base !== from) && toHash(state) !== before;
  if (go) {
    history.replaceState(null, "", before); // which may wait to be written
    history.pushState(null, "", toHash(state));
  } else {
    linked = setTimeout(() => history.replaceState(null, "", toHash(state)), LINK_MS);
  }
}

/** Change the state: a slider's next picture waits for the one that is being drawn, anything else stops it.
 * @type {Choose} */
function change(part) {
  const to = subjectOf(part.material ?? "");
  const slid = series[0]?.source === "parameters" && to.changes !== null && to.base === subjectOf(state.material).base;
  const moved = slid || Object.keys(part).every((key) => MOVED.includes(key));
  state = { ...state, ...part };
  wrong = [];
  if ("material" in part || "compare" in part) {
    if (!slid) series = [];
    fresh = !slid;
    missing = "";
    if (slid) stale = true;
  }
  if (!moved) {
    stop.abort();
    stop = new AbortController();
  }
  if (series.length) controls.show(state, series);
  quick = moved;
  clearTimeout(resting);
  if (moved)
    resting = setTimeout(() => {
      quick = false;
      redraw();
    }, REST_MS);
  redraw();
}

function redraw(at = performance.now()) {
  asked = at;
  wanted = true;
  clearTimeout(again);
  if (!working) work();
}

async function work() {
  working = true;
  picture.ariaBusy = "true";
  while (wanted) {
    wanted = false;
    const now = { ...state, quick },
      start = asked,
      { signal } = stop;
    const slow = setTimeout(() => {
      caption.textContent = "Loading …";
    }, SLOW_MS);
    try {
      await draw(now, start, signal);
      say([...wrong, missing].filter(Boolean).join(" "));
      picture.dataset.shown = toHash(now);
      picture.dataset.detail = now.quick ? "quick" : "fine";
    } catch (problem) {
      if (signal.aborted) continue;
      const error = problem instanceof Error ? problem : new Error(String(problem));
      forget(now);
      say(error instanceof Problem ? error.message : `This cannot be drawn: ${error.message}`);
      if (!(error instanceof Problem)) console.error(error);
      if (error instanceof Problem && error.passes) again = setTimeout(redraw, AGAIN_MS);
    } finally {
      clearTimeout(slow);
    }
  }
  working = false;
  picture.ariaBusy = "false";
}

/** @param {State} now
 * @param {number} start
 * @param {AbortSignal} signal */
async function draw(now, start, signal) {
  if (series.length && !stale) facts.band(series[0].info, now);
  else await know(now, signal);
  const places = shown(now.view),
    views = partsOf(now.view);
  performance.clearMeasures("first");
  performance.clearMeasures("picture");
  const one = async (/** @type {View} */ view, /** @type {number} */ i) => {
    const { known, answers } = await answersTo(view, now, signal);
    signal.throwIfAborted();
    const said = view.draw?.(places[i], known, answers, now, series) ?? "";
    if (!performance.getEntriesByName("first").length) performance.measure("first", { start, end: performance.now() });
    return said;
  };
  const words = drawn ? [] : [await one(views[0], 0)]; // on a slow connection the first picture has no rivals
  if (!drawn) {
    drawn = true;
    begin.early.clear();
    parameters.offer(choose).catch((error) => say(error.message));
  }
  parameters.show(series[0], now);
  words.push(...(await Promise.all(views.slice(words.length).map((view, i) => one(view, i + words.length)))));
  signal.throwIfAborted();
  performance.measure("picture", { start, end: performance.now() });
  if (!complete) list.paint();
  complete = true;
  caption.replaceChildren(...words.map((text) => element("p", {}, text)));
}

/** The places of a view's pictures, shown instead of the others: what is hidden has no size to draw into.
 * @param {string | null} name */
function shown(name) {
  const parts = name ? partsOf(name).map((view) => view.name) : [];
  const stage = byId("stage", HTMLElement);
  stage.classList.toggle("several", parts.length > 1);
  for (const each of stage.children) if (each instanceof HTMLElement) each.hidden = !parts.includes(each.id);
  return parts.map((id) => byId(id, HTMLElement));
}

/** Show no picture rather than one of something else.
 * @param {State} now */
function forget(now) {
  shown(null);
  list.paint();
  caption.textContent = "";
  if (series.length) {
    parameters.show(series[0], now); // to move away from what was refused
    return;
  }
  title.textContent = now.material;
  facts.forget();
  parameters.forget();
  controls.forget();
}

/** Learn what is shown.
 * @param {State} now
 * @param {AbortSignal} signal */
async function know(now, signal) {
  list.mark(subjectOf(now.material).base);
  const found = await seriesOf(now, signal).catch((error) => {
    if (!(error instanceof Problem && !error.passes && now.compare.length)) throw error;
    return alone(now, signal, error.message);
  });
  signal.throwIfAborted();
  stale = false;
  series = found;
  const { info } = series[0];
  title.textContent = info.title;
  document.title = `${info.title} – brdfdb explorer`;
  if (fresh) facts.show(series[0]);
  fresh = false;
  facts.band(info, now);
  for (const each of series) if (each.source !== "parameters") list.update(each.info);
  controls.show(state, series);
}

/** The material without what it should be compared with, and why.
 * @param {State} now
 * @param {AbortSignal} signal
 * @param {string} sentence */
async function alone(now, signal, sentence) {
  const found = await seriesOf({ ...now, compare: [] }, signal);
  signal.throwIfAborted();
  state = { ...state, compare: [] };
  missing = sentence;
  return found;
}

/** What the service answers for a view, of the series that it knows there.
 * @param {View} view
 * @param {State} now
 * @param {AbortSignal} signal
 * @returns {Promise<{ known: Series[], answers: any[] }>} */
async function answersTo(view, now, signal, lastTry = false) {
  const all = series,
    knows = view.known ?? (() => true),
    known = all.filter((each) => knows(each, now, all));
  const answer = view.answer ?? ((each) => json(view.request?.(each, now, all) ?? "", signal));
  const hurried = Boolean(now.quick);
  // what does not change answers is 0
  const asked = { ...now, quick: 0, exposure: 0, scale: 0, axes: 0, view: 0, compare: 0 };
  const key = JSON.stringify([
    known.map(({ text, source, info }) => [text, source, info.digest]),
    all.some(({ info }) => info.anisotropic),
    asked,
  ]);
  const no = refused.get(view.name);
  if (no?.key === key) throw no.problem;
  const kept = before.get(view.name);
  const answers =
    kept?.key === key && (hurried || !kept.hurried)
      ? kept.answers
      : await Promise.all(known.map((each) => answer(each, now, all, signal))).catch((problem) => {
          if (problem instanceof Problem && !problem.passes) refused.set(view.name, { key, problem });
          throw problem;
        });
  signal.throwIfAborted();
  if (answers !== kept?.answers) before.set(view.name, { key, hurried, answers });
  if (lastTry || !answers.some((found, i) => outdates(found, known[i]))) return { known, answers };
  fresh = true;
  await know(now, signal);
  return answersTo(view, now, signal, true);
}

/** Whether an answer is of another table than what is known; what an audit found may be of an old revision.
 * @param {any} answer
 * @param {Series} each */
const outdates = ({ digest, revision, current, finding }, { info, source }) =>
  source !== "parameters" &&
  (finding ? revision !== info.audit.revision || current !== info.audit.current : digest !== info.digest);

/** Tell people: what failed, or in another colour what worked; the names of materials that come closest are links.
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
  view.begin?.(place, choose, () => state);
}
controls.listen(choose, () => state);
parameters.listen(choose, () => state, say);
copy.listen(
  () => new URL(toHash(state), location.href),
  () =>
    (series.length ? partsOf(state.view).at(-1)?.request?.(series[0], state, series) : null) ?? {
      path: "v1/materials",
    },
  say,
);
addEventListener("popstate", () => clearTimeout(linked)); // it would write its link over the one that is gone to
addEventListener("hashchange", () => {
  // a link, or the way back
  const held = fromHash(location.hash, VIEWS);
  change({ ...held.state, material: held.state.material || state.material });
  wrong = held.wrong;
});
let width = picture.clientWidth;
new ResizeObserver(() => {
  if (picture.clientWidth === width) return;
  width = picture.clientWidth;
  if (series.length) redraw();
}).observe(picture);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => series.length && redraw());
for (const link of document.querySelectorAll("a[href^='#']")) {
  link.addEventListener("click", (event) => {
    event.preventDefault(); // the address holds what is shown
    byId(link.getAttribute("href")?.slice(1) ?? "", HTMLElement).focus();
  });
}
shown(state.view); // an empty frame
if (state.material) redraw(0);
list
  .load(
    (material) => choose({ material }),
    (materials) => {
      controls.offer(materials);
      if (series.length) controls.show(state, series);
      for (const each of series) if (each.source !== "parameters") list.update(each.info);
      list.mark(subjectOf(state.material).base);
      const first = begin.first(materials);
      if (!state.material && first) {
        state = { ...state, material: first.name };
        redraw(0);
      } else if (!state.material) {
        forget(state);
        say("There is nothing to look at in the store.");
      }
    },
    () => state.material || forget(state),
  )
  .catch((error) => say(error.message));
