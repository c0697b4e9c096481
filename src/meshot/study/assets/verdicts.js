// Verdicts by the key of a subject, kept in the browser if it lets us, and as a table of tab-separated values.
const STORE = "meshot verdicts";
const HEAD = ["participant_id", "session_id", "verdict"];
const MISSING = "n/a";
export const VERDICTS = ["accept", "doubt", "reject"];

export function keptVerdicts(complain) {
  try {
    return new Map(Object.entries(JSON.parse(localStorage.getItem(STORE) ?? "{}")));
  } catch {
    complain("This browser keeps no verdicts. Download them before you close the page.");
    return new Map();
  }
}

export function keepVerdicts(verdicts, complain) {
  try {
    localStorage.setItem(STORE, JSON.stringify(Object.fromEntries(verdicts)));
  } catch {
    complain("This browser keeps no verdicts. Download them before you close the page.");
  }
}

export function verdictTable(subjects, verdicts) {
  const rows = subjects.map(({ participant, session, key }) => [
    participant,
    session ?? MISSING,
    verdicts.get(key) ?? MISSING,
  ]);
  return [HEAD, ...rows].map((row) => row.join("\t") + "\n").join("");
}

// The number of verdicts taken over. The table is refused as a whole if a line is wrong.
export function readVerdicts(text, subjects, verdicts) {
  const [head, ...lines] = text.replace(/\r/g, "").split("\n");
  const places = HEAD.map((name) => head.split("\t").indexOf(name));
  if (places.includes(-1)) {
    throw new Error(
      `the file has no columns ${HEAD.join(", ")} separated by tabs; load a file that was downloaded here`,
    );
  }
  const keys = new Map(
    subjects.map((subject) => [`${subject.participant}\t${subject.session ?? MISSING}`, subject.key]),
  );
  const found = [];
  lines.forEach((line, i) => {
    const cells = line.split("\t");
    const [participant, session, verdict] = places.map((place) => cells[place]);
    if (line && verdict !== MISSING && !VERDICTS.includes(verdict)) {
      throw new Error(`line ${i + 2} has the verdict ${verdict}; ${VERDICTS.join(", ")} or ${MISSING} is needed`);
    }
    const key = keys.get(`${participant}\t${session}`);
    if (key && VERDICTS.includes(verdict)) {
      found.push([key, verdict]);
    }
  });
  found.forEach(([key, verdict]) => verdicts.set(key, verdict));
  return found.length;
}
