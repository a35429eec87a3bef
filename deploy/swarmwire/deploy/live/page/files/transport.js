// Play, pause, step, speed and stop; by keys too: space, s, S, + and -.
import { ask } from "./ask.js";

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, null]; // null: as fast as possible
const PLAY = "M3 1v14l11-7z";
const PAUSE = "M3 1h4v14H3zM9 1h4v14H9z";
const END = "M2 2h12v12H2z";
const by = (id) => document.getElementById(id);
const words = (factor) => (factor === null ? "unbounded" : `× ${factor}`);

export function transport() {
  let status = null;
  let held = false; // the slider is in somebody's hand
  let fastest = SPEEDS.length - 1;
  const speed = by("speed");
  speed.max = fastest;
  const toggle = () => ask({ do: status?.state === "paused" ? "resume" : "pause" });
  const step = (n) => ask({ do: "step", n });
  const faster = (by) => {
    speed.value = Math.min(Math.max(Number(speed.value) + by, 0), fastest);
    sendSpeed();
  };
  const sendSpeed = () => {
    held = false;
    ask({ do: "speed", factor: SPEEDS[speed.value] });
  };
  by("play").onclick = toggle;
  by("step").onclick = () => step(1);
  by("step10").onclick = () => step(10);
  speed.oninput = () => { held = true; by("speed-now").textContent = words(SPEEDS[speed.value]); };
  speed.onchange = sendSpeed;
  by("stop").onclick = (event) => certainly(event.target, () => ask({ do: "stop" }));

  document.addEventListener("click", (event) => { // a button that was clicked does not keep the space bar
    if (event.detail > 0) event.target.closest?.("button")?.blur();
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || status?.state === "over") return;
    const typing = event.target.closest?.("input[type=number], select");
    const act = { " ": toggle, s: () => step(1), S: () => step(10), "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1) }[event.key];
    if (!act || typing || (event.key === " " && event.target.closest?.("button, summary"))) return;
    event.preventDefault();
    act();
  });

  return {
    see(now) {
      status = now;
      const paused = now.state === "paused", over = now.state === "over";
      by("play-word").textContent = over ? "Ended" : paused ? "Play" : "Pause";
      by("play-shape").setAttribute("d", over ? END : paused ? PLAY : PAUSE);
      for (const id of ["play", "step", "step10", "stop", "speed"]) by(id).disabled = over;
      fastest = SPEEDS.length - (now.real_time ? 2 : 1);
      speed.max = fastest;
      if (!held) {
        const nearest = now.speed === null ? SPEEDS.length - 1 : nearestTo(now.speed);
        speed.value = nearest;
        by("speed-now").textContent = words(now.speed);
      }
      by("progress").max = now.ticks;
      by("progress").value = now.tick;
      by("ticks").textContent = `tick ${now.tick} / ${now.ticks}`;
      by("ticks").dataset.tick = now.tick;
      by("time").textContent = `${now.time_s.toFixed(1)} s simulated`;
      const pace = now.speed_now;
      by("pace").textContent = now.state !== "running" || pace === null ? "" : `${pace < 10 ? pace.toFixed(1) : pace.toFixed(0)} × real time`;
    },
  };
}

function nearestTo(factor) {
  const off = (speed) => Math.abs(Math.log(speed / factor));
  return SPEEDS.slice(0, -1).reduce((best, speed, at) => (off(speed) < off(SPEEDS[best]) ? at : best), 0);
}

// What cannot be taken back is asked for twice.
function certainly(button, act) {
  if (button.dataset.sure) {
    act();
    return;
  }
  const word = button.textContent;
  button.dataset.sure = "yes";
  button.textContent = "Really stop?";
  setTimeout(() => { delete button.dataset.sure; button.textContent = word; }, 3000);
}
