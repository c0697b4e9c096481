// How a table is shown where it does not fit: turned, in groups of rows, in parts that repeat its first column, or with
// a block for each row. The first three are copies beside the table, which is hidden as long as they stand there.

const MOST_TURNED = 3; // rows that may become columns
const MOST_KEYS = 4; // first columns that may name a row together
const MOST_PARTS = 4;
const LONGEST = 40; // characters in a cell of a table that is taken apart; sentences need a block for each row
const SHORT = 14; // characters in a cell that stays on one line
const WIDEST_NAME = 0.38; // of the place, for the first column

// Heads and rows of cells, or null where cells span several rows or columns.
function readGrid(table) {
  const heads = [...(table.tHead?.rows[table.tHead.rows.length - 1]?.cells ?? [])];
  const rows = [...table.tBodies].flatMap((body) => [...body.rows]).map((row) => [...row.cells]);
  const isPlain = (row) => row.length === heads.length && row.every((cell) => cell.colSpan * cell.rowSpan === 1);
  return heads.length > 1 && rows.length > 0 && rows.every(isPlain) ? { heads, rows } : null;
}

function wordsOf(cell) {
  return cell.textContent.trim() || cell.innerHTML;
}

// What the first cells of a row say.
function keyOf(row, count) {
  return row.slice(0, count).map(wordsOf).join("\n");
}

function copyOf(cell, tag, scope) {
  const copy = document.createElement(tag);
  copy.className = cell.className;
  if (scope) copy.scope = scope;
  copy.append(...[...cell.childNodes].map((node) => node.cloneNode(true)));
  copy.querySelectorAll("[id]").forEach((node) => node.removeAttribute("id"));
  copy.querySelectorAll(".cell-head").forEach((node) => node.remove());
  return copy;
}

function rowOf(cells) {
  const row = document.createElement("tr");
  row.append(...cells);
  return row;
}

// A table of the same look, from a row of heads and groups of rows.
function newTable(table, kind, heads, groups) {
  const made = document.createElement("table");
  made.className = `${table.className} ${kind}`;
  made.append(document.createElement("thead"));
  made.tHead.append(rowOf(heads));
  for (const rows of groups) {
    const body = document.createElement("tbody");
    body.append(...rows);
    made.append(body);
  }
  return made;
}

function place(table, made) {
  const holder = document.createElement("div");
  holder.className = "table-parts";
  holder.append(...made);
  table.hidden = true;
  table.after(holder);
  return holder;
}

// A table is never narrower than its words. What MathJax adds for screen readers may stick out of it unseen.
function overflows(table) {
  return table.offsetWidth > table.parentElement.clientWidth + 1;
}

// Undo what stands beside a table.
function restore(table) {
  table.classList.remove("small", "stacked");
  table.hidden = false;
  if (table.nextElementSibling?.className === "table-parts") table.nextElementSibling.remove();
}

// Columns become rows, in a table of few rows.
function turn(table, { heads, rows }) {
  if (rows.length > MOST_TURNED || heads.length <= rows.length + 1) return false;
  const names = [copyOf(heads[0], "th", "col"), ...rows.map((row) => copyOf(row[0], "th", "col"))];
  const body = heads
    .slice(1)
    .map((head, i) => rowOf([copyOf(head, "th", "row"), ...rows.map((row) => copyOf(row[i + 1], "td"))]));
  names[0].classList.remove("number");
  body.forEach((row) => row.cells[0].classList.remove("number"));
  const made = newTable(table, "part turned", names, [body]);
  place(table, [made]);
  if (!overflows(made)) return true;
  restore(table);
  return false;
}

// Groups of rows with the same first columns, which become a heading, and the columns that name a row in its group.
function groupRows({ heads, rows }) {
  const isNamed = (count) => new Set(rows.map((row) => keyOf(row, count))).size === rows.length;
  const counts = [...Array(Math.min(MOST_KEYS, heads.length - 1)).keys()].map((i) => i + 1);
  const keys = counts.find(isNamed) ?? 1;
  const plans = counts.filter((count) => count < keys).map((shared) => runsOf(rows, shared));
  const helpful = plans.filter(({ groups, runs }) => runs === groups.length && 2 * runs <= rows.length).at(-1);
  const { shared, groups } = helpful ?? { shared: 0, groups: [rows] };
  return { shared, groups, names: [...heads.keys()].slice(shared, keys) };
}

// Groups of rows with the same first cells, and in how many runs they stand.
function runsOf(rows, shared) {
  const groups = new Map();
  for (const row of rows) groups.set(keyOf(row, shared), [...(groups.get(keyOf(row, shared)) ?? []), row]);
  const runs = rows.filter((row, i) => i === 0 || keyOf(row, shared) !== keyOf(rows[i - 1], shared)).length;
  return { shared, runs, groups: [...groups.values()] };
}

// The heading of a group: words as they are, numbers with the head of their column.
function headingOf(heads, row, shared, span) {
  const cell = document.createElement("th");
  cell.colSpan = span;
  cell.scope = "rowgroup";
  for (let i = 0; i < shared; i += 1) {
    if (i > 0) cell.append(", ");
    if (row[i].classList.contains("number")) cell.append(...copyOf(heads[i], "span").childNodes, " = ");
    cell.append(...copyOf(row[i], "span").childNodes);
  }
  const heading = rowOf([cell]);
  heading.className = "group";
  return heading;
}

// The part of a table with some of its columns, after those that name its rows.
function partOf(table, { heads, shared, groups, names }, columns) {
  const shown = [...names, ...columns];
  const bodies = groups.map((rows) => {
    const made = rows.map((row) => rowOf(shown.map((i) => partCell(row[i], i === shared))));
    return shared ? [headingOf(heads, rows[0], shared, shown.length), ...made] : made;
  });
  return newTable(
    table,
    "part",
    shown.map((i) => copyOf(heads[i], "th", "col")),
    bodies,
  );
}

function partCell(cell, isName) {
  const copy = isName ? copyOf(cell, "th", "row") : copyOf(cell, "td");
  copy.classList.toggle("short", !isName && copy.textContent.trim().length <= SHORT);
  return copy;
}

// The width that the first column likes, up to a share of the place, and those that the other columns need.
function measure(whole, room) {
  const cells = [...whole.tHead.rows[0].cells];
  const needed = cells.map((cell) => cell.getBoundingClientRect().width);
  whole.classList.add("unbroken");
  const liked = cells[0].getBoundingClientRect().width;
  whole.classList.remove("unbroken");
  return [Math.max(needed[0], Math.min(liked, WIDEST_NAME * room)), ...needed.slice(1)];
}

// Indices of columns for every part, at most `most` in each.
function distribute(widths, room, most) {
  const parts = [[]];
  let left = room;
  widths.forEach((width, i) => {
    if (parts.at(-1).length > 0 && (width > left || parts.at(-1).length === most)) {
      parts.push([]);
      left = room;
    }
    parts.at(-1).push(i);
    left -= width;
  });
  return parts;
}

// Groups of rows, and as few parts as fit, each with the columns that name its rows.
function divide(table, grid) {
  if (grid.rows.some((row) => row.slice(1).some((cell) => cell.textContent.trim().length > LONGEST))) return false;
  const plan = { heads: grid.heads, ...groupRows(grid) };
  const columns = [...grid.heads.keys()].slice(plan.shared + plan.names.length);
  const whole = partOf(table, plan, columns);
  const holder = place(table, [whole]);
  whole.classList.toggle("small", overflows(whole));
  if (!overflows(whole)) return true;
  whole.classList.remove("small");
  const widths = measure(whole, holder.clientWidth);
  const room = holder.clientWidth - widths.slice(0, plan.names.length).reduce((sum, width) => sum + width, 0);
  const others = widths.slice(plan.names.length);
  const fewest = distribute(others, room, columns.length).length;
  const parts = distribute(others, room, Math.ceil(columns.length / fewest));
  holder.replaceChildren(
    ...parts.map((part) =>
      partOf(
        table,
        plan,
        part.map((i) => columns[i]),
      ),
    ),
  );
  holder.querySelectorAll("thead th:first-child").forEach((head) => (head.style.minWidth = `${widths[0]}px`));
  if (parts.length <= MOST_PARTS && ![...holder.children].some(overflows)) return true;
  restore(table);
  return false;
}

// A block for each row, with the heads repeated.
function stack(table) {
  const heads = [...table.querySelectorAll("thead tr:last-child > *")];
  for (const row of table.querySelectorAll("tbody tr")) {
    [...row.children].forEach((cell, index) => {
      const named = index === 0 && !cell.classList.contains("number"); // words need no head, a number does
      if (named || !heads[index] || cell.querySelector(".cell-head")) return;
      cell.classList.toggle("empty", !cell.textContent.trim() && !cell.querySelector("img"));
      const head = document.createElement("span");
      head.className = "cell-head";
      head.setAttribute("aria-hidden", "true");
      head.append(...copyOf(heads[index], "span").childNodes);
      cell.prepend(head);
    });
  }
  table.classList.add("stacked");
}

// Show a table that is too wide, even with small letters, in the way that suits it.
function layOut(table) {
  const grid = readGrid(table);
  table.classList.remove("small");
  if (!table.tHead) table.classList.add("small");
  else if (!grid || !(turn(table, grid) || divide(table, grid))) stack(table);
}

window.tableLayouts = { layOut, overflows, restore };
