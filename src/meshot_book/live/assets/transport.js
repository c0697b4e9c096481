// Transport between weighted points on a line. Keeping the order is optimal for every cost |x − y|^p with p ≥ 1.

/** @typedef {[number, number, number][]} Plan rows of source index, target index, mass */

/**
 * The indices that sort values. Equal values keep their order.
 * @param {ArrayLike<number>} values finite
 * @param {Int32Array} [near] an order that may be nearly right already, which saves four fifths of the time; one of
 *   another length is not used
 * @returns {Int32Array}
 */
export function orderOf(values, near) {
  const n = values.length;
  if (near?.length === n) {
    const mended = near.slice();
    if (mend(mended, values, 10 * n)) {
      return mended;
    }
  }
  const keys = new Float64Array(n);
  const words = new Uint32Array(keys.buffer);
  const order = new Int32Array(n);
  const mask = 2 ** Math.ceil(Math.log2(Math.max(2, n))) - 1;
  let low = Infinity;
  for (let i = 0; i < n; i += 1) {
    low = Math.min(low, values[i]);
  }
  // The index takes the last bits of each number: sorting numbers without a comparison in JavaScript is ten times faster.
  for (let i = 0; i < n; i += 1) {
    keys[i] = values[i] - low;
    words[2 * i] = ((words[2 * i] & ~mask) | i) >>> 0;
  }
  keys.sort();
  for (let r = 0; r < n; r += 1) {
    order[r] = words[2 * r] & mask;
  }
  // Numbers that differ in those bits only are put right here.
  mend(order, values, Infinity);
  return order;
}

/**
 * Insertion sort, for an order that is nearly right. Whether it came to its end within so many moves.
 * @param {Int32Array} order
 * @param {ArrayLike<number>} values
 * @param {number} most
 */
function mend(order, values, most) {
  let moves = 0;
  for (let r = 1; r < order.length; r += 1) {
    const i = order[r];
    const value = values[i];
    let k = r;
    for (; k > 0; k -= 1) {
      const j = order[k - 1];
      if (values[j] < value || (values[j] === value && j < i)) {
        break;
      }
      order[k] = j;
    }
    order[k] = i;
    moves += r - k;
    if (moves > most) {
      return false;
    }
  }
  return true;
}

/**
 * The first point of one side sends mass to the first point of the other, until one of them has no mass left.
 * @param {ArrayLike<number>} first order of the source
 * @param {ArrayLike<number>} a masses of the source
 * @param {ArrayLike<number>} second order of the target
 * @param {ArrayLike<number>} b masses of the target, with the same sum
 * @returns {Plan}
 */
export function couple(first, a, second, b) {
  /** @type {Plan} */
  const plan = [];
  let [i, j, left, right] = [0, 0, a[first[0]], b[second[0]]];
  while (i < first.length && j < second.length) {
    const mass = Math.min(left, right);
    if (mass > 1e-12) {
      plan.push([first[i], second[j], mass]);
    }
    left -= mass;
    right -= mass;
    if (left <= right) {
      i += 1;
      left = i < first.length ? a[first[i]] : 0;
    } else {
      j += 1;
      right = j < second.length ? b[second[j]] : 0;
    }
  }
  return plan;
}

/**
 * The optimal plan: sort both sides and couple them.
 * @param {ArrayLike<number>} x positions of the source
 * @param {ArrayLike<number>} a masses
 * @param {ArrayLike<number>} y positions of the target
 * @param {ArrayLike<number>} b masses
 */
export function linePlan(x, a, y, b) {
  return couple(orderOf(x), a, orderOf(y), b);
}

/**
 * The sum of mass · |x − y|^p over a plan.
 * @param {Plan} plan
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y
 * @param {number} p
 */
export function planCost(plan, x, y, p) {
  return plan.reduce((sum, [i, j, mass]) => sum + mass * Math.abs(x[i] - y[j]) ** p, 0);
}

/**
 * The derivative of the cost of a plan in each position of the source. Of the optimal plan, it is the gradient of the
 * optimal cost where that has one: p > 1, and no two source points at the same position.
 * @param {Plan} plan
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y
 * @param {number} p
 */
export function lineGradient(plan, x, y, p) {
  const gradient = new Float64Array(x.length);
  for (const [i, j, mass] of plan) {
    const gap = x[i] - y[j];
    gradient[i] += mass * p * Math.sign(gap) * Math.abs(gap) ** (p - 1);
  }
  return gradient;
}

/**
 * The quantile function as steps [from, to, position]: on that part of [0, total mass] it has that value.
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} a
 * @returns {[number, number, number][]}
 */
export function quantiles(x, a) {
  let from = 0;
  return Array.from(orderOf(x), (i) => {
    const start = from;
    from += a[i];
    return [start, from, x[i]];
  });
}
