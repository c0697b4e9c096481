// A table that does not fit becomes smaller; where that is not enough, each row becomes a block with its heads repeated.
// Formulas that do not fit become smaller.

const SMALLEST = 0.55;

function headed(table) {
  const heads = [...table.querySelectorAll("thead tr:last-child > *")];
  for (const row of table.querySelectorAll("tbody tr")) {
    [...row.children].forEach((cell, index) => {
      const named = index === 0 && !cell.classList.contains("number"); // words need no head, a number does
      if (named || !heads[index] || cell.querySelector(".cell-head")) return;
      const head = document.createElement("span");
      head.className = "cell-head";
      head.setAttribute("aria-hidden", "true");
      head.append(...[...heads[index].childNodes].map((node) => node.cloneNode(true)));
      cell.prepend(head);
    });
  }
}

function overflows(table) {
  const holder = table.parentElement;
  return table.scrollWidth > Math.min(table.clientWidth, holder.clientWidth) + 1;
}

function fitTable(table) {
  table.classList.remove("small", "stacked");
  if (!overflows(table)) return;
  table.classList.add("small");
  if (!overflows(table) || !table.tHead) return;
  headed(table);
  table.classList.remove("small");
  table.classList.add("stacked");
}

function fitFormula(formula) {
  formula.style.fontSize = "";
  const room = formula.parentElement.clientWidth;
  const inner = formula.querySelector("mjx-math");
  const width = inner ? Math.max(formula.scrollWidth, inner.scrollWidth) : 0;
  if (width > room + 1) {
    const size = parseFloat(getComputedStyle(formula).fontSize);
    formula.style.fontSize = `${Math.max(SMALLEST, (room / width) * 0.98) * size}px`;
  }
}

// What is folded has no width; it is fitted when it is opened.
function isSeen(node) {
  return node.offsetParent !== null && node.closest(".bd-article");
}

function fitAll(root) {
  [...root.querySelectorAll("table:not(.indextable)")].filter(isSeen).forEach(fitTable);
  [...root.querySelectorAll("mjx-container[display]")].filter(isSeen).forEach(fitFormula);
}

window.addEventListener("load", () => {
  const typeset = window.MathJax?.startup?.promise ?? Promise.resolve();
  typeset.then(() => fitAll(document));
  let width = window.innerWidth;
  window.addEventListener("resize", () => {
    if (window.innerWidth !== width) {
      width = window.innerWidth;
      fitAll(document);
    }
  });
  document.addEventListener("toggle", (event) => fitAll(event.target), true);
});
