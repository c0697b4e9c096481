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

export function main({ subjects, first, file }) {
  const [mosaic, sort, turn, show, find, trouble] = ["mosaic", "sort", "turn", "show", "find", "trouble"].map(get);
  const heads = [...document.querySelectorAll("thead th")];
  const body = document.querySelector("tbody");
  const dialog = document.querySelector("dialog");
  const cards = [...mosaic.children];
  const lines = [...body.children];
  let order = subjects.map((_, i) => i);
  let current = 0;
  let sign = -1;

  const complain = (text) => Object.assign(trouble, { textContent: text, hidden: !text });
  const verdicts = keptVerdicts(complain);

  const wanted = (i) => {
    const { name, odd, warned, failed, key } = subjects[i];
    const kinds = { all: true, odd, warned, failed, none: !verdicts.has(key) };
    const kind = kinds[show.value] ?? verdicts.get(key) === show.value;
    return kind && name.toLowerCase().includes(find.value.trim().toLowerCase());
  };
  const shown = () => order.filter((i) => !cards[i].hidden);

  const tellCount = () => {
    const n = (verdict) => subjects.filter(({ key }) => verdicts.get(key) === verdict).length;
    const of = VERDICTS.map((verdict) => `${n(verdict)} ${verdict}`).join(", ");
    get("count").textContent = `${shown().length} of ${subjects.length} shown; ${of}`;
    get("nothing").hidden = shown().length > 0;
  };
  const draw = (i) => {
    const verdict = verdicts.get(subjects[i].key);
    cards[i].dataset.verdict = verdict ?? "";
    cards[i].querySelectorAll("[aria-pressed]").forEach((button) => {
      button.setAttribute("aria-pressed", String(button.value === verdict));
    });
    lines[i].lastElementChild.textContent = verdict ?? "";
  };
  const select = () => {
    cards.forEach((card, i) => {
      card.hidden = lines[i].hidden = !wanted(i);
    });
    if (cards[current].hidden) {
      hold(shown()[0] ?? current);
    }
    tellCount();
  };
  const arrange = () => {
    const column = Number(sort.value);
    const value = (i) =>
      column === heads.length - 1 ? (verdicts.get(subjects[i].key) ?? null) : subjects[i].values[column];
    order = order.toSorted((i, j) => compared(value(i), value(j), sign) || i - j);
    // What is in view is arranged at once, the rest after the next frame.
    const parts = [
      [mosaic, cards],
      [body, lines],
    ];
    const place = ([holder, items]) => holder.append(...order.map((i) => items[i]));
    parts.filter(([holder]) => inView(holder)).forEach(place);
    setTimeout(() => parts.filter(([holder]) => !inView(holder)).forEach(place), 50);
    heads.forEach((head, i) => {
      head.setAttribute("aria-sort", i !== column ? "none" : sign > 0 ? "ascending" : "descending");
    });
    turn.textContent = sign > 0 ? "ascending" : "descending";
  };

  // One card is in the order of the Tab key; arrows move between cards.
  function hold(i) {
    cards[current].tabIndex = -1;
    current = i;
    cards[i].tabIndex = 0;
  }
  const step = (by) => {
    const places = shown();
    const next = places[places.indexOf(current) + by];
    if (next !== undefined) {
      hold(next);
      cards[next].focus();
    }
  };
  const judge = (i, verdict) => {
    if (verdict) {
      verdicts.set(subjects[i].key, verdict);
    } else {
      verdicts.delete(subjects[i].key);
    }
    keepVerdicts(verdicts, complain);
    draw(i);
    tellCount();
  };
  const enlarge = (i) => {
    const picture = cards[i].querySelector("img");
    if (picture) {
      Object.assign(dialog.querySelector("img"), { src: picture.src, alt: picture.alt });
      dialog.showModal();
    }
  };

  mosaic.addEventListener("focusin", (event) => hold(cards.indexOf(event.target.closest(".card"))));
  mosaic.addEventListener("click", (event) => {
    const card = event.target.closest(".card");
    const button = event.target.closest("button");
    const i = cards.indexOf(card);
    if (button?.className === "enlarge") {
      enlarge(i);
    } else if (button) {
      judge(i, button.getAttribute("aria-pressed") === "true" ? null : button.value);
    } else if (card && !event.target.closest("a")) {
      card.focus();
    }
  });
  const does = {
    j: () => step(1),
    k: () => step(-1),
    ArrowRight: () => step(1),
    ArrowLeft: () => step(-1),
    u: () => judge(current, null),
    z: () => enlarge(current),
    o: () => cards[current].querySelector("a")?.click(),
  };
  mosaic.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) {
      return;
    }
    if (KEYS[event.key]) {
      judge(current, KEYS[event.key]);
      step(1);
    } else if (does[event.key]) {
      does[event.key]();
    } else {
      return;
    }
    event.preventDefault();
  });

  heads.forEach((head, i) => {
    head.firstElementChild.addEventListener("click", () => {
      sign = Number(sort.value) === i ? -sign : 1;
      sort.value = String(i);
      arrange();
    });
  });
  sort.addEventListener("change", arrange);
  turn.addEventListener("click", () => {
    sign = -sign;
    arrange();
  });
  show.addEventListener("change", select);
  find.addEventListener("input", select);
  get("download").addEventListener("click", () => {
    const url = URL.createObjectURL(
      new Blob([verdictTable(subjects, verdicts)], { type: "text/tab-separated-values" }),
    );
    Object.assign(document.createElement("a"), { href: url, download: file }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  });
  get("load").addEventListener("change", async ({ target }) => {
    try {
      complain("");
      const text = await target.files[0].text();
      const n = readVerdicts(text, subjects, verdicts);
      if (n === 0) {
        complain(`${target.files[0].name} holds no verdict on a subject of this study.`);
      }
      keepVerdicts(verdicts, complain);
    } catch (error) {
      complain(`${target.files[0].name} is not used: ${error.message}.`);
    }
    target.value = "";
    cards.forEach((_, i) => draw(i));
    select();
  });

  sort.value = String(first);
  cards.forEach((_, i) => draw(i));
  arrange();
  hold(order[0]);
  select();
}
