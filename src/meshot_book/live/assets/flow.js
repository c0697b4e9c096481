// Gradient descent of points with momentum.

/** @typedef {number[][]} Points rows of coordinates */

/**
 * A descent that has not moved yet.
 * @param {Points} points
 */
export function descent(points) {
  return { points, velocities: points.map((point) => point.map(() => 0)), steps: 0, moved: Infinity };
}

/**
 * The descent one step later: v ← momentum · v + gradient, x ← x − rate · v.
 * @param {ReturnType<typeof descent>} before
 * @param {Points} gradient at before.points
 * @param {{rate: number, momentum: number}} options
 * @returns {ReturnType<typeof descent>} with the largest distance moved
 */
export function descend(before, gradient, { rate, momentum }) {
  const velocities = before.velocities.map((v, i) => v.map((value, k) => momentum * value + gradient[i][k]));
  const points = before.points.map((x, i) => x.map((value, k) => value - rate * velocities[i][k]));
  const moved = rate * Math.max(...velocities.map((v) => Math.hypot(...v)));
  return { points, velocities, steps: before.steps + 1, moved };
}
