// Facts about a material, next to the picture: the verdict in a sentence, and folded details.

import { byId, chip, element, isGood, isWrong, percent, short } from "./dom.js";
import { nearest } from "./series.js";

/** @typedef {[string | Node, string | Node, ...(string | undefined)[]]} Row a term, its value, and small lines below */

const QUESTIONS = {
  as_published: "is it what the paper says?",
  conserves_energy: "does the published model conserve energy?",
};
const OF_DATA = { as_published: "is it what the data say?", conserves_energy: "do the data conserve energy?" };
const aside = byId("facts", HTMLElement);

/** Show the facts about a material, or about a model with other parameters.
 * @param {import("./series.js").Series} series */
export function show({ info, source }) {
  const { attributes, error, audit } = info;
  if (source === "parameters") {
    aside.replaceChildren(
      element(
        "p",
        { className: "verdict" },
        "Computed with your own parameters: neither tabulated nor audited.",
      ),
      element("h3", {}, "Surface"),
      pairs([
        ["model", info.model_title],
        ["based on", info.base.title],
        ["source", info.base.attributes.source],
      ]),
    );
    return;
  }
  aside.replaceChildren(
    element("p", { className: "verdict" }, ...verdict(info)),
    element("h3", {}, "Surface"),
    pairs([
      [
        info.measured ? "measured" : "model",
        info.measured
          ? origin(info.measured)
          : `${attributes.model_title ?? info.model}, ${attributes.model_equation ?? ""}`,
      ],
      ["source", attributes.source],
      ...optional("n, k", attributes.refractive_index),
      ["kind", `${info.anisotropic ? "anisotropic" : "isotropic"}, ${range(info.wavelength_nm)}`],
      ...optional("note", attributes.note),
    ]),
    ...(info.parameters.length
      ? [
          folded(
            "Parameters",
            pairs(
              info.parameters.map((/** @type {any} */ each) => [
                each.name,
                value(each),
                each.meaning,
                each.source === attributes.source ? "" : each.source,
                assumed(each, attributes),
              ]),
            ),
          ),
        ]
      : []),
    folded(
      "Errors",
      ...(info.measured ? [element("h4", {}, "Of the data"), pairs(data(info.measured))] : []),
      element("h4", {}, `Of the table against ${info.measured ? "the data" : "its formula"}`),
      error
        ? pairs([
            ["99 of 100", `within ${percent(error.overall.p99)}`],
            ["median", percent(error.overall.median)],
            ["largest", percent(error.overall.max), error.worst?.why ?? ""],
            ["at this θᵢ", element("span", { id: "band" })],
          ])
        : element("p", {}, "not measured"),
      ...(info.measured
        ? []
        : [
            element("h4", {}, "Of the formula against the most exact form"),
            ...formula(info.formula_error),
            element("h4", {}, "Of the formula against a surface"),
            element("p", {}, info.surface_error?.sentence ?? "not compared with rays"),
          ]),
    ),
    folded(
      "Audit",
      pairs(above(info.largest_albedo)),
      ...(audit
        ? audited(audit, info.measured ? OF_DATA : QUESTIONS)
        : [element("p", {}, "not audited; run ", element("code", {}, "brdfdb audit"))]),
    ),
    folded("Data", element("p", { className: "links" }, ...links(info))),
    element("p", { className: "quiet" }, `${info.name}, revision ${info.revision}`),
  );
}

/** The verdict as a sentence.
 * @param {any} info
 * @returns {(string | Node)[]} */
function verdict({ audit, error, measured, formula_error: of }) {
  const table = error
    ? `the table is within ${percent(error.overall.p99)} of ${measured ? "the data" : "its formula"}`
    : "the error of the table was not measured";
  if (!audit?.current || !audit.as_published) return [`Not audited at this revision; ${table}.`];
  const { as_published: published, conserves_energy: energy } = audit;
  const form = of?.against === "highest rung" ? ", which is the exact form" : "";
  const wrong = isWrong(published.word) ? `; ${published.reason}` : "";
  const first = measured
    ? `${measured.simulation ? "Simulated" : "Measured"} data: ${table}${wrong}.`
    : isGood(published.word)
      ? `It is what the paper says: ${table}${form}.`
      : `It is not what the paper says (${published.text}): ${table}.`;
  const words = measured
    ? `Do the data conserve energy? ${energy.text[0].toUpperCase()}${energy.text.slice(1)}.`
    : isGood(energy.word)
      ? "It conserves energy."
      : energy.text.startsWith("no")
        ? `It does not conserve energy${energy.text.slice(2)}.`
        : `On energy: it ${energy.text}.`;
  const mark =
    measured || isGood(published.word)
      ? chip(audit.verdict, audit.verdict_in_words || audit.verdict)
      : chip(published.word);
  return [mark, ` ${first} ${words}`];
}

/** Details behind their title.
 * @param {string} title
 * @param {(string | Node)[]} children */
const folded = (title, ...children) => element("details", {}, element("summary", {}, title), ...children);

/** @param {string} term
 * @param {string} text
 * @returns {Row[]} */
const optional = (term, text) => (text ? [[term, text]] : []);

/** The origin of measured data.
 * @param {any} measured */
const origin = ({ by, file, samples, incidences, extrapolated }) =>
  [
    samples
      ? `${samples} samples of ${incidences} lights`
      : `known ${extrapolated === null ? "everywhere" : "between its values"}`,
    by,
    file && `file ${file}`,
  ]
    .filter(Boolean)
    .join("; ");

const largest = (/** @type {{ error: number }[]} */ energies) => Math.max(...energies.map(({ error }) => error));

/** The accuracy of measured data, and the measured share of all directions.
 * @param {any} measured
 * @returns {Row[]} */
const data = ({ held_out: left, at_samples: at, glints, noise, extrapolated, negative, changes }) => [
  [
    "held out",
    left ? `95 of 100 samples within ${percent(left.p95)}` : "no samples",
    left ? `99 within ${percent(left.p99)}` : "",
  ],
  ...(at
    ? [
        /** @type {Row} */ ([
          "worst sample",
          `${percent(at.worst.error)} off`,
          `light ${at.worst.theta_i_deg}°, viewer ${at.worst.theta_r_deg}°`,
        ]),
        ...optional("energy", at.energies.length && `each incidence within ${percent(largest(at.energies))}`),
      ]
    : []),
  ...optional("glints", glints && "beside the grid: lookups add them, spheres in studio light leave them out"),
  ["noise", noise ? `95 of 100 below ${percent(noise.p95)}` : "not stated"],
  ...optional("measured", extrapolated === null ? "" : `${percent(1 - extrapolated)} of all directions`),
  ...optional("below 0", negative && `${percent(negative)} of the values, which were set to 0`),
  ...changes.map(
    (/** @type {any} */ { law, changed }) => /** @type {Row} */ ([`made ${law}`, `by up to ${percent(changed.max)}`]),
  ),
];

/** The error of the formula against the most exact form for its surface.
 * @param {any} of */
function formula(of) {
  if (!of) return [element("p", {}, "not measured")];
  if (of.against === "none known")
    return [element("p", {}, "no more exact form to compare with")];
  if (of.against === "highest rung") return [element("p", {}, `0: it is the exact form, ${of.rung}`)];
  return [
    pairs([
      ["99 of 100", `within ${percent(of.overall.p99)}`, `against ${of.rung}`],
      ["largest", percent(of.overall.max), of.worst?.why ?? ""],
    ]),
  ];
}

/** An albedo above 1, where the table has one.
 * @param {any} largest
 * @returns {Row[]} */
const above = (largest) =>
  largest && (largest.albedo === null || largest.albedo > 1 + largest.tolerance)
    ? [
        [
          largest.albedo === null ? "albedo" : "albedo above 1",
          `${largest.albedo === null ? "not finite" : short(largest.albedo)} at ${largest.theta_i_deg}°` +
            `${largest.wavelength_nm === null ? "" : `, ${largest.wavelength_nm} nm`}`,
        ],
      ]
    : [];

/** The reason for a value that the paper does not print; older tables have the reasons in their note.
 * @param {any} parameter
 * @param {any} attributes */
function assumed(parameter, attributes) {
  const why = attributes.assumed?.[parameter.name]?.why ?? "the paper does not print it";
  return parameter.assumed && why !== parameter.source ? `assumed: ${why}` : ""; // the source of a colour says it already
}

/** Remove all facts. */
export const forget = () => aside.replaceChildren();

/** Show the error at the current light. Between two wavelengths it is at least the larger one of their errors.
 * @param {any} info
 * @param {{ theta_i: number, nm: number | null }} state */
export function band({ error, wavelength_nm: wavelengths }, { theta_i, nm }) {
  const into = document.getElementById("band");
  if (!into || !error) return;
  const at = Math.max(
    0,
    error.theta_i_deg.findLastIndex((/** @type {number} */ edge) => edge <= theta_i),
  );
  const row = error.p99[Math.min(at, error.p99.length - 1)];
  const wanted = wavelengths && nm !== null ? nearest({ wavelength_nm: wavelengths }, nm) : null;
  if (wanted === null) {
    into.textContent = `within ${percent(Math.max(...row))}`;
    return;
  }
  const below = wavelengths.findLastIndex((/** @type {number} */ each) => each <= wanted),
    above = wavelengths.findIndex((/** @type {number} */ each) => each >= wanted),
    around = row.length === 1 ? row : row.slice(below, above + 1);
  const between = below < above ? error.between?.bands : null; // a mixture has one row
  const there = between ? [between[Math.min(at, between.length - 1)][below]] : [];
  into.textContent = `within ${percent(Math.max(...around, ...there))}`;
}

/** All findings of the audit, with a sentence unless they pass; the report also quotes the papers.
 * @param {any} audit
 * @param {Record<string, string>} questions */
function audited(audit, questions) {
  const findings = audit.sentences.filter((/** @type {any} */ { quote }) => !quote);
  return [
    answers([
      ...(audit.as_published && audit.conserves_energy
        ? Object.entries(questions).map(
            ([key, question]) => /** @type {Row} */ ([question, chip(audit[key].word, audit[key].text)]),
          )
        : [["verdict", chip(audit.verdict, audit.verdict_in_words || audit.verdict)]]),
      ...findings.map((/** @type {any} */ { title, word, text }) => [
        title.toLowerCase(),
        chip(word),
        isGood(word) ? "" : text,
      ]),
    ]),
    ...(audit.current ? [] : [element("p", {}, `This audit is of revision ${audit.revision}, not of the current revision.`)]),
  ];
}

/** @param {any} info */
function links({ links: to, audit }) {
  const wanted = [
    ["material", to.self],
    ["albedo", to.albedo],
    ...(audit ? [["audit", to.audit]] : []),
    ["table (zarr)", to["download.zarr"]],
    ...Object.entries(to).flatMap(([key, href]) => {
      const [kind, format] = key.split("/"); // all formats that the service exports
      return kind === "export" ? [[format.toUpperCase(), href]] : [];
    }),
  ];
  return wanted.map(([text, href]) => element("a", { href: href.replace(/^\//, "") }, text));
}

/** A list of terms.
 * @param {Row[]} rows */
function pairs(rows) {
  return element(
    "dl",
    {},
    ...rows.flatMap(([term, first, ...small]) => [
      element("dt", {}, term),
      element(
        "dd",
        {},
        first,
        ...small.flatMap((text) => (text ? [element("span", { className: "quiet" }, text)] : [])),
      ),
    ]),
  );
}

/** A list of questions, each with its verdict and a reason over the full width.
 * @param {Row[]} rows */
function answers(rows) {
  return element(
    "dl",
    { className: "answered" },
    ...rows.map(([question, verdict, reason]) =>
      element(
        "div",
        {},
        element("dt", {}, question),
        element("dd", {}, verdict),
        ...(reason ? [element("dd", { className: "quiet" }, reason)] : []),
      ),
    ),
  );
}

const shown = (/** @type {any} */ of) =>
  typeof of === "number"
    ? short(of)
    : of.values
      ? `${short(Math.min(...of.values))} to ${short(Math.max(...of.values))}, a spectrum`
      : of;

const value = (/** @type {any} */ { value: of, unit }) =>
  `${shown(of)}${["1", ""].includes(unit) ? "" : ` ${unit === "degree" ? "°" : unit}`}`;

const range = (/** @type {number[] | null} */ at) =>
  at === null ? "grey" : at.length === 1 ? `at ${at[0]} nm` : `${at[0]} to ${at.at(-1)} nm`;
