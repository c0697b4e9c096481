import { assignment } from "../../assets/assignment.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const POWERS = Array.from({ length: 39 }, (_, k) => (k + 2) / 20);
const [LOW, HIGH] = [0, 10];

const up = (places) => [...places].sort((a, b) => a - b);
const shareOf = ({ best, sorted }) => (sorted > 0 ? best / sorted : 1);

// The sorted pairing on a line beside the cheapest one, over the power p of the distance.
export function main(root, data) {
  const figure = panel(root, { p: data.p, source: data.source, target: data.target });
  const { state } = figure;
  const rows = figure.plot({
    name: "source above, target below: the sorted pairing and the cheapest one",
    x: { range: [LOW, HIGH], label: "position (units)" },
    y: { range: [-0.35, 1.35] },
    width: 420,
    height: 230,
  });
  const shares = figure.plot({
    name: "least cost over that of the sorted pairing, over p",
    x: { range: [0, 2.05], label: "p" },
    y: { range: [0, 1], label: "least cost / cost of sorting" },
    width: 250,
    height: 230,
  });

  // Both pairings of the sorted points: partners of each, and mean costs.
  function pairings(p) {
    const [x, y] = [up(state.source), up(state.target)];
    const costs = x.map((a) => y.map((b) => Math.abs(a - b) ** p));
    const best = assignment(costs);
    const sorted = x.reduce((sum, _, i) => sum + costs[i][i], 0);
    return { x, y, columns: Array.from(best.columns), best: best.cost / x.length, sorted: sorted / x.length };
  }

  function draw() {
    const { p } = state;
    const found = pairings(p);
    const { x, y, columns, best, sorted } = found;
    const lines = (partner) => x.map((a, i) => [[a, 1], [y[partner(i)], 0]]); // prettier-ignore
    const same = sorted - best <= 1e-9 * Math.max(1, sorted);
    const link = (i) => (same ? i : columns[i]);
    rows.segments(
      lines((i) => i),
      { colour: COLOURS.grey, width: 5 },
    );
    rows.segments(lines(link), { colour: COLOURS.blue, width: 2 });
    rows.dots(
      x.map((a) => [a, 1]),
      { colour: COLOURS.blue, size: 12 },
    );
    rows.dots(
      y.map((b) => [b, 0]),
      { colour: COLOURS.orange, size: 12, square: true },
    );
    rows.text([LOW, 1.18], "source");
    rows.text([LOW, -0.28], "target");
    const curve = POWERS.map((power) => [power, shareOf(pairings(power))]);
    shares.rescale([Math.min(0.94, ...curve.map(([, share]) => share - 0.03)), 1.02]);
    shares.segments([[[1, 0], [1, 1.02]]], { colour: COLOURS.grey, dash: "5 5" }); // prettier-ignore
    shares.curve(curve, { colour: COLOURS.blue, width: 2.5 });
    shares.dots([[p, shareOf(found)]], { colour: COLOURS.blue, size: 11 });
    const crossing = x.reduce((sum, _, i) => sum + x.filter((__, j) => j > i && link(j) < link(i)).length, 0);
    const words = same
      ? "No pairing is cheaper than sorting."
      : `The cheapest pairing costs ${digits(best)}, and ${crossing === 1 ? "one pair" : `${crossing} pairs`} of its lines cross.`;
    return {
      status: `For p = ${p.toFixed(2)} sorting has the mean cost ${digits(sorted)}. ${words}`,
      values: { best, sorted, crossing },
    };
  }
  for (const { key, row } of [
    { key: "source", row: 1 },
    { key: "target", row: 0 },
  ]) {
    figure.movable(rows, {
      name: `${key} points`,
      key,
      points: () => state[key].map((place) => [place, row]),
      move: (i, [place]) => {
        state[key] = state[key].with(i, Math.min(HIGH, Math.max(LOW, Math.round(place * 100) / 100)));
      },
      step: 0.1,
      say: (i) => `at ${state[key][i].toFixed(1)}`,
    });
  }
  figure.run({
    draw,
    controls: [
      { kind: "range", key: "p", label: "p", min: 0.1, max: 2, step: 0.05, say: (p) => p.toFixed(2) },
      {
        kind: "button",
        label: "six points on each side",
        press: () => Object.assign(state, data.more),
      },
    ],
  });
}
