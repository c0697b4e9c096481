// Clouds projected on lines: directions, the transport cost on each line, and the sliced loss with its gradient.
import { normal } from "./random.js";
import { couple, orderOf } from "./transport.js";

/** @typedef {number[][]} Points rows of coordinates */

const GOLDEN = (Math.sqrt(5) - 1) / 2;

/**
 * Position of every point along a direction.
 * @param {Points} points
 * @param {number[]} direction
 */
export function project(points, direction) {
  const values = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 1) {
    for (let k = 0; k < direction.length; k += 1) {
      values[i] += points[i][k] * direction[k];
    }
  }
  return values;
}

/** The unit vector of the plane at an angle in radians. */
export function atAngle(radians) {
  return [Math.cos(radians), Math.sin(radians)];
}

/**
 * Directions of the plane.
 * @param {"random" | "equally spaced" | "orthogonal" | "low-discrepancy"} kind independent; equal angles from a random
 *   first one; random pairs at right angles; steps of the golden angle from a random first one, which stay even when more
 *   are added
 * @param {number} count
 * @param {() => number} random
 */
export function planeDirections(kind, count, random) {
  if (kind === "equally spaced") {
    const first = random();
    return Array.from({ length: count }, (_, l) => atAngle((Math.PI * (l + first)) / count));
  }
  if (kind === "low-discrepancy") {
    const first = random();
    return Array.from({ length: count }, (_, l) => atAngle(Math.PI * ((first + l * GOLDEN) % 1)));
  }
  const angles = [];
  while (angles.length < count) {
    const angle = Math.PI * random();
    angles.push(angle, ...(kind === "orthogonal" ? [angle + Math.PI / 2] : []));
  }
  return angles.slice(0, count).map(atAngle);
}

/**
 * Independent directions, uniform on the sphere of R^d.
 * @param {number} count
 * @param {number} d
 * @param {() => number} random
 */
export function sphereDirections(count, d, random) {
  return Array.from({ length: count }, () => {
    const vector = Array.from({ length: d }, () => normal(random));
    const length = Math.hypot(...vector);
    return vector.map((value) => value / length);
  });
}

/**
 * Directions of space on the Fibonacci spiral, turned by a random rotation: equal areas, and the golden angle between
 * neighbours.
 * @param {number} count
 * @param {() => number} random
 */
export function spiralDirections(count, random) {
  const [u, v] = sphereDirections(2, 3, random);
  const along = u.reduce((sum, value, k) => sum + value * v[k], 0);
  const rest = v.map((value, k) => value - along * u[k]);
  const side = rest.map((value) => value / Math.hypot(...rest));
  const up = [0, 1, 2].map((k) => u[(k + 1) % 3] * side[(k + 2) % 3] - u[(k + 2) % 3] * side[(k + 1) % 3]);
  return Array.from({ length: count }, (_, l) => {
    const height = 1 - (2 * l + 1) / count;
    const angle = 2 * Math.PI * (1 + GOLDEN) * (l + 0.5);
    const radius = Math.sqrt(1 - height ** 2);
    const [c, s] = [radius * Math.cos(angle), radius * Math.sin(angle)];
    return [0, 1, 2].map((k) => c * u[k] + s * side[k] + height * up[k]);
  });
}

/**
 * The sliced loss: the mean over directions of the transport cost W_p^p on the line, and its gradient in the source.
 * @param {Points} source
 * @param {Points} target
 * @param {number[][]} directions
 * @param {{p?: number, a?: number[], b?: number[]}} [options] masses are equal if left out
 * @returns {{cost: number, costs: Float64Array, gradient: Points}} with the cost on each line
 */
export function slicedLoss(source, target, directions, { p = 2, a, b } = {}) {
  const n = source.length;
  const weights = [a ?? new Float64Array(n).fill(1 / n), b ?? new Float64Array(target.length).fill(1 / target.length)];
  const byRank = !a && !b && n === target.length;
  const costs = new Float64Array(directions.length);
  const gradient = source.map((point) => point.map(() => 0));
  // In the plane the lines are visited by their angle: along neighbours, points stand in nearly the same order.
  const inPlane = directions[0]?.length === 2;
  let [first, second] = [undefined, undefined];
  for (const l of inPlane ? byAngle(directions) : directions.keys()) {
    const direction = directions[l];
    const x = project(source, direction);
    const y = project(target, direction);
    const slopes = new Float64Array(n);
    const add = (i, j, mass) => {
      const gap = x[i] - y[j];
      const steep = mass * (p === 2 ? Math.abs(gap) : Math.abs(gap) ** (p - 1));
      costs[l] += steep * Math.abs(gap);
      slopes[i] += p * Math.sign(gap) * steep;
    };
    [first, second] = inPlane ? [orderOf(x, first), orderOf(y, second)] : [orderOf(x), orderOf(y)];
    if (byRank) {
      for (let r = 0; r < n; r += 1) {
        add(first[r], second[r], 1 / n);
      }
    } else {
      couple(first, weights[0], second, weights[1]).forEach(([i, j, mass]) => add(i, j, mass));
    }
    for (let i = 0; i < n; i += 1) {
      for (let k = 0; k < direction.length; k += 1) {
        gradient[i][k] += (slopes[i] * direction[k]) / directions.length;
      }
    }
  }
  const cost = costs.reduce((sum, value) => sum + value, 0) / directions.length;
  return { cost, costs, gradient };
}

function byAngle(directions) {
  const angles = directions.map(([u, v]) => Math.atan2(v, u));
  return [...directions.keys()].sort((l, k) => angles[l] - angles[k]);
}
