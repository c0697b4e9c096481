import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { slicedLoss, sphereDirections } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";
import { sphereCosts } from "../../assets/spheres.js";

const SIZES = [10, 30, 100, 300, 1000];

// Samples of two spheres: how fast does the sliced cost of the samples approach that of the spheres?
export function main(root, data) {
  const figure = panel(root, { p: 2, radius: 1, distance: 0, seed: data.seed });
  const { state } = figure;
  const lines = sphereDirections(data.lines, 3, generator(1));
  const plate = figure.plot({
    name: "mean error over the number of points, with the bound",
    x: { range: [8, 1300], log: true, label: "points on each sphere" },
    y: { range: [1e-3, 10], log: true, label: "mean |error| (units^p)" },
    width: 420,
    height: 340,
  });
  const scene = figure.plot({
    name: "two spheres seen from the side, with a sample",
    x: { range: [-2.2, 4.2] },
    y: { range: [-2.2, 2.2] },
    width: 240,
    equal: true,
  });
  let random = generator(state.seed);
  let sums = SIZES.map(() => 0);
  let rounds = 0;
  let last = [];

  const shift = () => [state.distance, 0, 0];
  const truth = () => {
    const costs = sphereCosts(lines, [1, state.radius], shift(), state.p);
    return costs.reduce((sum, cost) => sum + cost, 0) / costs.length;
  };
  /** @type {(m: number, radius: number, centre: number[]) => number[][]} */
  const sphere = (m, radius, [u, v, w]) =>
    sphereDirections(m, 3, random).map(([x, y, z]) => [u + radius * x, v + radius * y, w + radius * z]);
  function step() {
    SIZES.forEach((m, k) => {
      const [x, y] = [sphere(m, 1, [0, 0, 0]), sphere(m, state.radius, shift())];
      sums[k] += Math.abs(slicedLoss(x, y, lines, { p: state.p }).cost - truth());
      last = m === 100 ? [x, y] : last;
    });
    rounds += 1;
    return rounds < data.rounds;
  }
  function again() {
    random = generator(state.seed);
    sums = SIZES.map(() => 0);
    rounds = 0;
    for (let k = 0; k < 4; k += 1) {
      step();
    }
  }
  function draw() {
    const errors = sums.map((sum) => sum / rounds);
    const bounds = SIZES.map((m) => boundOf(m, state));
    const all = [...errors, ...bounds];
    plate.rescale([0.6 * Math.min(...all), 1.7 * Math.max(...all)]);
    const over = (values) => values.map((value, k) => [SIZES[k], value]);
    plate.curve(over(bounds), { colour: COLOURS.grey, width: 2, dash: "7 5" });
    plate.curve(over(errors), { colour: COLOURS.blue, width: 2.5 });
    plate.dots(over(errors), { colour: COLOURS.blue, size: 9 });
    plate.text([SIZES[4], bounds[4] * 1.35], "bound", { "text-anchor": "end" });
    ["blue", "orange"].forEach((colour, k) => {
      const [centre, radius] = [k * state.distance, k ? state.radius : 1];
      const around = Array.from({ length: 60 }, (_, i) => (Math.PI * i) / 30);
      scene.outline(
        around.map((angle) => [centre + radius * Math.cos(angle), radius * Math.sin(angle)]),
        { colour: COLOURS[colour] },
      );
      scene.dots(
        last[k].map(([x, y]) => [x, y]),
        { colour: COLOURS[colour], size: 4, square: k === 1 },
      );
    });
    const slope = Math.log(errors[4] / errors[1]) / Math.log(SIZES[4] / SIZES[1]);
    const status =
      `${rounds} samples of each size. From ${SIZES[1]} to ${SIZES[4]} points the mean error falls as m^${digits(slope, 2)}; ` +
      `the bound as m^−0.5. At ${SIZES[4]} points the bound is ${digits(bounds[4] / errors[4], 2)} times the error.`;
    const values = { slope, error: errors[2], bound: bounds[2], truth: truth(), rounds };
    return { status, values };
  }
  figure.run({
    draw,
    play: { step, perSecond: 8 },
    changed: again,
    controls: [
      { kind: "choice", key: "p", label: "p", options: [1, 2, 3].map((p) => [p, `${p}`]) },
      { kind: "range", key: "radius", label: "radius of the second", min: 0.5, max: 2, step: 0.1 },
      { kind: "range", key: "distance", label: "distance", min: 0, max: 2, step: 0.1 },
      { kind: "button", key: "seed", label: "other samples", press: () => (state.seed += 1) },
    ],
  });
}

// p D^(p − 1) (E W₁ of one sample + E W₁ of the other), with E W₁ ≤ ∫ √(F (1 − F) / m) = 2r · π/8 / √m.
function boundOf(m, { p, radius, distance }) {
  const reach = Math.max(1, distance + radius) - Math.min(-1, distance - radius);
  return p * reach ** (p - 1) * ((2 + 2 * radius) * (Math.PI / 8)) * m ** -0.5;
}
