import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";

const BUDGETS = ["steps", "seconds"];

// A table of systems in the order of any measure: what another measure makes of it, and what the intervals leave.
export function main(root, data) {
  const measures = Object.keys(data.measures);
  const most = new Set(data.rows.map(({ system }) => system)).size - 1; // the floor has no row
  const figure = panel(root, {
    column: data.columns[0],
    budget: "steps",
    order: data.order,
    shown: data.order,
    initial: true,
  });
  const { state } = figure;
  const size = { y: { range: [most + 0.3, -0.4] }, height: 44 + 38 * most };
  const bars = figure.plot({
    name: "the mean of each system with its interval, in order",
    x: { range: [0, 1] },
    ...size,
    width: 340,
  });
  const ranks = figure.plot({
    name: "the order by one measure joined to that by the other",
    x: { range: [0, 1] },
    ...size,
    width: 330,
  });

  const better = (key) => (one, other) => data.measures[key].sign * (one[key][0] - other[key][0]);
  const inWords = (key, value) => `${value.toFixed(data.measures[key].digits)}${data.measures[key].unit}`;
  const spanOf = (key, [mean, half]) =>
    `${inWords(key, mean)} (95 % ${[mean - half, mean + half].map((end) => end.toFixed(data.measures[key].digits)).join(" to ")})`;
  const colourOf = ({ system }) =>
    ({ [data.ours]: COLOURS.blue, [data.start]: COLOURS.orange })[system] ?? COLOURS.black;

  function drawBars(rows, floor) {
    const key = state.shown;
    const ends = [...rows, floor].flatMap((row) => [row[key][0] - row[key][1], row[key][0] + row[key][1]]);
    const [low, high] = [Math.min(...ends), Math.max(...ends)];
    const at = (value) => 0.02 + (0.96 * (value - low)) / (high - low || 1);
    const best = at(floor[key][0]);
    bars.segments([[[best, 0], [best, rows.length]]], { colour: COLOURS.grey, width: 2, dash: "6 4" }); // prettier-ignore
    rows.forEach((row, k) => {
      const [mean, half] = row[key];
      const look = { colour: colourOf(row), width: 6, opacity: 0.4 };
      bars.segments([[[at(mean - half), k + 0.68], [at(mean + half), k + 0.68]]], look); // prettier-ignore
      bars.dots([[at(mean), k + 0.68]], { colour: colourOf(row), size: 10 });
      bars.text([0, k + 0.42], row.system);
      bars.text([1, k + 0.42], inWords(key, mean), { "text-anchor": "end" });
    });
    bars.text([0, -0.18], `dashed: floor, ${inWords(key, floor[key][0])}`);
  }
  function drawRanks(rows, others) {
    const names = (list, place, anchor) =>
      list.forEach((row, k) =>
        ranks.text([place, k + 0.6], row.system, { "text-anchor": anchor, style: "font-size: 13px" }),
      );
    names(rows, 0, "start");
    names(others, 1, "end");
    rows.forEach((row, k) => {
      const ends = [[0.44, k + 0.5], [0.56, others.indexOf(row) + 0.5]]; // prettier-ignore
      ranks.curve(ends, { colour: colourOf(row), width: 2.5 });
      ranks.dots(ends, { colour: colourOf(row), size: 6 });
    });
    ranks.text([0, -0.18], state.order);
    ranks.text([1, -0.18], state.shown, { "text-anchor": "end" });
  }
  function draw() {
    const here = data.rows.filter(({ column, budget }) => column === state.column && budget === state.budget);
    const floor = here.find(({ system }) => system === data.floor);
    const listed = here.filter((row) => row !== floor && (state.initial || row.system !== data.start));
    const rows = listed.toSorted(better(state.order));
    const others = rows.toSorted(better(state.shown));
    drawBars(rows, floor);
    drawRanks(rows, others);
    const pairs = rows.flatMap((row, k) => rows.slice(k + 1).map((later) => [row, later]));
    const turned = pairs.filter(([row, later]) => better(state.shown)(later, row) < 0).length;
    const [mean, half] = others[0][state.shown];
    const overlap = others
      .slice(1)
      .filter((row) => Math.abs(row[state.shown][0] - mean) <= row[state.shown][1] + half).length;
    const again =
      state.shown === state.order ? "" : ` By ${state.shown}, ${turned} of ${pairs.length} pairs change places.`;
    const status =
      `${state.column}, equal ${state.budget}. First by ${state.order}: ${rows[0].system}. ` +
      `First by ${state.shown}: ${others[0].system}, ${spanOf(state.shown, others[0][state.shown])}; ` +
      `the intervals of ${overlap} of ${rows.length - 1} others overlap with it.${again}`;
    return { status, values: { first: others[0].system, leader: rows[0].system, mean, half, turned, overlap } };
  }
  figure.run({
    draw,
    controls: [
      { kind: "choice", key: "order", label: "In the order of", options: measures },
      { kind: "choice", key: "shown", label: "Show", options: measures },
      { kind: "choice", key: "column", label: "Column", options: data.columns },
      { kind: "choice", key: "budget", label: "Equal", options: BUDGETS },
      { kind: "check", key: "initial", label: `count the ${data.start} as a system` },
    ],
  });
}
