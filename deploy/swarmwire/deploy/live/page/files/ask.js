// Asks the run for something; what it refuses is said in its own words.
import { showNotice } from "./notice.js";

let before = Promise.resolve();

const HELD_MS = 300;
let held = null; // an order that may still be replaced by the next of its kind

// One after the other, as they were asked for: a step comes after what is to happen in it.
export function ask(order) {
  held?.let();
  before = before.then(() => give(order));
  return before;
}

// Asks once no other order of this kind has come for a moment, or before whatever else is asked: keys move a slider often.
export function askSoon(kind, order) {
  if (held?.kind === kind) held.drop();
  else held?.let();
  return new Promise((answer) => {
    const drop = () => { clearTimeout(timer); held = null; };
    const go = () => { drop(); answer(ask(order)); };
    const timer = setTimeout(go, HELD_MS);
    held = { kind, drop: () => { drop(); answer(null); }, let: go };
  });
}

async function give(order) {
  try {
    const answer = await fetch("do", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(order),
    });
    if (answer.ok) return (await answer.json()).event;
    const { detail } = await answer.json();
    showNotice(detail);
  } catch {
    showNotice("the page's process does not answer: it has ended");
  }
  return null;
}

export const happen = (event) => ask({ do: "event", event });
export const end = (number) => ask({ do: "end", number });
