// The list of materials: fetched page by page, searched, filtered, and walked with arrow keys.

import { AGAIN_MS, Problem, json, withQuery } from "./api.js";
import { LIST } from "./begin.js";
import { byId, chip, element, isGood, isWrong, percent } from "./dom.js";

const search = byId("search", HTMLInputElement),
  count = byId("count", HTMLElement),
  list = byId("list", HTMLElement);
const [model, paper, verdict] = ["model", "paper", "verdict"].map((id) => byId(id, HTMLSelectElement));

/** @type {any[]} */
const materials = [];
/** @type {HTMLElement | null} */
let active = null; // the option selected by arrow keys
let chosen = "";
let painted = false;
let choose = (/** @type {string} */ _) => {};
let arrive = () => {};
/** @type {Promise<void>} */
const begun = new Promise((resolve) => (arrive = resolve)); // the first page has arrived or failed
const [NEAR, MOST_NEAR] = [0.6, 5]; // similarity of names offered for an unknown one, and their number
const DARK = 0.02; // largest albedo of a nearly black material

/** All options. */
const options = () => /** @type {HTMLElement[]} */ ([...list.children]);

/** Load the list. `onChoose` gets the name of a chosen material, `onPage` all materials so far, after each page;
 * `onFail` is called when a page fails, before a second request if that may succeed.
 * @param {(name: string) => void} onChoose
 * @param {(materials: any[]) => void} onPage
 * @param {() => void} onFail */
export async function load(onChoose, onPage, onFail) {
  choose = onChoose;
  for (let path = LIST; path;) {
    const page = await arrived(path, onFail);
    materials.push(...page.materials);
    list.append(...page.materials.map(option));
    for (const each of page.materials) {
      offer(model, modelOf(each), each.measured ? "measured" : each.model_title);
      offer(paper, paperOf(each));
      offer(verdict, words(each));
    }
    filter();
    if (painted) paint();
    onPage(materials);
    arrive();
    path = page.next?.replace(/^\//, "");
  }
}

/** A page of the catalogue; until it arrives, the list shows the error.
 * @param {string} path
 * @param {() => void} onFail */
async function arrived(path, onFail) {
  for (;;) {
    try {
      return await json(path);
    } catch (error) {
      count.textContent = error instanceof Error ? error.message : String(error);
      onFail();
      arrive();
      if (!(error instanceof Problem && error.passes)) throw error;
      await pause(AGAIN_MS);
    }
  }
}

const pause = (/** @type {number} */ ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Throw a problem with the closest names if no material has a name. It searches the list, and then the store, because
 * a request to an unknown address would also be an error of the page.
 * @param {string} name */
export async function check(name) {
  await begun;
  const has = (/** @type {any[]} */ some) => some.some((each) => each.name === name);
  if (!materials.length || has(materials)) return;
  if (has((await json(withQuery("v1/materials", { q: name, limit: 1000 }))).materials)) return;
  const near = materials
    .map((each) => ({ name: each.name, like: likeness(name, each.name) }))
    .filter(({ like }) => like >= NEAR)
    .sort((a, b) => b.like - a.like)
    .slice(0, MOST_NEAR);
  const words = near.length ? `; closest: ${near.map((each) => each.name).join(", ")}` : "";
  throw new Problem(`no material '${name}' in the store${words}`);
}

/** How alike two names are, 0 to 1: the share of their letters that they have in common, in the same order.
 * @param {string} a
 * @param {string} b */
function likeness(a, b) {
  let row = Array(b.length + 1).fill(0); // longest common subsequence of what is read of a, and the first letters of b
  for (const letter of a) {
    const next = [0];
    for (let j = 0; j < b.length; j += 1) next.push(letter === b[j] ? row[j] + 1 : Math.max(row[j + 1], next[j]));
    row = next;
  }
  return (2 * row[b.length]) / (a.length + b.length || 1);
}

// browsers that load images lazily begin far below what is seen: 49 pictures in place of 8
const seen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (!isIntersecting || !(target instanceof HTMLImageElement)) continue;
    target.src = target.dataset.src ?? "";
    seen.unobserve(target);
  }
});

/** Show the pictures of the list, as they come into sight; they wait for the first picture of the page. */
export function paint() {
  painted = true;
  for (const each of list.querySelectorAll("img")) if (each.dataset.src && !each.src) seen.observe(each);
}

/** Show what was learnt of a material since its line was made: its verdict.
 * @param {any} each */
export function update(each) {
  const made = document.getElementById(`m-${each.name}`);
  if (!made) return;
  made.dataset.verdict = words(each);
  made.querySelector(".marks")?.replaceWith(marks(each));
  offer(verdict, words(each));
}

/** Mark the current material.
 * @param {string} name */
export function mark(name) {
  chosen = name;
  for (const each of options()) each.setAttribute("aria-selected", String(each.dataset.name === name));
  const now = options().find((each) => each.dataset.name === name);
  if (now) reach(now, "middle");
}

/** The paper in a source such as "Ward 1992, section 6".
 * @param {any} each
 * @returns {string} */
const paperOf = (each) => each.source?.split(",")[0];

/** The verdict on the current revision, from a line of the catalogue or the document of a material.
 * @param {any} each
 * @returns {string} */
const words = ({ damaged, verdict, audit }) =>
  damaged ? "damaged" : (verdict ?? (audit?.current ? audit.verdict : "not audited"));

/** Marks of what is wrong with a material: its table, its formula, its error or its energy.
 * @param {any} each */
function marks(each) {
  const from = each.audit?.current ? each.audit : each,
    { as_published: published, conserves_energy: energy } = from;
  /** @type {[string, string, string][]} */
  const wrong = [];
  if (each.damaged) wrong.push(["damaged", "damaged", each.damaged]);
  if (published && (each.measured ? isWrong(published.word) : !isGood(published.word)))
    wrong.push([
      published.word,
      `not as ${each.measured ? "the data say" : "published"}: ${published.text}`,
      published.reason,
    ]);
  if (energy && isWrong(energy.word) && energy.word !== "gains")
    wrong.push([energy.word, `energy: ${energy.text}`, energy.reason]);
  if (!wrong.length && isWrong(words(each))) wrong.push([words(each), words(each), ""]);
  if (each.incomplete) wrong.push(["outside", "incomplete", each.incomplete]);
  return element(
    "span",
    { className: "marks" },
    ...wrong.map(([word, text, why]) => Object.assign(chip(word, text), { title: why })),
  );
}

const modelOf = (/** @type {any} */ each) => (each.measured ? "measured" : (each.model ?? ""));

/** @param {any} each */
function option(each) {
  const image = element("img", { alt: "", width: 44, height: 44, decoding: "async" });
  if (each.thumbnail) image.dataset.src = `${each.thumbnail.slice(1)}?size=88`;
  const name = element("span", { className: "name" }, each.title || each.name);
  const made = element(
    "li",
    { id: `m-${each.name}`, title: each.damaged ?? each.source },
    image,
    name,
    element("span", { className: "quiet" }, about(each)),
    marks(each),
  );
  made.setAttribute("role", "option");
  made.setAttribute("aria-selected", String(each.name === chosen));
  Object.assign(made.dataset, {
    name: each.name,
    model: modelOf(each),
    paper: paperOf(each) ?? "",
    verdict: words(each),
    text: `${each.name} ${each.title} ${each.model_title} ${each.source}`.toLowerCase(),
  });
  return made;
}

/** A material in one line.
 * @param {any} each */
const about = ({ damaged, measured, model_title: title, spectrum, anisotropic, largest_albedo: most }) =>
  damaged
    ? ""
    : [most?.albedo < DARK ? `reflects ${percent(most.albedo)}` : "", measured ? "measured" : title, spectrum === "spectral" ? "" : spectrum, anisotropic ? "anisotropic" : ""]
        .filter(Boolean)
        .join(", ");

/** @param {HTMLSelectElement} select
 * @param {string} value
 * @param {string} text */
function offer(select, value, text = value) {
  if (value && ![...select.options].some((each) => each.value === value)) select.add(new Option(text, value));
}

function filter() {
  const asked = search.value.toLowerCase().split(/\s+/);
  for (const each of options()) {
    const {
      dataset: { text, model: by, paper: source, verdict: word },
    } = each;
    each.hidden =
      !asked.every((part) => text?.includes(part)) ||
      [
        [model.value, by],
        [paper.value, source],
        [verdict.value, word],
      ].some(([value, own]) => value !== "" && value !== own);
  }
  const shown = visible();
  count.textContent =
    shown.length === materials.length
      ? `${materials.length} materials`
      : `${shown.length} of ${materials.length} materials`;
  reach(shown.find((each) => each.dataset.name === chosen) ?? shown[0], "middle");
}

const visible = () => options().filter((each) => !each.hidden);

/** Make a line the active one and scroll to it, to the nearest edge or to the middle.
 * @param {HTMLElement | undefined} to
 * @param {"edge" | "middle"} place */
function reach(to, place = "edge") {
  active?.classList.remove("active");
  active = to ?? null;
  active?.classList.add("active");
  if (active) {
    // within the list alone: the page stays where it is
    const { offsetTop: top, offsetHeight: height } = active,
      last = top + height - list.clientHeight;
    const seen = list.scrollTop <= top && list.scrollTop >= last;
    if (!seen) list.scrollTop = place === "middle" ? (top + last) / 2 : Math.min(top, Math.max(list.scrollTop, last));
  }
  for (const each of [list, search]) each.setAttribute("aria-activedescendant", active?.id ?? "");
}

/** @param {KeyboardEvent} event */
function walk(event) {
  const shown = visible(),
    at = active ? shown.indexOf(active) : -1;
  /** @type {Record<string, number>} */
  const steps = {
    ArrowDown: at + 1,
    ArrowUp: at - 1,
    ...(event.target === list && { Home: 0, End: shown.length - 1 }),
  };
  if (event.key in steps) reach(shown[Math.max(0, Math.min(steps[event.key], shown.length - 1))]);
  else if (event.key === "Enter" && active?.dataset.name) choose(active.dataset.name);
  else return;
  event.preventDefault();
}

search.addEventListener("input", filter);
for (const each of [model, paper, verdict]) each.addEventListener("change", filter);
for (const each of [list, search]) each.addEventListener("keydown", walk);
list.addEventListener("click", (event) => {
  const line = event.target instanceof Element && event.target.closest("li");
  if (line && line.dataset.name) choose(line.dataset.name);
});
