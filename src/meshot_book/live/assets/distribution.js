// The exact distribution of a contour or a triangle mesh along a direction, and the transport cost between two of them.
import { project } from "./projection.js";

/** @typedef {number[][]} Points rows of coordinates */
/**
 * @typedef {object} Part of a distribution on a line, from left to right
 * @property {number} from
 * @property {number} to equal to `from` for an atom
 * @property {number} mass
 * @property {number} tilt the density runs from (1 − tilt) to (1 + tilt) times its mean; between −1 and 1
 */

const MOST_TERMS = 200; // of a Legendre series whose terms fall at least as n⁻⁵: the rest is below 2e-11 of the sum

/**
 * The distribution of ⟨θ, X⟩ for X uniform on the cells: segments of a contour (two indices), or triangles (three).
 * The density of a segment is constant and that of a triangle a tent. A cell perpendicular to θ is an atom.
 * @param {Points} vertices
 * @param {number[][]} cells
 * @param {number[]} direction θ, a unit vector
 * @returns {Part[]} with masses that sum to one
 */
export function projectedDistribution(vertices, cells, direction) {
  const values = project(vertices, direction);
  const sizes = cells.map((cell) => measureOf(cell.map((v) => vertices[v])));
  const total = sizes.reduce((sum, size) => sum + size, 0);
  const used = new Set(cells.flat());
  const places = Float64Array.from(new Set(Array.from(used, (v) => values[v]))).sort();
  const rank = new Map(Array.from(places, (place, k) => [place, k]));
  const [starts, ends, atoms] = Array.from({ length: 3 }, () => new Float64Array(places.length));
  cells.forEach((cell, f) => {
    const corners = cell.map((v) => values[v]).sort((x, y) => x - y);
    const [low, high] = [corners[0], corners[corners.length - 1]];
    const mass = sizes[f] / total;
    if (low === high) {
      atoms[rank.get(low)] += mass;
      return;
    }
    // All terms are positive, so that nothing cancels where a cell is nearly perpendicular.
    for (let k = rank.get(low); places[k] < high; k += 1) {
      starts[k] += mass * densityAt(places[k], places[k], places[k + 1], corners);
      ends[k] += mass * densityAt(places[k + 1], places[k], places[k + 1], corners);
    }
  });
  const parts = [];
  places.forEach((from, k) => {
    if (atoms[k] > 0) {
      parts.push({ from, to: from, mass: atoms[k], tilt: 0 });
    }
    const sum = starts[k] + ends[k];
    if (sum > 0) {
      const to = places[k + 1];
      parts.push({ from, to, mass: (sum * (to - from)) / 2, tilt: (ends[k] - starts[k]) / sum });
    }
  });
  const sum = parts.reduce((all, { mass }) => all + mass, 0);
  return parts.map((part) => ({ ...part, mass: part.mass / sum }));
}

/**
 * Length of a segment or area of a triangle, in any dimension.
 * @param {Points} corners
 */
function measureOf([a, b, c]) {
  const [u, v] = [b, c ?? a].map((corner) => corner.map((value, k) => value - a[k]));
  const [uu, uv, vv] = [scalarProduct(u, u), scalarProduct(u, v), scalarProduct(v, v)];
  return c ? Math.sqrt(Math.max(0, uu * vv - uv ** 2)) / 2 : Math.sqrt(uu);
}

function scalarProduct(u, v) {
  return u.reduce((sum, value, k) => sum + value * v[k], 0);
}

// The density of one cell of mass one at x, an end of an interval within which it is linear.
function densityAt(x, left, right, corners) {
  const [low, middle] = corners;
  const high = corners[corners.length - 1];
  if (corners.length === 2) {
    return 1 / (high - low);
  }
  const peak = 2 / (high - low);
  return right <= middle ? (peak * (x - low)) / (middle - low) : (peak * (high - x)) / (high - middle);
}

/**
 * The distribution function: the mass at or to the left of x.
 * @param {Part[]} parts
 * @param {number} x
 */
export function massUpTo(parts, x) {
  let sum = 0;
  for (const { from, to, mass, tilt } of parts) {
    if (from > x) {
      break;
    }
    const share = to > x ? (x - from) / (to - from) : 1;
    sum += mass * share * (1 - tilt + tilt * share);
  }
  return Math.min(1, sum);
}

/**
 * The density at x, without atoms.
 * @param {Part[]} parts
 * @param {number} x
 */
export function density(parts, x) {
  const part = parts.find(({ from, to }) => from <= x && x < to);
  if (!part) {
    return 0;
  }
  const { from, to, mass, tilt } = part;
  return (mass / (to - from)) * (1 - tilt + (2 * tilt * (x - from)) / (to - from));
}

/**
 * The transport cost W_p^p between two distributions, p = 1 or 2, without sampling.
 * @param {Part[]} source
 * @param {Part[]} target
 * @param {1 | 2} p
 */
export function distributionCost(source, target, p) {
  if (p !== 1 && p !== 2) {
    throw new RangeError(`p is ${p}: it must be 1 or 2`);
  }
  return p === 1 ? areaBetween(source, target) : squaredGap(source, target);
}

/**
 * The exact sliced loss of two contours or meshes: the mean of the costs over directions.
 * @param {{vertices: Points, cells: number[][]}} source
 * @param {{vertices: Points, cells: number[][]}} target
 * @param {number[][]} directions
 * @param {1 | 2} [p]
 * @returns {{cost: number, costs: number[]}} with the cost on each line
 */
export function exactSlicedLoss(source, target, directions, p = 2) {
  const costs = directions.map((direction) => {
    const [one, other] = [source, target].map((side) => projectedDistribution(side.vertices, side.cells, direction));
    return distributionCost(one, other, p);
  });
  return { cost: costs.reduce((sum, cost) => sum + cost, 0) / costs.length, costs };
}

// ∫ |F − G|: between neighbouring ends of parts, the difference is quadratic and changes its sign at its roots.
function areaBetween(source, target) {
  const sides = [source, target];
  const places = Float64Array.from(
    new Set(sides.flatMap((parts) => parts.flatMap(({ from, to }) => [from, to]))),
  ).sort();
  const at = [0, 0];
  const below = [0, 0];
  let sum = 0;
  for (let k = 0; k + 1 < places.length; k += 1) {
    const [left, right] = [places[k], places[k + 1]];
    const width = right - left;
    const c = [0, 0, 0]; // of the difference at left + width · t, by powers of t
    sides.forEach((parts, s) => {
      const sign = s ? -1 : 1;
      while (at[s] < parts.length && parts[at[s]].to <= left) {
        below[s] += parts[at[s]].mass;
        at[s] += 1;
      }
      c[0] += sign * below[s];
      const part = parts[at[s]];
      if (part && part.from <= left) {
        const { from, to, mass, tilt } = part;
        const [start, step] = [(left - from) / (to - from), width / (to - from)];
        c[0] += sign * mass * start * (1 - tilt + tilt * start);
        c[1] += sign * mass * step * (1 - tilt + 2 * tilt * start);
        c[2] += sign * mass * step * step * tilt;
      }
    });
    const cuts = [0, ...rootsOf(c).filter((t) => t > 0 && t < 1), 1];
    for (let i = 0; i + 1 < cuts.length; i += 1) {
      const [s, t] = [cuts[i], cuts[i + 1]];
      const whole = (t - s) * (c[0] + (c[1] * (s + t)) / 2 + (c[2] * (s * s + s * t + t * t)) / 3);
      sum += width * Math.abs(whole);
    }
  }
  return sum;
}

/**
 * The roots of c + b t + a t², in increasing order.
 * @param {number[]} coefficients
 */
function rootsOf([c, b, a]) {
  const under = b * b - 4 * a * c;
  if (under < 0) {
    return [];
  }
  const q = -(b + (b < 0 ? -1 : 1) * Math.sqrt(under)) / 2;
  return [q / a, c / q].filter(Number.isFinite).sort((s, t) => s - t);
}

// ∫ (F⁻¹ − G⁻¹)²: where both quantile functions are smooth, they are expanded in Legendre polynomials of the mass, so that
// the integral is a sum of squares and nothing cancels.
function squaredGap(source, target) {
  const sides = [source, target];
  const at = [0, 0];
  const done = [0, 0]; // mass of the current part that is behind us
  let sum = 0;
  while (at[0] < source.length && at[1] < target.length) {
    const left = sides.map((parts, s) => parts[at[s]].mass - done[s]);
    const mass = Math.min(...left);
    const [x, y] = sides.map((parts, s) => {
      const part = parts[at[s]];
      return cutOut(part, done[s] / part.mass, left[s] === mass ? 1 : (done[s] + mass) / part.mass);
    });
    sum += mass * meanSquare(x, y);
    for (const s of [0, 1]) {
      if (left[s] === mass) {
        at[s] += 1;
        done[s] = 0;
      } else {
        done[s] += mass;
      }
    }
  }
  return sum;
}

/**
 * The piece of a part between two shares of its mass: its start, its extent and its tilt.
 * @param {Part} part
 * @param {number} low
 * @param {number} high
 */
function cutOut({ from, to, tilt }, low, high) {
  const along = (share) => {
    const root = Math.sqrt(Math.max(0, (1 - tilt) ** 2 + 4 * tilt * share));
    return share > 0 ? (2 * share) / (1 - tilt + root) : 0;
  };
  const [s, t] = [along(low), along(high)];
  const middle = 1 - tilt + tilt * (s + t);
  return {
    start: from + (to - from) * s,
    extent: (to - from) * (t - s),
    tilt: middle > 0 ? (tilt * (t - s)) / middle : 0,
  };
}

function meanSquare(x, y) {
  let sum = (x.start - y.start + x.extent * (0.5 + x.tilt / 6) - y.extent * (0.5 + y.tilt / 6)) ** 2;
  let [ofX, ofY] = [x.extent / 2, y.extent / 2];
  for (let n = 1; n < MOST_TERMS; n += 1) {
    const term = ofX * factor(n, x.tilt) - ofY * factor(n, y.tilt);
    sum += term ** 2 / (2 * n + 1);
    ofX *= -x.tilt;
    ofY *= -y.tilt;
    if (Math.abs(ofX) + Math.abs(ofY) < 1e-12 * (x.extent + y.extent)) {
      break;
    }
  }
  return sum;
}

function factor(n, tilt) {
  return tilt ** 2 / (2 * n + 3) - 1 / (2 * n - 1);
}
