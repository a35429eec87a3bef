// Rerun's viewer with the recording beside it, as dark or light as the system. Its own page would load a font, look for
// a newer rerun and list examples, all from elsewhere.
const dark = matchMedia("(prefers-color-scheme: dark)");
const state = document.getElementById("state");
const options = {
  url: [new URL("run.rrd", location.href).href],
  render_backend: "webgl",
  theme: dark.matches ? "dark" : "light",
  hide_welcome_screen: true,
  check_for_updates_on_startup: false,
  enable_history: false,
  persist: false,
};
dark.addEventListener("change", () => location.reload());
// The viewer would take this key, and give the focus that its hidden text field gets back to the canvas, for ever.
addEventListener("keydown", (event) => { if (event.key === "Tab") event.stopImmediatePropagation(); }, { capture: true });

try {
  await wasm_bindgen({ module_or_path: "re_viewer_bg.wasm" });
  const viewer = new wasm_bindgen.WebHandle(options);
  await viewer.start(document.getElementById("canvas"));
  for (const field of document.querySelectorAll("input")) field.tabIndex = -1;
  state.remove();
} catch (error) {
  state.textContent = `the viewer did not start: ${error}`;
}
