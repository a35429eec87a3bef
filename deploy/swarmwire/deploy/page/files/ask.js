// Asks the run for something; what it refuses is said in its own words.
import { say } from "./said.js";

let before = Promise.resolve();

// One after the other, as they were asked for: a step comes after what is to happen in it.
export function ask(order) {
  before = before.then(() => give(order));
  return before;
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
    say(typeof detail === "string" ? detail : detail.map((fault) => `${fault.loc.join(".")}: ${fault.msg}`).join("; "));
  } catch {
    say("the page's process does not answer: it has ended");
  }
  return null;
}

export const happen = (event) => ask({ do: "event", event });
export const end = (number) => ask({ do: "end", number });
