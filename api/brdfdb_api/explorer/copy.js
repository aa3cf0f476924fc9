// Buttons that copy: a link to the view, and its request as curl and as Python.

const box = document.getElementById("copied");
const text = box.querySelector("textarea");

const WRITTEN = {
  curl: (href) => `curl '${href}'`,
  python: (href) => `import json\nfrom urllib.request import urlopen\n\nanswer = json.load(urlopen("${href}"))\nanswer["${
    /\/(albedo|audit)$/.exec(href)?.[1].replace("audit", "finding") ?? "brdf"}"]`,
};

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
