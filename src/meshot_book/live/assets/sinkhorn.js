// Entropic transport by Sinkhorn's iteration in the logarithmic domain.
import { groundCosts } from "./assignment.js";

/** @typedef {number[][]} Points rows of coordinates */

/**
 * The entropic plan, and the cost with its entropy: the minimum of ⟨C, π⟩ + ε KL(π | a ⊗ b).
 * @param {number[][]} costs C, n rows of m numbers
 * @param {number[]} a masses of the rows
 * @param {number[]} b masses of the columns, with the same sum
 * @param {number} epsilon ε > 0, in the unit of the costs
 * @param {{steps?: number, tolerance?: number, start?: number[]}} [options] it ends after so many steps, or when no
 *   potential changes by more than the tolerance times ε; start: potential of the columns, near the right one
 * @returns {{cost: number, plan: number[][], potential: number[], steps: number}}
 */
export function entropicTransport(costs, a, b, epsilon, { steps = 10000, tolerance = 1e-13, start } = {}) {
  const [logA, logB] = [a, b].map((masses) => masses.map(Math.log));
  const f = a.map(() => 0);
  const g = start ? [...start] : b.map(() => 0);
  const across = b.map((_, j) => costs.map((row) => row[j]));
  let taken = 0;
  for (let change = Infinity; taken < steps && change > tolerance; taken += 1) {
    change = 0;
    costs.forEach((row, i) => {
      f[i] = softMinimum(row, g, logB, epsilon);
    });
    across.forEach((column, j) => {
      const next = softMinimum(column, f, logA, epsilon);
      if (b[j] > 0) {
        change = Math.max(change, Math.abs(next - g[j]) / epsilon);
      }
      g[j] = next;
    });
  }
  const plan = costs.map((row, i) => row.map((c, j) => a[i] * b[j] * Math.exp((f[i] + g[j] - c) / epsilon)));
  const cost = inner(f, a) + inner(g, b);
  return { cost, plan, potential: g, steps: taken };
}

/**
 * The debiased divergence of two measures of points: S = OT_ε(μ, ν) − ½ OT_ε(μ, μ) − ½ OT_ε(ν, ν), with the cost
 * ‖x − y‖^p and ε = p · blur^p, as GeomLoss defines the blur.
 * @param {Points} source
 * @param {number[]} a
 * @param {Points} target
 * @param {number[]} b
 * @param {{p?: number, blur: number, steps?: number}} options
 */
export function sinkhornDivergence(source, a, target, b, { p = 2, blur, steps }) {
  const between = (x, s, y, t) => entropicTransport(groundCosts(x, y, p), s, t, p * blur ** p, { steps }).cost;
  return between(source, a, target, b) - (between(source, a, source, a) + between(target, b, target, b)) / 2;
}

/**
 * The debiased divergence for p = 2 between points of equal mass, and its gradient in the source.
 * @param {Points} source
 * @param {Points} target
 * @param {{blur: number, tolerance?: number, starts?: number[][]}} options starts: potentials of a similar problem
 * @returns {{cost: number, gradient: Points, potentials: number[][]}}
 */
export function sinkhornLoss(source, target, { blur, tolerance = 1e-13, starts = [] }) {
  const pairs = [
    [source, target],
    [source, source],
    [target, target],
  ];
  const [across, here, there] = pairs.map(([x, y], k) => {
    const [a, b] = [x, y].map((points) => points.map(() => 1 / points.length));
    const costs = groundCosts(x, y, 2);
    let start = starts[k];
    // Without a start, a large blur gives one: few iterations suffice for it.
    for (let wide = start ? 0 : 16 * blur; wide > blur; wide /= 2) {
      start = entropicTransport(costs, a, b, 2 * wide ** 2, { steps: 20, tolerance: 1e-3, start }).potential;
    }
    return entropicTransport(costs, a, b, 2 * blur ** 2, { tolerance, start });
  });
  // The mean of the partners in the plan to the target, minus that in the plan of the source to itself.
  const gradient = source.map((point, i) =>
    point.map((_, k) => 2 * (weightedSum(here.plan[i], source, k) - weightedSum(across.plan[i], target, k))),
  );
  const cost = across.cost - (here.cost + there.cost) / 2;
  return { cost, gradient, potentials: [across, here, there].map(({ potential }) => potential) };
}

function weightedSum(masses, points, k) {
  return masses.reduce((sum, mass, j) => sum + mass * points[j][k], 0);
}

// −ε log Σ exp((g − c)/ε + log b): terms of points without mass are zero.
function softMinimum(costs, potential, logMasses, epsilon) {
  let most = -Infinity;
  for (let j = 0; j < costs.length; j += 1) {
    most = Math.max(most, (potential[j] - costs[j]) / epsilon + logMasses[j]);
  }
  let sum = 0;
  for (let j = 0; j < costs.length; j += 1) {
    sum += Math.exp((potential[j] - costs[j]) / epsilon + logMasses[j] - most);
  }
  return -epsilon * (most + Math.log(sum));
}

function inner(potential, masses) {
  return potential.reduce((sum, value, i) => (masses[i] > 0 ? sum + masses[i] * value : sum), 0);
}
