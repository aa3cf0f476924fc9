// Buttons that copy the link of the view, and its request as curl and as Python.

import { byId } from "./dom.js";

/** @typedef {import("./api.js").Question} Question */

const box = byId("copied", HTMLElement),
  text = /** @type {HTMLTextAreaElement} */ (box.querySelector("textarea"));

/** @type {Record<string, (href: string, question: Question) => string>} */
const WRITTEN = { curl, python };

/** A question as a command of a shell.
 * @param {string} href
 * @param {Question} question */
function curl(href, { body }) {
  return body
    ? `curl -H 'Content-Type: application/json' -d '${JSON.stringify(body).replaceAll("'", "'\\''")}' '${href}'`
    : `curl '${href}'`;
}

/** Directions of a question in Python: lines before, and the arguments of a lookup [rad].
 * @type {Record<string, (query: Record<string, string>) => [string, string]>} */
const DIRECTIONS = {
  lookup: ({ theta_i, phi_i = 0, theta_r, phi_r }) => ["", `*np.deg2rad([${theta_i}, ${phi_i}, ${theta_r}, ${phi_r}])`],
  cut: ({ theta_i, phi_i = 0 }) => [
    "theta_r = np.linspace(-90, 90, 181)  # degrees, negative back towards the light\n",
    `*np.deg2rad([${theta_i}, ${phi_i}]), np.deg2rad(abs(theta_r)), np.deg2rad(${phi_i} + 180 * (theta_r > 0))`,
  ],
  hemisphere: ({ theta_i, phi_i = 0 }) => [
    "theta_r, phi_r = np.linspace(0, 90, 91)[:, None], np.linspace(0, 360, 181)  # degrees\n",
    `*np.deg2rad([${theta_i}, ${phi_i}]), np.deg2rad(theta_r), np.deg2rad(phi_r)`,
  ],
  "half-difference": ({ phi_i = 0 }) => [
    "from brdfdb.geometry import directions_from_half_difference\n\n" +
      "theta_h, theta_d = np.deg2rad(np.arange(0.5, 90))[:, None], np.deg2rad(np.arange(0.5, 90))\n",
    `*directions_from_half_difference(theta_h, np.deg2rad(${phi_i}), theta_d, np.deg2rad(90))`,
  ],
};

/** A question as Python: with `brdfdb.open` for f_r, else as a document.
 * @param {string} href
 * @param {Question} question */
function python(href, { body }) {
  const { origin, pathname, searchParams } = new URL(href);
  const [, base, name, kind] = /^(.*\/)v1\/materials\/([^/]+)\/(lookup|lobe)$/.exec(origin + pathname) ?? [];
  const json = "import json\nfrom urllib.request import Request, urlopen\n\n";
  if (body) {
    return (
      `${json}body = json.loads(r"""${JSON.stringify(body)}""")\nrequest = Request("${href}", json.dumps(body).encode(), ` +
      '{"Content-Type": "application/json"})\nanswer = json.load(urlopen(request))'
    );
  }
  if (!kind) return `${json}answer = json.load(urlopen("${href}"))`;
  const query = Object.fromEntries(searchParams),
    [before, directions] = DIRECTIONS[query.view ?? kind](query);
  const at = searchParams.getAll("wavelength_nm"),
    method = query.error ? "lookup_with_error" : "lookup";
  const wavelength =
    at.length && !query.output ? `, wavelength_nm=${at.length > 1 ? `[${at.join(", ")}]` : at[0]}` : "";
  return (
    `import numpy as np\nimport brdfdb\n${before}table = brdfdb.open("${base}")["${decodeURIComponent(name)}"]\n` +
    `answer = table.${method}(${directions}${wavelength})  # 1/sr${query.output ? ", at all wavelengths" : ""}`
  );
}

/** Make the buttons work; `link` and `request` are those of the view, `say` shows a message.
 * @param {() => URL} link
 * @param {() => Question} request
 * @param {(sentence: string, tone: string) => void} say */
export function listen(link, request, say) {
  byId("copies", HTMLElement).addEventListener("click", ({ target }) => {
    const kind = target instanceof HTMLElement && target.dataset.copy;
    if (!kind) return;
    const of = request();
    copyText(kind === "link" ? link().href : WRITTEN[kind](new URL(of.path, document.baseURI).href, of), say);
  });
}

/** Copy a text, and show it.
 * @param {string} of
 * @param {(sentence: string, tone: string) => void} say */
export async function copyText(of, say) {
  text.value = of;
  box.hidden = false;
  try {
    await navigator.clipboard.writeText(of); // it needs https or localhost
    say("Copied.", "calm");
  } catch {
    text.focus();
    text.select();
    say("Selected below: copy it with Ctrl+C.", "calm");
  }
}
