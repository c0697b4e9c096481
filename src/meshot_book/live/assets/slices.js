// Slices that are chosen by their cost: energy-based weights, and the ascent to the direction of largest cost (p = 2).
import { project, slicedLoss } from "./projection.js";
import { linePlan } from "./transport.js";

/** @typedef {number[][]} Points rows of coordinates */

/**
 * Energy-based slicing with f(c) = c^α: the weighted mean of the costs, and its gradient in the source.
 * @param {Points} source
 * @param {Points} target
 * @param {number[][]} directions
 * @param {number} power α ≥ 0
 * @returns {{cost: number, costs: number[], weights: number[], factors: number[], gradient: Points}} with the factor of
 *   each slice in the gradient: where it is negative, a descent raises the cost of the slice
 */
export function energySlicedLoss(source, target, directions, power) {
  const slices = directions.map((direction) => slicedLoss(source, target, [direction]));
  const costs = slices.map(({ cost }) => cost);
  // Relative to the largest, so that no power overflows.
  const most = Math.max(...costs) || 1;
  const energies = costs.map((cost) => (cost / most) ** power);
  const sum = energies.reduce((all, energy) => all + energy, 0);
  const weights = energies.map((energy) => (sum > 0 ? energy / sum : 1 / costs.length));
  const cost = weights.reduce((all, weight, l) => all + weight * costs[l], 0);
  const factors = weights.map(
    (weight, l) =>
      (1 + power) * weight - (power && sum ? (power * cost * (costs[l] / most) ** (power - 1)) / most / sum : 0),
  );
  const gradient = source.map((point, i) =>
    point.map((_, k) => slices.reduce((all, slice, l) => all + factors[l] * slice.gradient[i][k], 0)),
  );
  return { cost, costs, weights, factors, gradient };
}

/**
 * An ascent of the cost over the directions that has not moved yet.
 * @param {Points} source
 * @param {Points} target
 * @param {number[]} line a unit vector
 */
export function ascent(source, target, line) {
  return { line, ...costAndSlope(source, target, line), scale: 1, steps: 0, over: false };
}

/**
 * The ascent one step later: along the great circle to the slope, shorter where the cost would not grow.
 * @param {Points} source
 * @param {Points} target
 * @param {ReturnType<typeof ascent>} before
 * @returns {ReturnType<typeof ascent>}
 */
export function climb(source, target, before) {
  const { line, cost, slope, scale, steps } = before;
  const along = dot(slope, line);
  const tangent = slope.map((value, k) => value - along * line[k]);
  const size = Math.hypot(...tangent);
  if (size <= 1e-14 * cost || scale < 1e-9) {
    return { ...before, over: true };
  }
  const angle = Math.min(scale * Math.atan2(size, along), Math.PI / 2);
  const raw = line.map((value, k) => Math.cos(angle) * value + (Math.sin(angle) / size) * tangent[k]);
  const further = raw.map((value) => value / Math.hypot(...raw));
  const found = costAndSlope(source, target, further);
  return found.cost > cost
    ? { line: further, ...found, scale: 2 * scale, steps: steps + 1, over: false }
    : { ...before, scale: scale / 4, steps: steps + 1 };
}

function costAndSlope(source, target, line) {
  const [a, b] = [source, target].map((points) => points.map(() => 1 / points.length));
  const [x, y] = [source, target].map((points) => project(points, line));
  let cost = 0;
  const slope = line.map(() => 0);
  for (const [i, j, mass] of linePlan(x, a, y, b)) {
    const gap = x[i] - y[j];
    cost += mass * gap * gap;
    slope.forEach((_, k) => (slope[k] += 2 * mass * gap * (source[i][k] - target[j][k])));
  }
  return { cost, slope };
}

function dot(one, other) {
  return one.reduce((sum, value, k) => sum + value * other[k], 0);
}
