// Nearest neighbours, and the Chamfer loss that is made of them.

/** @typedef {number[][]} Points rows of coordinates */

/**
 * For each point the index of its nearest candidate, and the squared distance to it.
 * @param {Points} points
 * @param {Points} candidates
 */
export function nearest(points, candidates) {
  const index = new Int32Array(points.length);
  const squared = new Float64Array(points.length);
  points.forEach((point, i) => {
    let best = Infinity;
    for (let j = 0; j < candidates.length; j += 1) {
      const d = squaredDistance(point, candidates[j]);
      if (d < best) {
        best = d;
        index[i] = j;
      }
    }
    squared[i] = best;
  });
  return { index, squared };
}

export function squaredDistance(point, other) {
  let sum = 0;
  for (let k = 0; k < point.length; k += 1) {
    sum += (point[k] - other[k]) ** 2;
  }
  return sum;
}

/**
 * The Chamfer loss and its gradient in the source: mean squared distances to nearest neighbours, in both directions.
 * Points without mass are no neighbours.
 * @param {Points} source
 * @param {Points} target
 * @param {number[]} [a] masses of the source, equal if left out
 * @param {number[]} [b] masses of the target
 * @returns {{cost: number, gradient: Points, chosen: Int32Array, selectors: Int32Array}} with the target point nearest
 *   to each source point, and the source point that each target point selects (−1: it has no mass)
 */
export function chamferLoss(source, target, a = equalMasses(source), b = equalMasses(target)) {
  const gradient = source.map((point) => point.map(() => 0));
  const there = between(source, a, target, b);
  const back = between(target, b, source, a);
  let cost = 0;
  there.chosen.forEach((j, i) => {
    if (j >= 0) {
      cost += a[i] * there.squared[i];
      addDifference(gradient[i], source[i], target[j], 2 * a[i]);
    }
  });
  back.chosen.forEach((i, j) => {
    if (i >= 0) {
      cost += b[j] * back.squared[j];
      addDifference(gradient[i], source[i], target[j], 2 * b[j]);
    }
  });
  return { cost, gradient, chosen: there.chosen, selectors: back.chosen };
}

export function equalMasses(points) {
  return Array.from(points, () => 1 / points.length);
}

function between(points, masses, candidates, weights) {
  const massive = candidates.map((_, j) => j).filter((j) => weights[j] > 0);
  const found = nearest(
    points,
    massive.map((j) => candidates[j]),
  );
  return { chosen: found.index.map((k, i) => (masses[i] > 0 ? massive[k] : -1)), squared: found.squared };
}

function addDifference(into, point, other, factor) {
  for (let k = 0; k < into.length; k += 1) {
    into[k] += factor * (point[k] - other[k]);
  }
}
