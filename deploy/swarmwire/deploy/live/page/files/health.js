// How the runners are doing, how old poses from outside are, and every count that is not 0.
const FINE = ["ready", "robots free"];
const MAX_NAMES = 5;
const by = (id) => document.getElementById(id);

const unbroken = (name) => name.replaceAll("-", "\u2011");

function poses({ source, oldest, oldest_s, silent }) {
  const line = document.createElement("div");
  line.append(`poses of ${source}: `);
  if (silent.length) {
    const more = silent.length > MAX_NAMES ? ", …" : "";
    line.appendChild(document.createElement("b")).textContent = `${silent.length} silent`;
    line.append(` (${silent.slice(0, MAX_NAMES).map(unbroken).join(", ")}${more}), `);
  }
  line.append(`the oldest ${oldest_s.toFixed(2)} s (${unbroken(oldest)})`);
  return line;
}

export function health() {
  return {
    see(status) {
      const runners = status.runners;
      by("runners").replaceChildren();
      if (runners === null || runners === undefined) {
        by("runners").textContent = "no runners: all agents are in the world's process";
      } else {
        const states = Object.entries(runners)
          .filter(([name, count]) => count || name === "ready" || name === "lost")
          .map(([name, count]) => ({ name: name.replaceAll("_", " "), count }));
        states.forEach(({ name, count }, at) => {
          const item = document.createElement("span");
          const number = item.appendChild(document.createElement("b"));
          number.textContent = count;
          number.className = count && !FINE.includes(name) ? "bad" : "";
          item.append(` ${name}${at < states.length - 1 ? " · " : ""}`);
          by("runners").append(item);
        });
      }
      by("poses").replaceChildren(...(status.poses ?? []).map(poses));
      const counts = Object.entries(status.counts ?? {}).filter(([, count]) => count);
      by("faults").replaceChildren(...counts.map(([name, count]) => {
        const item = document.createElement("li");
        item.append(`${name.replaceAll("_", " ")} `);
        item.appendChild(document.createElement("b")).textContent = count;
        return item;
      }));
    },
  };
}
