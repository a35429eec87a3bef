// What is measured, each with its curve; what is undefined in this run is not shown.
import { sparkline } from "./sparkline.js";

const HISTORY_LENGTH = 240;
const FIRST = ["link_pdr", "components", "order", "largest_component", "alive", "tick_ms"];
const STATUS_SERIES = [
  { name: "link_pdr", unit: "%", bounds: [0, 1] },
  { name: "alive", unit: "", bounds: [0, null] },
  { name: "tick_ms", unit: "ms", bounds: [0, null] },
];
const NAMES = { link_pdr: "link PDR, last second", tick_ms: "cost of a tick", alive: "robots alive" };
const by = (id) => document.getElementById(id);

export function numbers() {
  const tiles = new Map();
  let lastTick = null;

  function tile(series) {
    const box = document.createElement("dl");
    box.className = "tile";
    box.dataset.name = series.name;
    const label = box.appendChild(document.createElement("dt"));
    label.textContent = label.title = NAMES[series.name] ?? series.name.replaceAll("_", " ");
    const value = box.appendChild(document.createElement("dd"));
    const line = sparkline(HISTORY_LENGTH);
    box.append(line.svg);
    box.hidden = true;
    (FIRST.includes(series.name) ? by("numbers") : by("rest")).append(box);
    tiles.set(series.name, { box, value, line, series });
  }

  function take(values) {
    for (const { line, series } of tiles.values()) line.add(values[series.name]);
  }

  return {
    begin(facts) {
      for (const id of ["numbers", "rest"]) by(id).replaceChildren(), (by(id).className = "tiles");
      tiles.clear();
      const allSeries = new Map([...STATUS_SERIES, ...facts.series].map((series) => [series.name, series]));
      for (const name of [...FIRST, ...allSeries.keys()]) if (allSeries.has(name) && !tiles.has(name)) tile(allSeries.get(name));
      for (const values of facts.history) take(values);
      lastTick = null;
    },
    see(status) {
      const values = { ...status.metrics, link_pdr: status.link_pdr, alive: status.alive, tick_ms: status.measures_ms };
      if (status.tick !== lastTick && lastTick !== null) take(values);
      lastTick = status.tick;
      for (const { box, value, line, series } of tiles.values()) {
        const now = values[series.name] ?? null;
        if (now !== null) box.hidden = false; // once it had a value it stays
        value.textContent = now === null ? "–" : words(now, series);
        if (series.name === "alive") value.textContent += ` / ${status.robots}`;
        value.dataset.value = now;
        line.draw(series.name === "alive" ? [0, status.robots] : series.bounds);
      }
      by("more").hidden = ![...by("rest").children].some((box) => !box.hidden);
    },
  };
}

function words(value, { unit }) {
  if (unit === "%") return `${(100 * value).toFixed(1)} %`;
  if (unit === "bit/s" && value >= 1000) return `${(value / 1000).toFixed(1)} kbit/s`;
  const text = Number.isInteger(value) ? String(value) : value.toFixed(Math.abs(value) < 10 ? 2 : 1);
  return unit ? `${text} ${unit}` : text;
}
