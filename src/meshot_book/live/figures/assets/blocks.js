import { orthogonalDirections } from "../../assets/frames.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { sphereDirections, spiralDirections } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";

const COUNTS = [3, 6, 12, 24, 48, 96, 192, 384];
const [LEAST, AT_FIRST, SLICES] = [1e-5, 20, 400];
const KINDS = {
  random: { make: (count, random) => sphereDirections(count, 3, random), colour: COLOURS.black, dash: "3 4" },
  orthogonal: {
    make: (count, random) => orthogonalDirections(count, 3, random),
    colour: COLOURS.vermillion,
    dash: "9 4",
  },
  spiral: { make: spiralDirections, colour: COLOURS.blue, dash: "" },
};

// Two normal distributions in space, one moved and stretched: the error of three kinds of directions, over their number.
export function main(root, data) {
  const figure = panel(root, { shift: data.shift, stretch: data.stretch, known: false, count: data.count, seed: 0 });
  const { state } = figure;
  const plate = figure.plot({
    name: "relative error over the number of directions, for three kinds of directions",
    x: { range: [2.6, 480], log: true, label: "directions L", ticks: [3, 10, 30, 100, 300] },
    y: { range: [0.6 * LEAST, 3], log: true, label: "relative error (rms; bottom: below 10⁻⁵)" },
    width: 640,
    height: 370,
  });
  let rounds = 0;
  let sums = new Map();

  // On a line the two are normal: the squared difference of the means, and that of the standard deviations.
  function costs(lines) {
    const { shift, stretch, known } = state;
    return lines.map(([u]) => {
      const move = known ? shift ** 2 / 3 : (shift * u) ** 2;
      return move + (Math.sqrt(1 + (stretch ** 2 - 1) * u * u) - 1) ** 2;
    });
  }
  // A coordinate of a uniform direction is uniform on [−1, 1] (Archimedes): Simpson's rule.
  function truth() {
    const { shift, stretch } = state;
    let sum = 0;
    for (let k = 0; k <= SLICES; k += 1) {
      const u = k / SLICES;
      const weight = k === 0 || k === SLICES ? 1 : k % 2 ? 4 : 2;
      sum += weight * (Math.sqrt(1 + (stretch ** 2 - 1) * u * u) - 1) ** 2;
    }
    return shift ** 2 / 3 + sum / (3 * SLICES);
  }
  // Each set has random numbers of its own, so that a set of a given size is the same whenever it is drawn.
  function addSets(count, from, to) {
    const right = truth();
    const found = sums.get(count) ?? Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, 0]));
    sums.set(count, found);
    for (let k = from; k < to; k += 1) {
      for (const [kind, { make }] of Object.entries(KINDS)) {
        const values = costs(make(count, generator(1000 * state.seed + k)));
        found[kind] += (values.reduce((sum, value) => sum + value, 0) / count / right - 1) ** 2;
      }
    }
  }
  function step() {
    new Set([...COUNTS, state.count]).forEach((count) => addSets(count, rounds, rounds + 1));
    rounds += 1;
    return rounds < data.rounds;
  }
  function begin(key) {
    if (key === "count") {
      sums.delete(state.count);
      addSets(state.count, 0, rounds);
      return;
    }
    // Two equal distributions have no relative error.
    state.stretch = state.shift === 0 ? Math.max(state.stretch, 1.1) : state.stretch;
    sums = new Map();
    rounds = 0;
    while (rounds < AT_FIRST) {
      step();
    }
  }
  function draw() {
    const rms = (count, kind) => Math.sqrt(sums.get(count)[kind] / rounds);
    const seen = (count, kind) => [count, Math.max(LEAST, rms(count, kind))];
    const values = { rounds, truth: truth() };
    const words = Object.entries(KINDS).map(([kind, { colour, dash }], k) => {
      plate.curve(
        COUNTS.map((count) => seen(count, kind)),
        { colour, width: 2.5, dash },
      );
      plate.dots([seen(state.count, kind)], { colour, size: 12 });
      plate.text([2.8, 2.2e-5 * 3 ** k], kind, { fill: colour });
      values[kind] = rms(state.count, kind);
      return `${kind} ${values[kind] < 1e-12 ? "0" : digits(values[kind], 2)}`;
    });
    const part = state.count % 3 ? `the last block has ${state.count % 3} of 3` : "all blocks are whole";
    const status =
      `${rounds} sets of ${state.count} directions (${part}). Relative error: ${words.join(", ")}.` +
      `${state.known ? " The part of the means is known." : ""}`;
    return { status, values };
  }
  figure.run({
    draw,
    play: { step, perSecond: 20 },
    changed: begin,
    controls: [
      { kind: "range", key: "count", label: "directions", min: 3, max: 300, step: 1 },
      { kind: "range", key: "shift", label: "distance of the means", min: 0, max: 3, step: 0.25 },
      { kind: "range", key: "stretch", label: "stretch of one", min: 1, max: 3, step: 0.1 },
      { kind: "check", key: "known", label: "part of the means known" },
      { kind: "button", label: "other sets", press: () => (state.seed += 1) },
    ],
  });
}
