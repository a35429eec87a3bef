// The arena from above, small: where the robots are, and the place that was clicked.
const NS = "http://www.w3.org/2000/svg";
const DISC = (r) => `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`;
const CROSS = (r) => `M${-r} ${-r}L${r} ${r}M${-r} ${r}L${r} ${-r}`; // the dead, not by colour alone

export function map(svg, chosen) {
  const add = (name, attributes, to = svg) => {
    const element = to.appendChild(document.createElementNS(NS, name));
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };
  let robots, mark, radius;
  let position = null; // null: the swarm's centre

  svg.addEventListener("click", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    position = [Number(at.x.toFixed(2)), Number((-at.y).toFixed(2))];
    chosen(position);
  });

  return {
    begin(facts) {
      const [width, height] = facts.arena_m, side = Math.max(width, height) * 1.04;
      radius = side / 55;
      svg.replaceChildren();
      svg.setAttribute("viewBox", `${-side / 2} ${-side / 2} ${side} ${side}`);
      add("rect", { class: "wall", x: -width / 2, y: -height / 2, width, height });
      for (const obstacle of facts.obstacles) {
        if (obstacle.corners.length) add("polygon", { class: "block", points: obstacle.corners.map(([x, y]) => `${x},${-y}`).join(" ") });
        else add("circle", { class: "block", cx: obstacle.x, cy: -obstacle.y, r: obstacle.radius });
      }
      robots = add("g", {});
      mark = add("path", { class: "place" });
    },
    see(poses, centre) {
      while (robots.children.length > poses.length) robots.lastChild.remove();
      while (robots.children.length < poses.length) add("path", {}, robots);
      poses.forEach(([x, y, alive], at) => {
        const dot = robots.children[at];
        dot.setAttribute("transform", `translate(${x} ${-y})`);
        dot.setAttribute("d", alive ? DISC(radius) : CROSS(radius));
        dot.setAttribute("class", alive ? "robot" : "dead");
      });
      const at = position ?? centre, arm = radius * 3;
      mark.setAttribute("d", at ? `M${at[0] - arm} ${-at[1]}h${2 * arm}M${at[0]} ${-at[1] - arm}v${2 * arm}` : "");
      return at;
    },
    get position() { return position; },
    forget() { position = null; },
  };
}
