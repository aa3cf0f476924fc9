// What the service answers for a view; the last answers and refusals of each view are not asked for again.

import { Problem, json } from "./api.js";

/** @typedef {import("./link.js").State} State */
/** @typedef {import("./series.js").Series} Series */
/** @typedef {import("./main.js").View} View */

/** @type {Map<string, { key: string, coarse: boolean, answers: any[] }>} */
const before = new Map(); // the last answers, by the names of views
/** @type {Map<string, { key: string, problem: Problem }>} */
const refused = new Map(); // the last refusals

/** Answers for a view, of the series that the service knows there.
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

/** What answers depend on, as text.
 * @param {Series[]} known
 * @param {Series[]} series
 * @param {State} now */
function keyOf(known, series, now) {
  // what does not change answers is 0
  const asked = { ...now, quick: 0, exposure: 0, scale: 0, axes: 0, view: 0, compare: 0 };
  const of = known.map(({ text, source, info }) => [text, source, info.digest]);
  return JSON.stringify([of, series.some(({ info }) => info.anisotropic), asked]);
}

/** Whether an answer is of another table than what is known; what an audit found may be of an old revision.
 * @param {any} answer
 * @param {Series} each */
export const outdates = ({ digest, revision, current, finding }, { info, source }) =>
  source !== "parameters" &&
  (finding ? revision !== info.audit.revision || current !== info.audit.current : digest !== info.digest);
