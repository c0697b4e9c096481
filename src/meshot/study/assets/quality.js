import { VERDICTS, keepVerdicts, keptVerdicts, readVerdicts, verdictTable } from "./verdicts.js";

const KEYS = { a: "accept", d: "doubt", r: "reject" };

function inView(node) {
  const { top, bottom } = node.getBoundingClientRect();
  return bottom > 0 && top < innerHeight;
}

// Missing values are last, in both directions.
function compared(first, second, sign) {
  if (first === null || second === null) {
    return (first === null) - (second === null);
  }
  if (typeof first === "string") {
    return sign * first.localeCompare(second, "en", { numeric: true });
  }
  return sign * (first - second || 0);
}

const get = (id) => document.getElementById(id);

function stateOf({ subjects, file }) {
  const trouble = get("trouble");
  const complain = (text) => Object.assign(trouble, { textContent: text, hidden: !text });
  const [mosaic, body] = [get("mosaic"), document.querySelector("tbody")];
  return {
    subjects,
    file,
    complain,
    mosaic,
    body,
    heads: [...document.querySelectorAll("thead th")],
    cards: [...mosaic.children],
    lines: [...body.children],
    verdicts: keptVerdicts(complain),
    order: subjects.map((_, i) => i),
    current: 0,
    sign: -1,
  };
}

const shown = ({ order, cards }) => order.filter((i) => !cards[i].hidden);

function isWanted({ subjects, verdicts }, i) {
  const { name, odd, warned, failed, key } = subjects[i];
  const show = get("show").value;
  const kinds = { all: true, odd, warned, failed, none: !verdicts.has(key) };
  const kind = kinds[show] ?? verdicts.get(key) === show;
  return kind && name.toLowerCase().includes(get("find").value.trim().toLowerCase());
}

function tellCount(page) {
  const { subjects, verdicts } = page;
  const n = (verdict) => subjects.filter(({ key }) => verdicts.get(key) === verdict).length;
  const of = VERDICTS.map((verdict) => `${n(verdict)} ${verdict}`).join(", ");
  const places = shown(page);
  get("count").textContent = `${places.length} of ${subjects.length} shown; ${of}`;
  get("nothing").hidden = places.length > 0;
}

function draw({ subjects, verdicts, cards, lines }, i) {
  const verdict = verdicts.get(subjects[i].key);
  cards[i].dataset.verdict = verdict ?? "";
  cards[i].querySelectorAll("[aria-pressed]").forEach((button) => {
    button.setAttribute("aria-pressed", String(button.value === verdict));
  });
  lines[i].lastElementChild.textContent = verdict ?? "";
}

function select(page) {
  const { cards, lines } = page;
  cards.forEach((card, i) => {
    card.hidden = lines[i].hidden = !isWanted(page, i);
  });
  if (cards[page.current].hidden) {
    hold(page, shown(page)[0] ?? page.current);
  }
  tellCount(page);
}

function sortedOrder({ subjects, verdicts, heads, order, sign }, column) {
  const value = (i) =>
    column === heads.length - 1 ? (verdicts.get(subjects[i].key) ?? null) : subjects[i].values[column];
  return order.toSorted((i, j) => compared(value(i), value(j), sign) || i - j);
}

function arrange(page) {
  const column = Number(get("sort").value);
  page.order = sortedOrder(page, column);
  // What is in view is arranged at once, the rest after the next frame.
  const parts = [
    [page.mosaic, page.cards],
    [page.body, page.lines],
  ];
  const place = ([holder, items]) => holder.append(...page.order.map((i) => items[i]));
  parts.filter(([holder]) => inView(holder)).forEach(place);
  setTimeout(() => parts.filter(([holder]) => !inView(holder)).forEach(place), 50);
  const direction = page.sign > 0 ? "ascending" : "descending";
  page.heads.forEach((head, i) => head.setAttribute("aria-sort", i === column ? direction : "none"));
  get("turn").textContent = direction;
}

// One card is in the order of the Tab key; arrows move between cards.
function hold(page, i) {
  page.cards[page.current].tabIndex = -1;
  page.current = i;
  page.cards[i].tabIndex = 0;
}

function step(page, by) {
  const places = shown(page);
  const next = places[places.indexOf(page.current) + by];
  if (next !== undefined) {
    hold(page, next);
    page.cards[next].focus();
  }
}

function judge(page, i, verdict) {
  const { subjects, verdicts, complain } = page;
  if (verdict) {
    verdicts.set(subjects[i].key, verdict);
  } else {
    verdicts.delete(subjects[i].key);
  }
  keepVerdicts(verdicts, complain);
  draw(page, i);
  tellCount(page);
}

function enlarge({ cards }, i) {
  const dialog = document.querySelector("dialog");
  const picture = cards[i].querySelector("img");
  if (picture) {
    Object.assign(dialog.querySelector("img"), { src: picture.src, alt: picture.alt });
    dialog.showModal();
  }
}

function clicked(page, { target }) {
  const card = target.closest(".card");
  const button = target.closest("button");
  const i = page.cards.indexOf(card);
  if (button?.className === "enlarge") {
    enlarge(page, i);
  } else if (button) {
    judge(page, i, button.getAttribute("aria-pressed") === "true" ? null : button.value);
  } else if (card && !target.closest("a")) {
    card.focus();
  }
}

const DOES = {
  j: (page) => step(page, 1),
  k: (page) => step(page, -1),
  ArrowRight: (page) => step(page, 1),
  ArrowLeft: (page) => step(page, -1),
  u: (page) => judge(page, page.current, null),
  z: (page) => enlarge(page, page.current),
  o: (page) => page.cards[page.current].querySelector("a")?.click(),
};

function pressed(page, event) {
  if (event.ctrlKey || event.metaKey || event.altKey) {
    return;
  }
  if (KEYS[event.key]) {
    judge(page, page.current, KEYS[event.key]);
    step(page, 1);
  } else if (DOES[event.key]) {
    DOES[event.key](page);
  } else {
    return;
  }
  event.preventDefault();
}

function download({ subjects, verdicts, file }) {
  const url = URL.createObjectURL(new Blob([verdictTable(subjects, verdicts)], { type: "text/tab-separated-values" }));
  Object.assign(document.createElement("a"), { href: url, download: file }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

async function load(page, { target }) {
  const { subjects, verdicts, complain, cards } = page;
  const [file] = target.files;
  try {
    complain("");
    const n = readVerdicts(await file.text(), subjects, verdicts);
    if (n === 0) {
      complain(`${file.name} holds no verdict on a subject of this study.`);
    }
    keepVerdicts(verdicts, complain);
  } catch (error) {
    complain(`${file.name} is not used: ${error.message}.`);
  }
  target.value = "";
  cards.forEach((_, i) => draw(page, i));
  select(page);
}

function sortBy(page, i) {
  page.sign = Number(get("sort").value) === i ? -page.sign : 1;
  get("sort").value = String(i);
  arrange(page);
}

function turnOver(page) {
  page.sign = -page.sign;
  arrange(page);
}

function listen(page) {
  const { mosaic, heads, cards } = page;
  mosaic.addEventListener("focusin", ({ target }) => hold(page, cards.indexOf(target.closest(".card"))));
  mosaic.addEventListener("click", (event) => clicked(page, event));
  mosaic.addEventListener("keydown", (event) => pressed(page, event));
  heads.forEach((head, i) => head.firstElementChild.addEventListener("click", () => sortBy(page, i)));
  get("sort").addEventListener("change", () => arrange(page));
  get("turn").addEventListener("click", () => turnOver(page));
  get("show").addEventListener("change", () => select(page));
  get("find").addEventListener("input", () => select(page));
  get("download").addEventListener("click", () => download(page));
  get("load").addEventListener("change", (event) => load(page, event));
}

export function main(data) {
  const page = stateOf(data);
  listen(page);
  get("sort").value = String(data.first);
  page.cards.forEach((_, i) => draw(page, i));
  arrange(page);
  hold(page, page.order[0]);
  select(page);
}
