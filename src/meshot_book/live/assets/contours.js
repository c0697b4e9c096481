// Closed contours as measures: edges are supports at their middles, with masses proportional to their lengths.
import { chamferLoss } from "./nearest.js";
import { project } from "./projection.js";
import { couple, orderOf } from "./transport.js";

/** @typedef {number[][]} Points vertices of a closed contour, in order */

/**
 * The middles of the edges, their lengths and masses. Edge i leads from vertex i to the next one.
 * @param {Points} vertices
 */
export function edgesOf(vertices) {
  const ends = vertices.map((_, i) => vertices[(i + 1) % vertices.length]);
  const lengths = vertices.map(([x, y], i) => Math.hypot(ends[i][0] - x, ends[i][1] - y));
  const total = lengths.reduce((sum, length) => sum + length, 0);
  const points = vertices.map(([x, y], i) => [(x + ends[i][0]) / 2, (y + ends[i][1]) / 2]);
  return { points, lengths, total, masses: lengths.map((length) => length / total) };
}

/** The standard deviation of the edge lengths over their mean. */
export function edgeVariation(vertices) {
  const { lengths, total } = edgesOf(vertices);
  const mean = total / lengths.length;
  return Math.sqrt(lengths.reduce((sum, length) => sum + (length - mean) ** 2, 0) / lengths.length) / mean;
}

const SAMPLES = 160; // on each contour, at least

/**
 * The mean distance between two contours: of points at equal distances on each edge from the other contour, both ways.
 * @param {Points} one
 * @param {Points} other
 */
export function contourDistance(one, other) {
  return (meanAway(one, other) + meanAway(other, one)) / 2;
}

function meanAway(from, to) {
  const perEdge = Math.ceil(SAMPLES / from.length);
  let sum = 0;
  for (let i = 0; i < from.length; i += 1) {
    const [start, end] = [from[i], from[(i + 1) % from.length]];
    for (let k = 0; k < perEdge; k += 1) {
      const share = (k + 0.5) / perEdge;
      sum += toContour((1 - share) * start[0] + share * end[0], (1 - share) * start[1] + share * end[1], to);
    }
  }
  return sum / (perEdge * from.length);
}

function toContour(x, y, vertices) {
  let least = Infinity;
  let before = vertices[vertices.length - 1];
  for (const vertex of vertices) {
    const u = vertex[0] - before[0];
    const v = vertex[1] - before[1];
    const a = x - before[0];
    const b = y - before[1];
    const share = Math.min(1, Math.max(0, (a * u + b * v) / (u * u + v * v)));
    least = Math.min(least, (a - share * u) ** 2 + (b - share * v) ** 2);
    before = vertex;
  }
  return Math.sqrt(least);
}

/**
 * Chamfer between the edges of two contours, or their sliced loss with p = 2, and its gradient in the vertices: both
 * the middles and the masses of edges depend on them.
 * @param {"Chamfer" | "sliced Wasserstein"} kind
 * @param {Points} vertices
 * @param {{points: number[][], masses: number[]}} target
 * @param {number[][]} directions
 */
export function contourLoss(kind, vertices, target, directions) {
  const edges = edgesOf(vertices);
  const { cost, gradient, slopes } =
    kind === "Chamfer" ? chamferSlopes(edges, target) : slicedSlopes(edges, target, directions);
  const mean = edges.masses.reduce((sum, mass, i) => sum + mass * slopes[i], 0);
  const found = vertices.map(() => [0, 0]);
  vertices.forEach((vertex, i) => {
    const j = (i + 1) % vertices.length;
    const steep = (slopes[i] - mean) / edges.total; // the derivative in the length of the edge
    for (const c of [0, 1]) {
      const along = (vertices[j][c] - vertex[c]) / edges.lengths[i];
      found[i][c] += gradient[i][c] / 2 - steep * along;
      found[j][c] += gradient[i][c] / 2 + steep * along;
    }
  });
  return { cost, gradient: found };
}

function chamferSlopes({ points, masses }, target) {
  const { cost, gradient, chosen } = chamferLoss(points, target.points, masses, target.masses);
  const slopes = points.map((p, i) => target.points[chosen[i]].reduce((sum, value, c) => sum + (p[c] - value) ** 2, 0));
  return { cost, gradient, slopes };
}

// The derivative in the masses on a line is the potential: along the sorted plan, φ(x) + ψ(y) is the cost of each pair.
function slicedSlopes({ points, masses }, target, directions) {
  const slopes = new Float64Array(points.length);
  const gradient = points.map(() => [0, 0]);
  let cost = 0;
  for (const direction of directions) {
    const x = project(points, direction);
    const y = project(target.points, direction);
    const plan = couple(orderOf(x), masses, orderOf(y), target.masses);
    const potential = new Float64Array(points.length);
    let [i, j, other] = [plan[0][0], -1, 0];
    for (const [k, l, mass] of plan) {
      if (k !== i && j >= 0) {
        potential[k] = (x[k] - y[j]) ** 2 - other;
      }
      if (l !== j) {
        other = (x[k] - y[l]) ** 2 - potential[k];
      }
      [i, j] = [k, l];
      const gap = x[k] - y[l];
      cost += (mass * gap * gap) / directions.length;
      gradient[k].forEach((_, c) => (gradient[k][c] += (2 * mass * gap * direction[c]) / directions.length));
    }
    potential.forEach((value, k) => (slopes[k] += value / directions.length));
  }
  return { cost, gradient, slopes };
}

/**
 * Directions of descent: minus half of the gradient per mass of a vertex, averaged over neighbours by a Gaussian whose
 * standard deviation is so many edges.
 * @param {Points} vertices
 * @param {Points} gradient
 * @param {number} width 0: no averaging
 */
export function descentDirections(vertices, gradient, width) {
  const { masses } = edgesOf(vertices);
  const n = vertices.length;
  const own = gradient.map((g, i) => g.map((value) => -value / (masses[i] + masses[(i + n - 1) % n])));
  if (width === 0) {
    return own;
  }
  const weights = own.map((_, k) => Math.exp(-(Math.min(k, n - k) ** 2) / (2 * width * width)));
  const sum = weights.reduce((all, weight) => all + weight, 0);
  return own.map((_, i) =>
    [0, 1].map((c) => weights.reduce((all, weight, k) => all + (weight / sum) * own[(i + k) % n][c], 0)),
  );
}
