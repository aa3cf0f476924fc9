// What the page shows first is asked for while its script is still on its way: the list, and a material of it.

const FIRST = "scene-copper-sphere"; // to look at: colour, a lobe and a specular part
export const LIST = "v1/materials?limit=1000";

/** The material to look at first.
 * @param {any[]} all */
export const first = (all) =>
  all.find(({ name, damaged }) => name === FIRST && !damaged) ??
  all.find(({ damaged, spectrum }) => !damaged && spectrum === "spectral") ??
  all.find(({ damaged }) => !damaged);

/** Answers on their way, by path; each is taken once, before the first picture, or never: later it may be outdated.
 * The script of the page has this module, too, and finds them.
 * @type {Map<string, Promise<Response>>} */
export const early = (/** @type {any} */ (globalThis).early ??= begun());

function begun() {
  const found = new Map([[LIST, fetch(LIST).then(withMaterial)]]);

  /** The list, once the material that it leads to is asked for, too.
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
  found.get(LIST)?.catch(() => {}); // who takes it says what is wrong
  return found;
}
