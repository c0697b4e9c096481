// How a table is shown where it does not fit: turned, in groups of rows, in parts that repeat its first column, or with
// a block for each row. The first three are copies beside the table, which is hidden as long as they stand there.

const MOST_TURNED = 3; // rows that may become columns
const MOST_KEYS = 3; // first columns that may name a row together
const MOST_PARTS = 4;
const LONGEST = 40; // characters in a cell of a table that is taken apart; sentences need a block for each row
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

function overflows(table) {
  return table.scrollWidth > Math.min(table.clientWidth, table.parentElement.clientWidth) + 1;
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

// Groups of rows with the same first columns, and the number of these columns: they become a heading.
function groupRows({ heads, rows }) {
  const isNamed = (count) => new Set(rows.map((row) => keyOf(row, count))).size === rows.length;
  const counts = [...Array(Math.min(MOST_KEYS, heads.length - 1)).keys()].map((i) => i + 1);
  const shared = (counts.find(isNamed) ?? 1) - 1;
  const groups = new Map();
  for (const row of rows) groups.set(keyOf(row, shared), [...(groups.get(keyOf(row, shared)) ?? []), row]);
  const runs = rows.filter((row, i) => i === 0 || keyOf(row, shared) !== keyOf(rows[i - 1], shared)).length;
  const helps = shared > 0 && runs === groups.size && 2 * runs <= rows.length;
  return helps ? { shared, groups: [...groups.values()] } : { shared: 0, groups: [rows] };
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

// The part of a table with some of its columns.
function partOf(table, { heads, shared, groups }, columns) {
  const shown = [shared, ...columns];
  const bodies = groups.map((rows) => {
    const made = rows.map((row) =>
      rowOf(shown.map((i) => copyOf(row[i], i === shared ? "th" : "td", i === shared && "row"))),
    );
    return shared ? [headingOf(heads, rows[0], shared, shown.length), ...made] : made;
  });
  return newTable(
    table,
    "part",
    shown.map((i) => copyOf(heads[i], "th", "col")),
    bodies,
  );
}

// The width that the first column likes, up to a share of the place, and those that the other columns need.
function measure(whole, room) {
  const cells = [...whole.tHead.rows[0].cells];
  const needed = cells.map((cell) => cell.getBoundingClientRect().width);
  whole.classList.add("unbroken");
  const liked = cells[0].getBoundingClientRect().width;
  whole.classList.remove("unbroken");
  return [Math.max(needed[0], Math.min(liked, WIDEST_NAME * room)), needed.slice(1)];
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

// Groups of rows, and as few parts as fit, each with the first column.
function divide(table, grid) {
  if (grid.rows.some((row) => row.slice(1).some((cell) => cell.textContent.trim().length > LONGEST))) return false;
  const plan = { heads: grid.heads, ...groupRows(grid) };
  const columns = [...grid.heads.keys()].slice(plan.shared + 1);
  const whole = partOf(table, plan, columns);
  const holder = place(table, [whole]);
  const room = holder.clientWidth;
  const [name, widths] = measure(whole, room);
  const fewest = distribute(widths, room - name, columns.length).length;
  const most = Math.ceil(columns.length / fewest);
  const even = distribute(widths, room - name, most);
  if (fewest > 1)
    holder.replaceChildren(
      ...even.map((part) =>
        partOf(
          table,
          plan,
          part.map((i) => columns[i]),
        ),
      ),
    );
  holder.querySelectorAll("thead th:first-child").forEach((head) => (head.style.minWidth = `${name}px`));
  if (even.length <= MOST_PARTS && ![...holder.children].some(overflows)) return true;
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
