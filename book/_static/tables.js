// Tables and formulas that do not fit: a table becomes smaller or is laid out otherwise, a formula becomes smaller.

const SMALLEST = 0.55;

// All are measured before any is changed: a page is laid out a few times only.
function fitTables(tables) {
  const { layOut, overflows, restore } = window.tableLayouts;
  tables.forEach(restore);
  const wide = tables.filter(isSeen).filter(overflows);
  wide.forEach((table) => table.classList.add("small"));
  wide.filter(overflows).forEach(layOut);
}

function fitFormulas(formulas) {
  formulas.forEach((formula) => (formula.style.fontSize = ""));
  const sizes = formulas.filter(isSeen).map((formula) => {
    const inner = formula.querySelector("mjx-math");
    const width = inner ? Math.max(formula.scrollWidth, inner.scrollWidth) : 0;
    return [formula, formula.parentElement.clientWidth, width, parseFloat(getComputedStyle(formula).fontSize)];
  });
  for (const [formula, room, width, size] of sizes) {
    if (width > room + 1) formula.style.fontSize = `${Math.max(SMALLEST, (room / width) * 0.98) * size}px`;
  }
}

// What is folded has no width; it is fitted when it is opened.
function isSeen(node) {
  return node.offsetParent !== null && node.closest(".bd-article");
}

function fitAll(root) {
  fitTables([...root.querySelectorAll("table:not(.indextable, .part)")]);
  fitFormulas([...root.querySelectorAll("mjx-container[display]")]);
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
