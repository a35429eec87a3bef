// One line at the foot of the page, for a while.
let timer;

export function showNotice(text, stays = false) {
  const element = document.getElementById("notice");
  element.textContent = text;
  element.hidden = false;
  element.className = stays ? "note" : "";
  clearTimeout(timer);
  timer = setTimeout(() => { element.hidden = true; }, stays ? 20000 : 7000);
}
