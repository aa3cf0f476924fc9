// The page: what changes the state, and the one loop that turns the state into a picture.

import { AGAIN_MS, Problem, json } from "./api.js";
import * as controls from "./controls.js";
import * as copy from "./copy.js";
import { element } from "./dom.js";
import * as facts from "./facts.js";
import * as list from "./list.js";
import { seriesOf } from "./series.js";
import { fromHash, toHash } from "./state.js";
import { VIEWS } from "./views.js";

const [title, message, caption, picture] = ["title", "message", "caption", "picture"].map((id) => document.getElementById(id));
const placeOf = ({ place, name }) => place ?? name; // where a view is drawn, one shown at a time
const SLOW_MS = 200; // after which people are told that a picture is on its way
const LINK_MS = 200; // browsers slow pages down that write their address at every move of a slider

let state = fromHash(location.hash, VIEWS);
let series = []; // what is shown; emptied when it has to be found anew
let stop = new AbortController();
let asked = 0; // when the picture was asked for; the first one when the page was
let wanted = false, working = false;
let linked = 0, again = 0;
let missing = ""; // why what is compared with is not shown

/** Change the state by hand: another material or view can be gone back from, anything else is written over its link. */
function choose(part) {
  const before = toHash(state);
  change(part);
  clearTimeout(linked);
  const go = ("material" in part || "view" in part) && toHash(state) !== before;
  if (go) {
    history.replaceState(null, "", before); // which may wait to be written
    history.pushState(null, "", toHash(state));
  } else {
    linked = setTimeout(() => history.replaceState(null, "", toHash(state)), LINK_MS);
  }
}

/** Change the state: a slider's next picture waits for the one that is being drawn, anything else stops it. */
function change(part) {
  const turned = Object.keys(part).every((key) => ["theta_i", "phi_i", "theta_r", "turn", "nm"].includes(key));
  state = { ...state, ...part };
  if ("material" in part || "compare" in part) {
    series = [];
    missing = "";
  }
  if (!turned) {
    stop.abort();
    stop = new AbortController();
  }
  if (series.length) controls.show(state, series);
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
    const now = state, start = asked, { signal } = stop;
    const slow = setTimeout(() => { caption.textContent = "Loading …"; }, SLOW_MS);
    try {
      await draw(now, signal);
      say(missing);
      performance.clearMeasures("picture");
      performance.measure("picture", { start, end: performance.now() });
      picture.dataset.shown = toHash(now);
    } catch (error) {
      if (signal.aborted) continue;
      forget(now);
      say(error instanceof Problem ? error.message : `This cannot be drawn: ${error.message}`);
      if (!(error instanceof Problem)) console.error(error);
      if (error.passes) again = setTimeout(redraw, AGAIN_MS);
    } finally {
      clearTimeout(slow);
    }
  }
  working = false;
  picture.ariaBusy = "false";
}

async function draw(now, signal) {
  if (series.length) facts.band(series[0].info, now);
  else await know(now, signal);
  const view = VIEWS[now.view];
  const [answers] = await Promise.all([answersTo(now, signal), view.ready?.()]);
  signal.throwIfAborted();
  const words = await view.draw(shown(placeOf(view)), series, answers, now);
  signal.throwIfAborted();
  caption.textContent = words;
}

/** The place of a picture, shown instead of the others: what is hidden has no size to draw into. */
function shown(id) {
  for (const each of picture.querySelectorAll(":scope > div")) each.hidden = each.id !== id;
  return document.getElementById(id);
}

/** Show no picture rather than one of something else. */
function forget(now) {
  shown(null);
  caption.textContent = "";
  if (series.length) return;
  title.textContent = now.material;
  facts.forget();
  controls.forget();
}

/** Learn what is shown. */
async function know(now, signal) {
  list.mark(now.material);
  const found = await seriesOf(now, signal).catch((error) => {
    if (!(error instanceof Problem && now.compare)) throw error;
    return alone(now, signal, error.message);
  });
  signal.throwIfAborted();
  series = found;
  title.textContent = series[0].info.title;
  document.title = `${series[0].info.title} – brdfdb explorer`;
  facts.show(series[0].info);
  facts.band(series[0].info, now);
  for (const { info } of series) list.update(info);
  controls.show(state, series);
}

/** The material without what it should be compared with, and why. */
async function alone(now, signal, sentence) {
  const found = await seriesOf({ ...now, compare: "" }, signal);
  signal.throwIfAborted();
  state = { ...state, compare: "" };
  missing = sentence;
  return found;
}

/** The address of what a view shows of one series. */
const request = (each, now) => VIEWS[now.view].request(each, now, series);

/** What the service answers for a view, of the series that it knows there. */
async function answersTo(now, signal, lastTry = false) {
  const { known: knows = () => true, answer = (each) => json(request(each, now), signal) } = VIEWS[now.view];
  const known = series.filter((each) => knows(each, now));
  const answers = await Promise.all(known.map((each) => answer(each, now, signal)));
  signal.throwIfAborted();
  if (lastTry || !answers.some((answer, i) => outdates(answer, known[i].info))) return answers;
  await know(now, signal);
  return answersTo(now, signal, true);
}

/** Whether an answer is of another revision than what is known; what an audit found may be of an old one. */
const outdates = ({ revision, current, finding }, info) => (finding ?
  revision !== info.audit.revision || current !== info.audit.current : revision !== info.revision);

/** Tell people: what failed, or in another colour what worked. */
function say(sentence, tone = "bad") {
  message.className = tone;
  message.textContent = sentence;
}

for (const view of Object.values(VIEWS)) {
  if (document.getElementById(placeOf(view))) continue;
  const place = element("div", { id: placeOf(view), role: "img", hidden: true });
  place.setAttribute("aria-labelledby", "caption");
  caption.before(place);
  view.begin?.(place);
}
controls.listen(choose);
copy.listen(
  () => new URL(toHash(state), location.href),
  () => (series.length ? request(series[0], state) : "v1/materials"), say);
addEventListener("hashchange", () => { // a link, or the way back
  clearTimeout(linked);
  const held = fromHash(location.hash, VIEWS);
  change({ ...held, material: held.material || state.material });
});
let width = picture.clientWidth;
new ResizeObserver(() => {
  if (picture.clientWidth === width) return;
  width = picture.clientWidth;
  if (series.length) redraw();
}).observe(picture);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => series.length && redraw());
shown(placeOf(VIEWS[state.view])); // an empty frame
if (state.material) redraw(0);
list.load((material) => choose({ material, compare: state.compare === material ? "" : state.compare }), (materials) => {
  controls.offer(materials);
  if (series.length) controls.show(state, series);
  for (const { info } of series) list.update(info);
  list.mark(state.material);
  const first = materials.find((each) => !each.damaged);
  if (!state.material && first) {
    state = { ...state, material: first.name };
    redraw(0);
  } else if (!state.material) {
    forget(state);
    say("There is nothing to look at in the store.");
  }
}, () => state.material || forget(state)).catch((error) => say(error.message));
