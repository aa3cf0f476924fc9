// Requests: addresses of what is shown, their answers, and arrays of numbers as .npy bytes.

const NPY = "application/x-npy";

export const AGAIN_MS = 3000; // after which is asked again for what may have come back

/** An answer that is an error; its message is the sentence that the service gives; whether it may pass by itself. */
export class Problem extends Error {
  constructor(sentence, passes = false) {
    super(sentence);
    this.passes = passes;
  }
}

/** The address of a material, or of a view of it. */
export function address(name, path = "", query = {}) {
  const pairs = new URLSearchParams(Object.entries(query).filter(([, value]) => value !== undefined)).toString();
  return `v1/materials/${encodeURIComponent(name)}${path && `/${path}`}${pairs && `?${pairs}`}`;
}

/** A document. */
export async function json(path, signal) {
  return (await answer(path, { signal })).json();
}

/** Values at directions [degrees], four numbers each: theta_i, phi_i, theta_r, phi_r; and of which revision they are. */
export async function lookup(name, query, directions, signal) {
  const response = await answer(address(name, "lookup", query), {
    signal, method: "POST", body: toNpy(directions, 4), headers: { "Content-Type": NPY, Accept: NPY },
  });
  return { revision: response.headers.get("Brdfdb-Revision"), values: fromNpy(await response.arrayBuffer()) };
}

async function answer(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem("the server does not answer", true);
  }
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({}));
  throw new Problem(problem.detail ?? `the server answers with status ${response.status}`, response.status === 503);
}

/** A .npy file (version 1.0) of float32 with rows of `columns` numbers. */
export function toNpy(values, columns) {
  const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${values.length / columns}, ${columns}), }`;
  const header = text.padEnd(64 * Math.ceil((text.length + 11) / 64) - 11) + "\n"; // numbers start at a multiple of 64
  const bytes = new Uint8Array(10 + header.length + values.byteLength);
  bytes.set([0x93, ...new TextEncoder().encode("NUMPY"), 1, 0, header.length & 255, header.length >> 8]);
  bytes.set(new TextEncoder().encode(header), 10);
  bytes.set(new Uint8Array(values.buffer, values.byteOffset, values.byteLength), 10 + header.length);
  return bytes;
}

/** The numbers of a .npy file of version 1.0, in its order. */
export function fromNpy(buffer) {
  const start = 10 + new DataView(buffer).getUint16(8, true);
  const kind = /'descr': '<(f[48])'/.exec(new TextDecoder().decode(buffer.slice(10, start)))?.[1];
  if (!kind) throw new Problem("the server answers with numbers of another kind");
  return kind === "f4" ? new Float32Array(buffer.slice(start)) : new Float64Array(buffer.slice(start));
}
