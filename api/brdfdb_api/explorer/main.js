// The page: what changes the state, and the one loop that turns the state into a picture.

import { AGAIN_MS, Problem, json } from "./api.js";
import * as controls from "./controls.js";
import * as copy from "./copy.js";
import { cut } from "./cut.js";
import { element } from "./dom.js";
import * as facts from "./facts.js";
import { figure } from "./figures.js";
import { hemisphere, turns } from "./hemisphere.js";
import * as list from "./list.js";
import { againstAudit, request, seriesOf } from "./series.js";
import { lit, spheres } from "./sphere.js";
import { fromHash, toHash } from "./state.js";

const [title, message, caption, picture] = ["title", "message", "caption", "picture"].map((id) => document.getElementById(id));
const PLACES = { cut: "cut", hemisphere: "hemisphere", sphere: "spheres" }; // where a view is drawn, one shown at a time
const placeOf = ({ view }) => PLACES[view] ?? "plot";
const DRAWN = { // of the buttons, those that save and restore: more would lie over titles and legends
  displaylogo: false, responsive: true, showSendToCloud: false, modeBarButtonsToRemove: [
    "lasso2d", "select2d", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "autoScale2d",
  ],
};
const NARROW = 560; // pixels in which two pictures do not stand side by side
const SLOW_MS = 200; // after which people are told that a picture is on its way
const LINK_MS = 200; // browsers slow pages down that write their address at every move of a slider

let state = fromHash(location.hash);
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
  const words = await (now.view in PLACES ? drawOwn : drawPlot)(now, signal);
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

async function drawOwn(now, signal) {
  const answers = await answersTo(now, signal);
  return { cut, hemisphere, sphere: spheres }[now.view](shown(placeOf(now)), series, answers, now);
}

async function drawPlot(now, signal) {
  const [answers, Plotly] = await Promise.all([answersTo(now, signal), loaded()]);
  signal.throwIfAborted();
  const plot = shown(placeOf(now));
  const width = plot.clientWidth, stacked = width < NARROW && answers.length > 1 && now.view === "half-difference";
  plot.classList.toggle("stacked", stacked);
  const { data, layout, caption: words } = figure(now.view, series, answers, now, { width, stacked });
  await Plotly.react(plot, data, layout, DRAWN);
  return words;
}

/** What the service answers for a view; the albedo of a model that nobody audited it does not know. */
async function answersTo(now, signal, lastTry = false) {
  const known = now.view !== "albedo" ? series : series.filter((each) => each.source === "table" || againstAudit(each, now));
  const answers = await Promise.all(known.map((each) =>
    (now.view === "sphere" ? lit(each, now, signal) : json(request(each, now, series), signal))));
  signal.throwIfAborted();
  if (lastTry || !answers.some((answer, i) => outdates(answer, known[i].info))) return answers;
  await know(now, signal);
  return answersTo(now, signal, true);
}

/** Whether an answer is of another revision than what is known; what an audit found may be of an old one. */
const outdates = ({ revision, current, finding }, info) => (finding ?
  revision !== info.audit.revision || current !== info.audit.current : revision !== info.revision);

let library; // plotly.js, once it is asked for

/** plotly.js, which takes a second to run: what is known already is shown before. */
function loaded() {
  library ??= new Promise((go) => requestAnimationFrame(() => setTimeout(go))).then(() => new Promise((resolve, reject) => {
    const script = element("script", { src: document.getElementById("plotly").href });
    script.addEventListener("load", () => resolve(globalThis.Plotly));
    script.addEventListener("error", () => reject(new Problem("plotly.js did not arrive: load this page again")));
    document.head.append(script);
  }));
  return library;
}

/** Tell people: what failed, or in another colour what worked. */
function say(sentence, tone = "bad") {
  message.className = tone;
  message.textContent = sentence;
}

/** What a copied request asks for: of a sphere, which is thousands of directions, its middle. */
const copiedOf = (now) => (now.view === "sphere" ? { ...now, theta_r: 0 } : now);

controls.listen(choose);
turns(document.getElementById("hemisphere"));
copy.listen(
  () => new URL(toHash(state), location.href),
  () => (series.length ? request(series[0], copiedOf(state), series) : "v1/materials"), say);
addEventListener("hashchange", () => { // a link, or the way back
  clearTimeout(linked);
  const held = fromHash(location.hash);
  change({ ...held, material: held.material || state.material });
});
let width = picture.clientWidth;
new ResizeObserver(() => {
  if (picture.clientWidth === width) return;
  width = picture.clientWidth;
  if (series.length) redraw();
}).observe(picture);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => series.length && redraw());
shown(placeOf(state)); // an empty frame
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
