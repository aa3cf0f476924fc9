// The answers of the service for a view; the last answers and refusals of each view are stored.

import { Problem, json } from "./api.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {import("./main.js").View} View */

/** @type {Map<string, { key: string, coarse: boolean, answers: any[] }>} */
const before = new Map(); // last answers by name of the view
/** @type {Map<string, { key: string, problem: Problem }>} */
const refused = new Map(); // last refusals by name of the view

/** Answers for a view, for those series that the service can answer for.
 * @param {View} view
 * @param {State} now
 * @param {Series[]} series
 * @param {AbortSignal} signal
 * @returns {Promise<{ known: Series[], answers: any[] }>} */
export async function answersTo(view, now, series, signal) {
  const known = series.filter((each) => view.known?.(each, now, series) ?? true);
  const answer = view.answer ?? ((each) => json(view.request?.(each, now, series) ?? "", signal));
  const key = keyOf(known, series, now);
  const no = refused.get(view.name);
  if (no?.key === key) throw no.problem;
  const last = before.get(view.name);
  if (last?.key === key && (now.quick || !last.coarse)) return { known, answers: last.answers };
  const answers = await Promise.all(known.map((each) => answer(each, now, series, signal))).catch((problem) => {
    if (problem instanceof Problem && !problem.passes) refused.set(view.name, { key, problem });
    throw problem;
  });
  signal.throwIfAborted();
  before.set(view.name, { key, coarse: Boolean(now.quick), answers });
  return { known, answers };
}

/** Everything that answers depend on, as text.
 * @param {Series[]} known
 * @param {Series[]} series
 * @param {State} now */
function keyOf(known, series, now) {
  // 0: has no effect on answers
  const asked = { ...now, quick: 0, exposure: 0, scale: 0, axes: 0, view: 0, compare: 0 };
  const of = known.map(({ text, source, info }) => [text, source, info.digest]);
  return JSON.stringify([of, series.some(({ info }) => info.anisotropic), asked]);
}

/** Whether an answer is about another table than the loaded one; an audit may be of an older revision.
 * @param {any} answer
 * @param {Series} each */
export const outdates = ({ digest, revision, current, finding }, { info, source }) =>
  source !== "parameters" &&
  (finding ? revision !== info.audit.revision || current !== info.audit.current : digest !== info.digest);
