// The view of cut, lobe and sphere side by side, under one light.

/** @type {import("./main.js").View} */
export default {
  name: "together",
  title: "Together",
  order: 0,
  parts: ["cut", "hemisphere", "sphere"],
  shapes: true,
  lit: true,
  turned: true,
};
