// Rerun's viewer in its frame.
export function viewer() {
  const frame = document.getElementById("viewer");
  return {
    begin(facts) {
      if (!frame.src) frame.src = facts.viewer; // once, also if the news come in anew
    },
  };
}
