// Who did what at which tick, newest first; what lasts can be ended.
import { end } from "./ask.js";

const LASTING = ["kill", "partition", "jammer", "blackout", "gain", "fail", "ramp"];

const SET = /^ramp what = "(.*?)",? to = ([^\s,]+)(.*)$/;

export function happenings() {
  let shown = "";
  return {
    see(status) {
      const content = [status.events, status.who, status.state === "over"];
      const text = JSON.stringify(content);
      if (text === shown) return; // a list that is drawn anew takes the button from under the pointer
      shown = text;
      const list = document.getElementById("events");
      const items = ordered(status.events ?? []).map((event) => item(event, status.who?.[event.number], status.state === "over"));
      if (!items.length) items.push(Object.assign(document.createElement("li"), { className: "none", textContent: "nothing has happened yet" }));
      list.replaceChildren(...items);
    },
  };
}

// What waits for the next tick, what happened, newest first, and at last what the scenario has in store.
function ordered(events) {
  const rank = (event) => (event.tick ?? (event.given ? Infinity : -1));
  const real = events.filter((event) => !(event.given && event.over && event.tick === null)); // not taken back in time
  return real.sort((first, second) => rank(second) - rank(first) || (rank(first) < 0 ? first.number - second.number : second.number - first.number));
}

function item(event, who, ended) {
  const line = document.createElement("li");
  const begun = event.tick !== null;
  const when = begun ? `tick ${event.tick}` : !event.given ? "to come" : "next tick";
  line.className = event.over || !begun ? "over" : "";
  line.title = event.text;
  line.append(Object.assign(document.createElement("span"), { className: "quiet", textContent: when }));
  const description = line.appendChild(document.createElement("span"));
  description.textContent = words(event, begun ? who : undefined);
  if (event.given) description.append(" ", Object.assign(document.createElement("span"), { className: "hand", textContent: "by hand" }));
  if (event.over && begun) description.append(" ", Object.assign(document.createElement("span"), { className: "quiet", textContent: "over" }));
  if (LASTING.includes(event.do) && begun && !event.over && !ended) {
    const button = line.appendChild(Object.assign(document.createElement("button"), { textContent: "end", title: "undo it" }));
    button.onclick = () => end(event.number);
  }
  return line;
}

function words(event, who) {
  const set = SET.exec(event.text);
  if (set) return `${set[1]} = ${set[2]}${set[3]}`;
  if (who === undefined || who === "all") return event.text;
  return `${event.do}: ${who}`;
}
