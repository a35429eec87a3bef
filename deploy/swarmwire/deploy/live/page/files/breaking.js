// Kill and revive, jam, cut in halves and heal.
import { end, happen } from "./ask.js";
import { map } from "./map.js";
import { showNotice } from "./notice.js";

const LOUDER_DB = 15; // a jammer than a robot, unless somebody says otherwise
const by = (id) => document.getElementById(id);

export function breaking() {
  let status = null, at = null;
  const small = map(by("map"), () => status && show());
  const names = () => ({ names: [by("robot").value] });
  const lasting = (action) => (status?.events ?? []).filter((event) => event.do === action && !event.over && (event.given || event.tick !== null));
  const endAll = (action) => lasting(action).forEach((event) => end(event.number));

  by("kill").onclick = () => happen({ do: "kill", robots: names() });
  by("revive").onclick = () => happen({ do: "revive", robots: names() });
  by("kill-share").onclick = () => happen({ do: "kill", robots: { share: Number(by("share").value) / 100 } });
  by("revive-all").onclick = () => happen({ do: "revive", robots: { share: 1 } });
  by("halve-x").onclick = () => happen({ do: "partition", halves: "x" });
  by("halve-y").onclick = () => happen({ do: "partition", halves: "y" });
  by("heal").onclick = () => endAll("partition");
  by("unjam").onclick = () => endAll("jammer");
  by("jam").onclick = () =>
    at ? happen({ do: "jammer", at, power_dbm: Number(by("power").value) }) : showNotice("nothing was seen of the swarm yet");
  by("place").onclick = () => { small.forget(); show(); };

  function show() {
    at = small.see(status.places, status.centre);
    const where = small.position ? "at" : "centre";
    by("place").textContent = at ? `${where} ${at.map((value) => value.toFixed(1)).join(", ")} m` : "";
    by("place").title = small.position ? "a click takes the swarm's centre again" : "a click on the map takes another place";
  }

  return {
    begin(facts) {
      small.begin(facts);
      by("robot").replaceChildren(...facts.robots.map((name) => new Option(name, name)));
    },
    see(now) {
      if (status === null && now.radio) by("power").value = Math.round((now.radio["antenna.power_dbm"] ?? 0) + LOUDER_DB);
      status = now;
      show();
      const over = now.state === "over", air = now.radio !== null;
      const signals = air && "antenna.power_dbm" in now.radio;
      for (const id of ["kill", "revive", "kill-share", "revive-all", "robot", "share"]) by(id).disabled = over;
      for (const id of ["halve-x", "halve-y"]) by(id).disabled = over || !air;
      by("heal").disabled = over || !lasting("partition").length;
      by("unjam").disabled = over || !lasting("jammer").length;
      for (const id of ["jam", "power"]) by(id).disabled = over || !signals;
      by("jam-why").textContent = signals ? "" : air ? "no jammer: a disk radio knows no signal strength" : "no radio to jam or cut";
    },
  };
}
