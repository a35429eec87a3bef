// Who did what at which tick, newest first; what lasts can be ended.
import { end } from "./ask.js";

const LASTING = ["kill", "partition", "jammer", "blackout", "gain", "fail", "ramp"];

export function happenings() {
  let shown = "";
  return {
    see(status) {
      const text = JSON.stringify([status.events, status.state === "over"]);
      if (text === shown) return; // a list that is drawn anew takes the button from under the pointer
      shown = text;
      const place = document.getElementById("events");
      const items = [...(status.events ?? [])].reverse().map((event) => item(event, status.state === "over"));
      if (!items.length) items.push(Object.assign(document.createElement("li"), { className: "none", textContent: "nothing has happened yet" }));
      place.replaceChildren(...items);
    },
  };
}

function item(event, ended) {
  const line = document.createElement("li");
  line.className = event.over ? "over" : "";
  line.append(Object.assign(document.createElement("span"), { className: "quiet", textContent: `tick ${event.tick ?? "–"}` }));
  line.append(Object.assign(document.createElement("span"), { textContent: event.text }));
  if (LASTING.includes(event.do) && !event.over && !ended) {
    const button = line.appendChild(Object.assign(document.createElement("button"), { textContent: "end", title: "undo it" }));
    button.onclick = () => end(event.number);
  }
  return line;
}
