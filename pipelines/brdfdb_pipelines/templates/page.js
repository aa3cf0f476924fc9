"use strict";
const table = document.getElementById("findings");
const body = table.tBodies[0];

// Sorting: numbers where cells carry them, words otherwise; the same heading again turns the order round
for (const button of table.querySelectorAll("thead button")) {
  button.addEventListener("click", () => {
    const heading = button.parentElement;
    const down = heading.ariaSort === "ascending";
    for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = row => row.cells[heading.cellIndex].dataset.sort ?? row.cells[heading.cellIndex].textContent;
    const compare = (a, b) => (isNaN(key(a)) || isNaN(key(b)) ? key(a).localeCompare(key(b)) : key(a) - key(b));
    body.append(...[...body.rows].sort((a, b) => (down ? -1 : 1) * compare(a, b)));
  });
}

// The filter holds for the table and for the sections below
const rows = [...body.rows].map(row => [row, document.getElementById(row.querySelector("a").hash.slice(1))]);
document.getElementById("filter").addEventListener("input", event => {
  const words = event.target.value.toLowerCase().split(/\s+/);
  let shown = 0;
  for (const [row, section] of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = section.hidden = !words.every(word => text.includes(word));
    shown += !row.hidden;
  }
  document.getElementById("shown").textContent = `${shown} shown`;
});

// A link to a material opens its section
const open = () => {
  const section = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (section instanceof HTMLDetailsElement) {
    section.hidden = false;
    section.open = true;
    section.scrollIntoView();
  }
};
addEventListener("hashchange", open);
open();
document.addEventListener("click", event => {
  if (event.target.closest?.("a")?.hash === location.hash && location.hash) setTimeout(open);
});

// A plot as a file of its own, in the colours that it has now
for (const figure of document.querySelectorAll("figure")) {
  const button = Object.assign(document.createElement("button"), { className: "save", type: "button", textContent: "Save SVG" });
  button.addEventListener("click", () => {
    const style = getComputedStyle(figure);
    const drawn = new XMLSerializer().serializeToString(figure.querySelector("svg"));
    const plain = drawn.replace(/var\((--[\w-]+)\)/g, (_, name) => style.getPropertyValue(name));
    const text = plain.replace("<svg", '<svg font-family="sans-serif"');
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    link.download = `${figure.dataset.name}.svg`;
    link.click();
  });
  figure.append(button);
}
