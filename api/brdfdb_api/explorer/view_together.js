// The view of cut, lobe and sphere side by side, under one light.

/** @type {import("./main.js").View} */
export default { name: "together", title: "Together", order: 0, parts: ["sphere", "hemisphere", "cut"], shapes: true, lit: true, turned: true };
