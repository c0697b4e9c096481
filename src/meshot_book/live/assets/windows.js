// The sliced loss in windows: Gaussian weights around centres, cut off, and the masses in each window sum to one.
import { slicedLoss } from "./projection.js";

const REACH = 2.5; // radii at which a window ends

/**
 * The mean of the sliced losses in all windows that hold mass of both sides, and its gradient in the source, in which
 * the weights of the windows are constant.
 * @param {{points: number[][], masses: number[]}} source
 * @param {{points: number[][], masses: number[]}} target
 * @param {number[][]} centres
 * @param {number} radius
 * @param {number[][]} directions
 * @param {number} p
 * @returns {{cost: number, gradient: number[][], counted: number}} with the number of windows; a cost of NaN if none
 */
export function windowedLoss(source, target, centres, radius, directions, p) {
  const gradient = source.points.map((point) => point.map(() => 0));
  let [cost, counted] = [0, 0];
  for (const centre of centres) {
    const [here, there] = [source, target].map((side) => windowOf(side, centre, radius));
    if (here.index.length && there.index.length) {
      const found = slicedLoss(here.points, there.points, directions, { p, a: here.masses, b: there.masses });
      here.index.forEach((i, k) => found.gradient[k].forEach((value, c) => (gradient[i][c] += value)));
      cost += found.cost;
      counted += 1;
    }
  }
  gradient.forEach((row) => row.forEach((value, c) => (row[c] = counted ? value / counted : 0)));
  return { cost: cost / counted, gradient, counted };
}

function windowOf({ points, masses }, centre, radius) {
  const squares = points.map((point) => point.reduce((sum, value, c) => sum + (value - centre[c]) ** 2, 0));
  const index = [...points.keys()].filter((i) => squares[i] < (REACH * radius) ** 2 && masses[i] > 0);
  const weights = index.map((i) => masses[i] * Math.exp(-squares[i] / (2 * radius * radius)));
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  return { index, points: index.map((i) => points[i]), masses: weights.map((weight) => weight / total) };
}

/**
 * The cosine between two fields, weighted by masses: 1 if they have the same directions and proportional lengths.
 * @param {number[][]} field
 * @param {number[][]} other
 * @param {number[]} masses
 */
export function fieldCosine(field, other, masses) {
  const product = (one, two) =>
    one.reduce((sum, u, i) => sum + masses[i] * u.reduce((all, value, c) => all + value * two[i][c], 0), 0);
  const lengths = Math.sqrt(product(field, field) * product(other, other));
  return lengths > 0 ? product(field, other) / lengths : 0;
}
