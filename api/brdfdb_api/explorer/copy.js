// Buttons that copy: a link to the view, and its request as curl and as Python.

const box = document.getElementById("copied");
const text = box.querySelector("textarea");

const WRITTEN = { curl: (href) => `curl '${href}'`, python };

/** Directions of a request as lines of Python, the last of which is the arguments of a lookup [rad]. */
const DIRECTIONS = {
  lookup: ({ theta_i, phi_i = 0, theta_r, phi_r }) => ["", `*np.deg2rad([${theta_i}, ${phi_i}, ${theta_r}, ${phi_r}])`],
  cut: ({ theta_i, phi_i = 0 }) => [
    "theta_r = np.linspace(-90, 90, 181)  # degrees, negative back towards the light\n",
    `*np.deg2rad([${theta_i}, ${phi_i}]), np.deg2rad(abs(theta_r)), np.deg2rad(${phi_i} + 180 * (theta_r > 0))`],
  hemisphere: ({ theta_i, phi_i = 0 }) => [
    "theta_r, phi_r = np.linspace(0, 90, 91)[:, None], np.linspace(0, 360, 181)  # degrees\n",
    `*np.deg2rad([${theta_i}, ${phi_i}]), np.deg2rad(theta_r), np.deg2rad(phi_r)`],
  "half-difference": ({ phi_i = 0 }) => [
    "from brdfdb.geometry import directions_from_half_difference\n\n" +
    "theta_h, theta_d = np.deg2rad(np.arange(0.5, 90))[:, None], np.deg2rad(np.arange(0.5, 90))\n",
    `*directions_from_half_difference(theta_h, np.deg2rad(${phi_i}), theta_d, np.deg2rad(90))`],
};

/** A request as Python: of the client, which has f_r; albedos and findings are documents. */
function python(href) {
  const { origin, pathname, searchParams } = new URL(href);
  const [, base, name, kind] = /^(.*\/)v1\/materials\/([^/]+)\/(lookup|lobe)$/.exec(origin + pathname) ?? [];
  if (!kind) return `import json\nfrom urllib.request import urlopen\n\nanswer = json.load(urlopen("${href}"))`;
  const query = Object.fromEntries(searchParams);
  const [before, directions] = DIRECTIONS[query.view ?? kind](query);
  const wavelength = query.wavelength_nm ? `, wavelength_nm=${query.wavelength_nm}` : "";
  const method = query.error ? "lookup_with_error" : "lookup";
  return `import numpy as np\nimport brdfdb\n${before}table = brdfdb.open("${base}")["${decodeURIComponent(name)}"]\n` +
    `answer = table.${method}(${directions}${wavelength})  # 1/sr${query.output ? ", at all wavelengths" : ""}`;
}

/** Make the buttons work; `link` gives that of the view, `request` what it asks for, `say` tells people. */
export function listen(link, request, say) {
  document.getElementById("copies").addEventListener("click", async ({ target }) => {
    const kind = target.dataset.copy;
    if (!kind) return;
    text.value = kind === "link" ? link().href : WRITTEN[kind](new URL(request(), document.baseURI).href);
    box.hidden = false;
    try {
      await navigator.clipboard.writeText(text.value); // there is no clipboard off https and localhost
      say("Copied.", "calm");
    } catch {
      text.focus();
      text.select();
      say("Selected below: copy it with Ctrl+C.", "calm");
    }
  });
}
