// Sliders for the radio's numbers: what is let go of holds from the next tick on.
import { askSoon } from "./ask.js";

const KEYS = [
  { key: "loss", name: "loss", unit: "", least: 0, most: () => 1, step: 0.01, show: (value) => `${Math.round(100 * value)} %` },
  { key: "latency_s", name: "latency", unit: "s", least: 0, most: (now) => Math.max(2, now), step: 0.01, show: (value) => `${value.toFixed(2)} s` },
  { key: "range_m", name: "range", unit: "m", least: 0.1, most: (now, facts) => Math.max(now, Math.ceil(Math.hypot(...facts.arena_m))), step: 0.1, show: (value) => `${value.toFixed(1)} m` },
  { key: "antenna.power_dbm", name: "power", unit: "dBm", least: -60, most: (now) => Math.max(30, now), step: 1, show: (value) => `${value.toFixed(0)} dBm`, signals: true },
];
const WHY = { range_m: "follows from how strong signals are" };

export function radio() {
  const container = document.getElementById("radio");
  const rows = new Map();
  let facts = null;

  for (const slider of KEYS) {
    const row = container.appendChild(document.createElement("label"));
    row.className = "slide";
    row.append(Object.assign(document.createElement("span"), { textContent: slider.name }));
    const input = row.appendChild(Object.assign(document.createElement("input"), { type: "range", id: `radio-${slider.name}`, step: slider.step }));
    const output = row.appendChild(document.createElement("output"));
    const state = { row, input, output, held: false, awaited: null };
    input.oninput = () => { state.held = true; output.textContent = slider.show(Number(input.value)); };
    input.onchange = async () => {
      const to = Number(input.value);
      const number = await askSoon(slider.key, { do: "event", event: { do: "ramp", what: `radio.${slider.key}`, to } });
      if (to !== Number(input.value)) return; // it was moved on
      state.awaited = number === null ? null : to;
      state.held = false;
    };
    rows.set(slider, state);
  }

  return {
    begin(newFacts) { facts = newFacts; },
    see(status) {
      const numbers = status.radio;
      document.getElementById("radio-why").textContent = numbers ? "" : "(this scenario has no radio)";
      for (const [slider, state] of rows) {
        const now = numbers?.[slider.key];
        const available = typeof now === "number" && status.state !== "over";
        state.row.hidden = Boolean(slider.signals) && typeof now !== "number";
        state.input.disabled = !available;
        state.row.classList.toggle("off", !available);
        state.row.title = available ? `radio.${slider.key}` : numbers ? WHY[slider.key] ?? "this radio has no such number" : "this scenario has no radio";
        if (typeof now !== "number") {
          state.output.textContent = numbers ? "by signal" : "–";
          continue;
        }
        if (state.awaited !== null && Math.abs(state.awaited - now) > slider.step / 2 && status.state === "paused") continue; // the next tick brings it
        state.awaited = null;
        if (state.held) continue;
        Object.assign(state.input, { min: Math.min(slider.least, now), max: slider.most(now, facts) });
        state.input.value = now;
        state.output.textContent = slider.show(now);
      }
    },
  };
}
