// A curve of a number's last values, as an SVG without axes.
const NS = "http://www.w3.org/2000/svg";
const WIDTH = 100, HEIGHT = 18;

export function sparkline(most) {
  const svg = document.createElementNS(NS, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  const under = svg.appendChild(document.createElementNS(NS, "path"));
  under.setAttribute("class", "under");
  const curve = svg.appendChild(document.createElementNS(NS, "path"));
  const values = [];
  return {
    svg,
    add(value) {
      values.push(value ?? null);
      if (values.length > most) values.shift();
    },
    draw(bounds) {
      const defined = values.filter((value) => value !== null);
      const least = bounds[0] ?? Math.min(...defined);
      const largest = Math.max(bounds[1] ?? -Infinity, ...defined);
      const span = largest - least || 1;
      const x = (at) => (values.length < 2 ? 0 : (at / (values.length - 1)) * WIDTH);
      const y = (value) => HEIGHT - 1 - ((value - least) / span) * (HEIGHT - 2);
      let line = "", filled = "", before = null;
      values.forEach((value, at) => {
        if (value === null) { before = null; return; }
        const point = `${x(at).toFixed(1)} ${y(value).toFixed(1)}`;
        line += `${before === null ? "M" : "L"}${point}`;
        if (before !== null) filled += `M${before}L${point}V${HEIGHT}H${before.split(" ")[0]}z`;
        before = point;
      });
      curve.setAttribute("d", line);
      under.setAttribute("d", filled);
    },
  };
}
