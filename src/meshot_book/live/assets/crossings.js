// Pairings of points on a line that need not be sorted: which of their lines cross, and how one exchange mends two.

/** @typedef {import("./transport.js").Plan} Plan */
/** @typedef {Plan[number]} PlanRow source index, target index, mass */

/**
 * Whether two rows of a plan cross.
 * @param {PlanRow} one
 * @param {PlanRow} other
 * @param {ArrayLike<number>} x positions of the source
 * @param {ArrayLike<number>} y positions of the target
 */
export function crosses([i, j], [k, l], x, y) {
  return (x[i] - x[k]) * (y[j] - y[l]) < 0;
}

/**
 * The number of pairs of rows that cross.
 * @param {Plan} plan
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y
 */
export function crossings(plan, x, y) {
  return couplesOf(plan).filter(([one, other]) => crosses(one, other, x, y)).length;
}

/**
 * Swap the partners of the crossing pair that gains most by it (measured with p = 2, where every swap gains).
 * @param {Plan} plan
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y
 * @returns {Plan}
 */
export function uncrossed(plan, x, y) {
  /** @type {[PlanRow, PlanRow] | null} */
  let best = null;
  let gain = 0;
  for (const [one, other] of couplesOf(plan)) {
    const saved = -(x[one[0]] - x[other[0]]) * (y[one[1]] - y[other[1]]) * Math.min(one[2], other[2]);
    if (saved > gain) {
      [best, gain] = [[one, other], saved];
    }
  }
  return best ? swapped(plan, ...best) : plan;
}

/**
 * @param {Plan} plan
 * @param {PlanRow} one
 * @param {PlanRow} other
 * @returns {Plan}
 */
function swapped(plan, [i, j, m], [k, l, n]) {
  const moved = Math.min(m, n);
  /** @type {Map<string, PlanRow>} */
  const sums = new Map();
  for (const [from, to, mass] of [...plan, [i, j, -moved], [k, l, -moved], [i, l, moved], [k, j, moved]]) {
    const key = from + " " + to;
    sums.set(key, [from, to, (sums.get(key)?.[2] ?? 0) + mass]);
  }
  return [...sums.values()].filter(([, , mass]) => mass > 1e-12);
}

/**
 * @param {Plan} plan
 * @returns {[PlanRow, PlanRow][]}
 */
function couplesOf(plan) {
  return plan.flatMap((one, r) => plan.slice(r + 1).map((other) => /** @type {[PlanRow, PlanRow]} */ ([one, other])));
}
