// Requests to the service, and arrays of numbers from .npy bytes.

import { early } from "./begin.js";

/** @typedef {{ path: string, body?: Record<string, unknown> }} Question a GET request, or a POST request with a body */

const NPY = "application/x-npy";

export const AGAIN_MS = 3000; // time until a failed request is repeated

/** An answer that is an error, with the sentence of the service; `passes`: a later request may succeed. */
export class Problem extends Error {
  /** @param {string} sentence */
  constructor(sentence, passes = false) {
    super(sentence);
    this.passes = passes;
  }
}

/** A path with a query; a list repeats its name.
 * @param {string} path
 * @param {Record<string, unknown>} query */
export function withQuery(path, query) {
  const pairs = Object.entries(query).flatMap(([key, value]) =>
    value === undefined ? [] : [value].flat().map((each) => [key, String(each)]),
  );
  return pairs.length ? `${path}?${new URLSearchParams(pairs)}` : path;
}

/** The address of a material, or of a view of it.
 * @param {string} name
 * @param {string} path
 * @param {Record<string, unknown>} query */
export const address = (name, path = "", query = {}) =>
  withQuery(`v1/materials/${encodeURIComponent(name)}${path && `/${path}`}`, query);

/** A document.
 * @param {string | Question} question
 * @param {AbortSignal} [signal]
 * @returns {Promise<any>} */
export async function json(question, signal) {
  return (await answer(typeof question === "string" ? { path: question } : question, {}, signal)).json();
}

/** Values at the directions of a question, the number of channels, and the digest of the table.
 * @param {Question} question
 * @param {number} count
 * @param {AbortSignal} [signal]
 * @returns {Promise<{ digest: string | null, values: Float32Array | Float64Array, channels: number }>} */
export async function values(question, count, signal) {
  const response = await answer(question, { Accept: NPY }, signal);
  const found = fromNpy(await response.arrayBuffer());
  return { digest: response.headers.get("Brdfdb-Digest"), values: found, channels: found.length / count };
}

/** @param {Question} question
 * @param {Record<string, string>} headers
 * @param {AbortSignal} [signal] */
async function answer({ path, body }, headers, signal) {
  /** @type {RequestInit} */
  const options = { signal, headers };
  if (body) {
    Object.assign(options, {
      method: "POST",
      body: JSON.stringify(body),
      headers: { ...headers, "Content-Type": "application/json" },
    });
  }
  const begun = body ? undefined : early.get(path);
  early.delete(path);
  let response;
  try {
    response = await (begun ?? fetch(path, options));
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new Problem("the service does not answer", true);
  }
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({}));
  throw new Problem(problem.detail ?? `the service answered with status ${response.status}`, response.status === 503);
}

/** The numbers of a .npy file of version 1.0, in its order.
 * @param {ArrayBuffer} buffer */
function fromNpy(buffer) {
  const start = 10 + new DataView(buffer).getUint16(8, true);
  const kind = /'descr': '<(f[48])'/.exec(new TextDecoder().decode(buffer.slice(10, start)))?.[1];
  if (!kind) throw new Problem("the service answered with numbers of an unknown type");
  return kind === "f4" ? new Float32Array(buffer.slice(start)) : new Float64Array(buffer.slice(start));
}
