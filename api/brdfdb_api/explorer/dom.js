// Elements: made in one line, and the chips that say a verdict in colour and in words.

const LEVELS = {
  passes: "good", conserves: "good", inside: "good", loses: "calm", "at the edge": "calm", unknown: "calm", "not judged": "calm",
  outside: "note", gains: "note", "known published excess": "note", "accepted excess": "note",
  violates: "bad", damaged: "bad",
};

/** An element with properties and children, which are elements or text. */
export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** A verdict: its words, or others for it, and a colour that repeats them. */
export function chip(verdict, text = verdict) {
  return element("span", { className: `chip ${LEVELS[verdict] ?? "none"}` }, text ?? "not audited");
}

/** The two questions of an audit, by the names of their answers. */
export const QUESTIONS = {
  as_published: "is it what the paper says?", conserves_energy: "does the published model conserve energy?",
};

/** Whether a verdict is a plain pass. */
export const isGood = (verdict) => LEVELS[verdict] === "good";

/** A number with three digits, as people write it. */
export function short(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
    const [digits, power] = value.toExponential(2).split("e");
    return `${Number(digits)} × 10${[...String(Number(power))].map((each) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[each] ?? "⁻").join("")}`;
  }
  return String(Number(value.toPrecision(3)));
}

/** A share as a percentage. */
export const percent = (share) => `${short(100 * share)} %`;
