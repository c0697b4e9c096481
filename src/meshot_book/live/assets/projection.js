// Clouds projected on lines: directions, the transport cost on each line, and the sliced loss with its gradient.
import { normal } from "./random.js";
import { couple, orderOf } from "./transport.js";

/** @typedef {number[][]} Points rows of coordinates */
/** @typedef {"random" | "equally spaced" | "orthogonal" | "low-discrepancy"} Kind of directions of the plane */
/** @typedef {{angle: number, first: Int32Array, second: Int32Array}} SortedLine the orders of both sides along a line */

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
 * @param {Kind} kind independent; equal angles from a random
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
 * @param {object} [options]
 * @param {number} [options.p]
 * @param {ArrayLike<number>} [options.a] masses of the source, equal if left out
 * @param {ArrayLike<number>} [options.b] masses of the target
 * @param {{lines?: SortedLine[]}} [options.memory] in the plane: an object that is handed over from frame to frame keeps
 *   the orders, which saves most of the sorting where points move little. It changes no value.
 * @returns {{cost: number, costs: Float64Array, gradient: Points}} with the cost on each line
 */
export function slicedLoss(source, target, directions, { p = 2, a, b, memory = {} } = {}) {
  const n = source.length;
  const weights = [a ?? new Float64Array(n).fill(1 / n), b ?? new Float64Array(target.length).fill(1 / target.length)];
  const byRank = !a && !b && n === target.length;
  const costs = new Float64Array(directions.length);
  const d = directions[0]?.length ?? 0;
  const [from, to] = [columnsOf(source, d), columnsOf(target, d)];
  const sums = from.map(() => new Float64Array(n));
  const [x, y, slopes] = [n, target.length, n].map((length) => new Float64Array(length));
  let cost = 0;
  const add = (/** @type {number} */ i, /** @type {number} */ j, /** @type {number} */ mass) => {
    const gap = x[i] - y[j];
    const steep = mass * (p === 2 ? Math.abs(gap) : Math.abs(gap) ** (p - 1));
    cost += steep * Math.abs(gap);
    slopes[i] += p * Math.sign(gap) * steep;
  };
  const known = memory.lines ?? [];
  memory.lines = [];
  let [at, near] = [0, undefined];
  for (const { l, angle } of byAngle(directions)) {
    projectColumns(from, directions[l], x);
    projectColumns(to, directions[l], y);
    // The best order to begin with is that of the line at the nearest angle, in this frame or in the one before.
    const away = (/** @type {SortedLine | undefined} */ line) => (line ? Math.abs(line.angle - angle) : Infinity);
    while (at + 1 < known.length && away(known[at + 1]) <= away(known[at])) {
      at += 1;
    }
    near = away(known[at]) < away(near) ? known[at] : near;
    const [first, second] = [orderOf(x, near?.first), orderOf(y, near?.second)];
    if (d === 2) {
      near = { angle, first, second };
      memory.lines.push(near);
    }
    cost = 0;
    slopes.fill(0);
    if (byRank) {
      for (let r = 0; r < n; r += 1) {
        add(first[r], second[r], 1 / n);
      }
    } else {
      couple(first, weights[0], second, weights[1]).forEach(([i, j, mass]) => add(i, j, mass));
    }
    costs[l] = cost;
    sums.forEach((sum, k) => {
      const share = directions[l][k] / directions.length;
      for (let i = 0; i < n; i += 1) {
        sum[i] += slopes[i] * share;
      }
    });
  }
  const mean = costs.reduce((sum, value) => sum + value, 0) / directions.length;
  return { cost: mean, costs, gradient: source.map((_, i) => sums.map((sum) => sum[i])) };
}

// Coordinate by coordinate: arrays of numbers are read four times faster than rows.
function columnsOf(points, d) {
  return Array.from({ length: d }, (_, k) => Float64Array.from(points, (point) => point[k]));
}

function projectColumns(columns, direction, into) {
  into.fill(0);
  columns.forEach((column, k) => {
    for (let i = 0; i < into.length; i += 1) {
      into[i] += column[i] * direction[k];
    }
  });
}

// In the plane the lines are visited by their angle.
function byAngle(directions) {
  const lines = directions.map(([u, v], l) => ({ l, angle: directions[l].length === 2 ? Math.atan2(v, u) : 0 }));
  return lines.sort((one, other) => one.angle - other.angle);
}
