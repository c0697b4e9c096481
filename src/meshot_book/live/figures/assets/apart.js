import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";
import { project, sphereDirections } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";
import { sphereCosts } from "../../assets/spheres.js";

const SIZES = [30, 100, 300, 1000];
const APART = [10, 30, 100, 300, 1000]; // mm between the centres
const POWERS = [1, 2, 3];
const COLOUR = [COLOURS.blue, COLOURS.green, COLOURS.vermillion];
const AT_FIRST = 4;

// Two spheres move apart: the error of the loss of samples, over the distance and over the number of points.
export function main(root, data) {
  const figure = panel(root, { apart: 2, size: 3, shown: "error", centred: false, seed: data.seed });
  const { state } = figure;
  const lines = sphereDirections(data.lines, 3, generator(1));
  const truths = POWERS.map((p) => [0, ...APART].map((t) => mean(sphereCosts(lines, data.radii, [t, 0, 0], p))));
  const look = { y: { range: [1e-2, 1e6], log: true, label: "mean |error|" }, width: 310, height: 330 };
  const plates = [
    { range: [8, 1250], label: "distance of the centres (mm)" },
    { range: [25, 1250], label: "points on each sphere" },
  ].map((x) => figure.plot({ name: `mean error over the ${x.label}`, x: { ...x, log: true }, ...look }));
  let random = generator(state.seed);
  let rounds = 0;
  let errors = [];

  // Errors of one draw, for each p, number of points and distance. Smaller samples are the first points of the largest.
  function step() {
    const [x, y] = data.radii.map((radius) =>
      sphereDirections(SIZES.at(-1), 3, random).map((point) => point.map((value) => radius * value)),
    );
    SIZES.forEach((m, k) => {
      const sums = POWERS.map(() => APART.map(() => 0));
      for (const line of lines) {
        const [u, v] = [x, y].map((points) => project(points.slice(0, m), line).sort());
        // Moving the second sphere adds the same number to all differences, and leaves the order.
        const gaps = v.map((value, r) => value - u[r]);
        const between = state.centred ? -mean(gaps) : 0;
        APART.forEach((apart, t) => {
          const move = state.centred ? between : apart * line[0];
          for (const gap of gaps) {
            const d = Math.abs(gap + move);
            sums[0][t] += d;
            sums[1][t] += d * d;
            sums[2][t] += d * d * d;
          }
        });
      }
      sums.forEach((row, i) =>
        row.forEach((sum, t) => {
          const truth = truths[i][state.centred ? 0 : t + 1];
          errors[i][k][t] += Math.abs(sum / m / lines.length - truth);
        }),
      );
    });
    rounds += 1;
    return rounds < data.rounds;
  }
  function again() {
    random = generator(state.seed);
    rounds = 0;
    errors = POWERS.map(() => SIZES.map(() => APART.map(() => 0)));
    for (let k = 0; k < AT_FIRST; k += 1) {
      step();
    }
  }
  // With `shown`: divided by the loss of the spheres at that distance, or not.
  function errorOf(i, k, t) {
    const value = errors[i][k][t] / rounds;
    return state.shown === "relative" ? value / truths[i][state.centred ? 0 : t + 1] : value;
  }
  function draw() {
    const rows = POWERS.map((_, i) => [
      APART.map((apart, t) => [apart, errorOf(i, state.size, t)]),
      SIZES.map((m, k) => [m, errorOf(i, k, state.apart)]),
    ]);
    const all = rows.flat(2).map(([, value]) => value);
    plates.forEach((plate, side) => {
      plate.rescale([0.5 * Math.min(...all), 3 * Math.max(...all)]);
      rows.forEach((curves, i) => {
        plate.curve(curves[side], { colour: COLOUR[i], width: 2.5, dash: ["", "9 4", "3 3"][i] });
        plate.dots(curves[side], { colour: COLOUR[i], size: 8 });
        const [at, value] = curves[side][1];
        plate.text([at, value * 1.4], `p = ${POWERS[i]}`, { fill: COLOUR[i], "text-anchor": "middle" });
      });
    });
    const slopes = rows.map(([far, many]) => [steepness(far.at(-3), far.at(-1)), steepness(many[0], many.at(-1))]);
    const list = (side) => slopes.map((pair) => exponent(pair[side])).join(", ");
    const kind = state.shown === "relative" ? "relative error" : "error";
    const status =
      `${rounds} draws; for p = 1, 2, 3. From 100 to 1000 mm, the mean ${kind} of ${SIZES[state.size]} points changes as ` +
      `distance^(${list(0)}). At ${APART[state.apart]} mm, it falls with the number of points as m^(${list(1)}).`;
    const values = { rounds };
    POWERS.forEach((p, i) => {
      values[`far${p}`] = slopes[i][0];
      values[`many${p}`] = slopes[i][1];
      values[`error${p}`] = errorOf(i, state.size, state.apart);
    });
    return { status, values };
  }
  figure.run({
    draw,
    play: { step, perSecond: 8 },
    changed: (key) => ["apart", "size", "shown"].includes(key) || again(),
    controls: [
      { kind: "choice", key: "apart", label: "Distance", options: APART.map((apart, t) => [t, `${apart} mm`]) },
      { kind: "choice", key: "size", label: "Points", options: SIZES.map((m, k) => [k, `${m}`]) },
      {
        kind: "choice",
        key: "shown",
        label: "Show",
        options: [
          ["error", "error (mm^p)"],
          ["relative", "error divided by the loss"],
        ],
      },
      { kind: "check", key: "centred", label: "move both samples to mean zero" },
      { kind: "button", label: "other samples", press: () => (state.seed += 1) },
    ],
  });
}

function mean(values) {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

function exponent(value) {
  return (Math.abs(value) < 0.005 ? 0 : value).toFixed(2).replace("-", "−");
}

/**
 * Of a line through two points, on logarithmic axes.
 * @param {number[]} one
 * @param {number[]} other
 */
function steepness([x, y], [u, v]) {
  return Math.log(v / y) / Math.log(u / x);
}
