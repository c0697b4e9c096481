// The gallery: three choices say which figures are shown, and a line says how many. Without this script all are shown.

function showChosen(form) {
  const items = [...document.querySelectorAll(".gallery > li")];
  const chosen = Object.fromEntries(new FormData(form));
  for (const { dataset, style } of items) {
    const fits =
      (!chosen.chapter || dataset.chapter === chosen.chapter) &&
      (!chosen.concept || dataset.concepts.split("|").includes(chosen.concept)) &&
      (!chosen.kind || dataset.kind === chosen.kind);
    style.display = fits ? "" : "none";
  }
  const count = items.filter(({ style }) => !style.display).length;
  const number = count === 1 ? "1 figure" : `${count} figures`;
  document.querySelector(".gallery-said").textContent = count < items.length ? `${number} of ${items.length}` : number;
  const kept = new URLSearchParams(Object.entries(chosen).filter(([, value]) => value)).toString();
  history.replaceState(null, "", kept ? `#${kept}` : location.pathname);
}

window.addEventListener("DOMContentLoaded", () => {
  const form = document.querySelector(".gallery-filters");
  if (!form) return;
  // An address such as gallery.html#concept=flows leads to a choice.
  for (const [name, value] of new URLSearchParams(location.hash.slice(1))) {
    const select = form.elements[name];
    if (select && [...select.options].some((option) => option.value === value)) select.value = value;
  }
  form.hidden = false;
  form.addEventListener("change", () => showChosen(form));
  form.addEventListener("reset", () => setTimeout(() => showChosen(form)));
  if (location.hash) showChosen(form);
});
