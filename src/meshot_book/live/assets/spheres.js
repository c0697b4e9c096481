// Two spheres of R³: on a line, each is uniform on an interval.

/**
 * The transport cost W_p^p between the projections of two spheres on each line.
 * @param {number[][]} lines unit vectors
 * @param {number[]} radii of the first and of the second
 * @param {number[]} shift from the first centre to the second
 * @param {number} p
 */
export function sphereCosts(lines, [first, second], shift, p) {
  // The difference of the quantile functions is linear: a (2z − 1) + c on [0, 1].
  const a = second - first;
  const power = (value) => Math.sign(value) * Math.abs(value) ** (p + 1);
  return lines.map((line) => {
    const c = line.reduce((sum, value, k) => sum + value * shift[k], 0);
    return Math.abs(a) < 1e-9 ? Math.abs(c) ** p : (power(c + a) - power(c - a)) / (2 * a * (p + 1));
  });
}
