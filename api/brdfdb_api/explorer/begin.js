// Early requests: the list and the first material are requested while the main script is still loading.

const FIRST = "scene-copper-sphere"; // it has a colour, a lobe and a specular part
export const LIST = "v1/materials?limit=1000";

/** The material that the page shows first.
 * @param {any[]} all */
export const first = (all) =>
  all.find(({ name, damaged }) => name === FIRST && !damaged) ??
  all.find(({ damaged, spectrum }) => !damaged && spectrum === "spectral") ??
  all.find(({ damaged }) => !damaged);

/** Promised answers, by path. Each is used once, before the first picture, because later it may be outdated.
 * The main script contains this module, too, and finds them here.
 * @type {Map<string, Promise<Response>>} */
export const early = (/** @type {any} */ (globalThis).early ??= begun());

function begun() {
  const found = new Map([[LIST, fetch(LIST).then(withMaterial)]]);

  /** Request the material that the page shows, and return the list.
   * @param {Response} response */
  async function withMaterial(response) {
    const { materials = [] } = await response
      .clone()
      .json()
      .catch(() => ({}));
    const [, linked] = /[#&]material=([^&(:*]+)/.exec(location.hash) ?? [];
    const name = linked ? materials.find((/** @type {any} */ each) => each.name === linked)?.name : first(materials)?.name;
    const path = `v1/materials/${encodeURIComponent(name)}`;
    if (name) found.set(path, fetch(path));
    return response;
  }
  found.get(LIST)?.catch(() => {}); // its user reports the error
  return found;
}
