// Rerun's viewer in its frame, as dark or light as the page.
export function viewer() {
  const frame = document.getElementById("viewer");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let facts = null;
  const load = () => {
    const theme = dark.matches ? "dark" : "light";
    const url = encodeURIComponent(facts.stream);
    frame.src = `${facts.viewer}/?url=${url}&theme=${theme}&renderer=webgl&hide_welcome_screen&persist=0`;
  };
  dark.addEventListener("change", () => facts && load());
  return {
    begin(told) {
      const first = facts === null;
      facts = told;
      if (first) load();
    },
  };
}
