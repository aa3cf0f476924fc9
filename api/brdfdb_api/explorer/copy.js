// Buttons that copy: a link to the view, and its request as curl and as Python.

const box = document.getElementById("copied");
const text = box.querySelector("textarea");

const WRITTEN = {
  link: () => location.href,
  curl: (href) => `curl '${href}'`,
  python: (href) => `import json\nfrom urllib.request import urlopen\n\nanswer = json.load(urlopen("${href}"))\nanswer["${
    href.includes("/albedo") ? "albedo" : "brdf"}"]`,
};

/** Make the buttons work; `request` gives the address of what is shown, `say` tells people. */
export function listen(request, say) {
  document.getElementById("copies").addEventListener("click", async ({ target }) => {
    const kind = target.dataset.copy;
    if (!kind) return;
    text.value = WRITTEN[kind](new URL(request(), document.baseURI).href);
    box.hidden = false;
    try {
      await navigator.clipboard.writeText(text.value); // there is no clipboard off https and localhost
      say("Copied.");
    } catch {
      text.focus();
      text.select();
      say("Selected below: copy it with Ctrl+C.");
    }
  });
}
