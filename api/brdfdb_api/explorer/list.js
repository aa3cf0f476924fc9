// The list of materials: fetched page by page, searched, filtered, and walked with arrow keys.

import { AGAIN_MS, json } from "./api.js";
import { QUESTIONS, chip, element, percent } from "./dom.js";

const [search, model, paper, verdict, count, list] = ["search", "model", "paper", "verdict", "count", "list"].map((id) =>
  document.getElementById(id));

const materials = [];
let active = null; // the option that arrow keys have reached
let chosen = "";
let choose = () => {};

/** Fill the list; `onChoose` gets the name of what is chosen, `onPage` the materials so far, after each page;
 * `onFail` is called when a page does not come, which is asked for again where that may pass by itself. */
export async function load(onChoose, onPage, onFail) {
  choose = onChoose;
  for (let path = "v1/materials?limit=1000"; path;) {
    const page = await arrived(path, onFail);
    materials.push(...page.materials);
    list.append(...page.materials.map(option));
    offer(model, page.materials.map((each) => [modelOf(each), each.measured ? "measured" : each.model_title]));
    offer(paper, page.materials.map((each) => [paperOf(each), paperOf(each)]));
    offer(verdict, page.materials.map((each) => [words(each), words(each)]));
    filter();
    onPage(materials);
    path = page.next?.replace(/^\//, "");
  }
}

/** A page, once it is there; until then the list says why it is not. */
async function arrived(path, onFail) {
  for (;;) {
    try {
      return await json(path);
    } catch (error) {
      count.textContent = error.message;
      onFail();
      if (!error.passes) throw error;
      await pause(AGAIN_MS);
    }
  }
}

const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Show what was learnt of a material since its line was made: its verdict. */
export function update(each) {
  const made = document.getElementById(`m-${each.name}`);
  if (!made) return;
  made.dataset.verdict = words(each);
  made.querySelector(".answers").replaceWith(answers(each));
  offer(verdict, [[words(each), words(each)]]);
}

/** Show which material is looked at. */
export function mark(name) {
  chosen = name;
  for (const each of list.children) each.setAttribute("aria-selected", each.dataset.name === name);
  const now = [...list.children].find((each) => each.dataset.name === name);
  if (now) reach(now);
}

/** The paper in a source such as "Ward 1992, section 6". */
const paperOf = (each) => each.source?.split(",")[0];

/** The verdict on the current revision, by a line of the catalogue or by all that is known of a material. */
const words = ({ damaged, verdict, audit }) =>
  damaged ? "damaged" : verdict ?? (audit?.current ? audit.verdict : "not audited");

/** The answers of the audit to its two questions, or the verdict where it has none. */
function answers(each) {
  const from = each.audit?.current ? each.audit : each;
  const chips = Object.entries(QUESTIONS).filter(([key]) => from[key]).map(([key, question]) =>
    Object.assign(chip(from[key].word, `${SHORT[key]}: ${from[key].text}`), { title: `${question} ${from[key].reason}` }));
  return element("span", { className: "answers" }, ...(chips.length && !each.damaged ? chips : [chip(words(each))]));
}

const SHORT = { as_published: "as published", conserves_energy: "energy" };

const modelOf = (each) => (each.measured ? "measured" : each.model ?? "");

function option(each) {
  const swatch = element(each.thumbnail ? "img" : "span", { className: "swatch", alt: "", loading: "lazy" });
  if (each.thumbnail) swatch.src = `${each.thumbnail.slice(1)}?size=48`;
  const name = element("span", { className: "name" }, each.title || each.name, ...grey(each));
  const made = element("li", { id: `m-${each.name}`, title: each.damaged ?? each.source }, swatch, name, answers(each),
    element("span", { className: "quiet" }, errors(each)));
  made.setAttribute("role", "option");
  made.setAttribute("aria-selected", each.name === chosen);
  Object.assign(made.dataset, {
    name: each.name, model: modelOf(each), paper: paperOf(each) ?? "", verdict: words(each),
    text: `${each.name} ${each.title} ${each.model_title} ${each.source}`.toLowerCase(),
  });
  return made;
}

/** The error of the table and that of its formula, in a line. */
function errors({ damaged, error_p99: table, formula_error: formula, measured }) {
  if (damaged) return "";
  if (measured) return `measured, error of the table ${percent(table)}`;
  const rung = !formula ? "not measured" : formula.against === "measured" ? percent(formula.p99)
    : formula.against === "highest rung" ? "0, exact form" : "none known";
  return `error: table ${table === null || table === undefined ? "not measured" : percent(table)}, formula ${rung}`;
}

/** A word beside the name of a material whose colour is not known. */
const grey = ({ spectrum }) => (spectrum && spectrum !== "spectral" ?
  [" ", element("span", { className: "quiet" }, spectrum === "grey" ? "grey" : "one wavelength, shown grey")] : []);

function offer(select, pairs) {
  const known = new Set([...select.options].map((each) => each.value));
  for (const [value, text] of new Map(pairs.filter(([value]) => value))) {
    if (!known.has(value)) select.add(new Option(text, value));
  }
}

function filter() {
  const asked = search.value.toLowerCase().split(/\s+/);
  for (const each of list.children) {
    const filters = [[model, "model"], [paper, "paper"], [verdict, "verdict"]];
    each.hidden = !asked.every((word) => each.dataset.text.includes(word)) ||
      filters.some(([select, key]) => !["", each.dataset[key]].includes(select.value));
  }
  const shown = visible();
  count.textContent = shown.length === materials.length ? `${materials.length} materials` :
    `${shown.length} of ${materials.length} materials`;
  reach(shown.find((each) => each.dataset.name === chosen) ?? shown[0]);
}

const visible = () => [...list.children].filter((each) => !each.hidden);

function reach(option) {
  active?.classList.remove("active");
  active = option ?? null;
  active?.classList.add("active");
  if (active) { // within the list alone: the page stays where it is
    const { offsetTop: top, offsetHeight: height } = active;
    list.scrollTop = Math.min(top, Math.max(list.scrollTop, top + height - list.clientHeight));
  }
  for (const each of [list, search]) each.setAttribute("aria-activedescendant", active?.id ?? "");
}

function walk(event) {
  const shown = visible(), at = shown.indexOf(active);
  const steps = { ArrowDown: at + 1, ArrowUp: at - 1, ...(event.target === list && { Home: 0, End: shown.length - 1 }) };
  if (event.key in steps) reach(shown[Math.max(0, Math.min(steps[event.key], shown.length - 1))]);
  else if (event.key === "Enter" && active) choose(active.dataset.name);
  else return;
  event.preventDefault();
}

search.addEventListener("input", filter);
for (const each of [model, paper, verdict]) each.addEventListener("change", filter);
for (const each of [list, search]) each.addEventListener("keydown", walk);
list.addEventListener("click", (event) => {
  const option = event.target.closest("li");
  if (option) choose(option.dataset.name);
});
