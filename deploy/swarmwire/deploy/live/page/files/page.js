// The page: news of the run come in, orders go out; each part of the page is a module of its own.
import { breaking } from "./breaking.js";
import { happenings } from "./happenings.js";
import { health } from "./health.js";
import { numbers } from "./numbers.js";
import { radio } from "./radio.js";
import { showNotice } from "./notice.js";
import { transport } from "./transport.js";
import { viewer } from "./viewer.js";

const parts = [transport(), numbers(), radio(), breaking(), health(), happenings(), viewer()];
const by = (id) => document.getElementById(id);
const news = new EventSource("news");
let over = false;

news.addEventListener("facts", (event) => {
  const facts = JSON.parse(event.data);
  by("name").textContent = facts.name;
  document.title = `${facts.name}: swarmwire`;
  by("about").textContent = `seed ${facts.seed}, ${facts.robots.length} robots, ${facts.rate_hz} Hz`;
  for (const part of parts) part.begin?.(facts);
});

news.addEventListener("status", (event) => {
  const status = JSON.parse(event.data);
  show(status.state);
  for (const part of parts) part.see?.(status);
  if (status.state === "over" && !over) {
    over = true; // the connection stays: it tells that somebody still looks
    showNotice("the run is over; its page stays until you close it", true);
  }
});

news.addEventListener("error", () => {
  if (over) news.close(); // a browser would ask for it again and again
  else show("lost");
});

function show(state) {
  by("state").textContent = state === "lost" ? "no connection" : state;
  by("state").className = `state ${state}`;
}
