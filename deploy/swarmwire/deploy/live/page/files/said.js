// One line at the foot of the page, for a while.
let gone;

export function say(text, stays = false) {
  const place = document.getElementById("said");
  place.textContent = text;
  place.hidden = false;
  place.className = stays ? "note" : "";
  clearTimeout(gone);
  gone = setTimeout(() => { place.hidden = true; }, stays ? 20000 : 7000);
}
