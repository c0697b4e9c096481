// Exact assignment: shortest augmenting paths with potentials (Kuhn 1955; Jonker and Volgenant 1987), O(n² m).

/** @typedef {number[][]} Points rows of coordinates */

/**
 * The cheapest way to give each row a column of its own.
 * @param {number[][]} costs n rows of m ≥ n numbers
 * @returns {{columns: Int32Array, cost: number}} the column of each row, and the sum of their costs
 */
export function assignment(costs) {
  const n = costs.length;
  const m = costs[0].length;
  if (n > m) {
    throw new RangeError(`${n} rows for ${m} columns: swap the two sides`);
  }
  const ofRow = new Float64Array(n);
  const ofColumn = new Float64Array(m + 1);
  const rowAt = new Int32Array(m + 1).fill(-1);
  const before = new Int32Array(m + 1);
  for (let row = 0; row < n; row += 1) {
    const shortest = new Float64Array(m).fill(Infinity);
    const done = new Uint8Array(m + 1);
    // Column m stands for the row that has none yet.
    let column = m;
    rowAt[m] = row;
    while (rowAt[column] >= 0) {
      done[column] = 1;
      const i = rowAt[column];
      let [least, next] = [Infinity, -1];
      for (let j = 0; j < m; j += 1) {
        if (done[j]) {
          continue;
        }
        const length = costs[i][j] - ofRow[i] - ofColumn[j];
        if (length < shortest[j]) {
          shortest[j] = length;
          before[j] = column;
        }
        if (shortest[j] < least) {
          [least, next] = [shortest[j], j];
        }
      }
      for (let j = 0; j <= m; j += 1) {
        if (done[j]) {
          ofRow[rowAt[j]] += least;
          ofColumn[j] -= least;
        } else if (j < m) {
          shortest[j] -= least;
        }
      }
      column = next;
    }
    while (column !== m) {
      rowAt[column] = rowAt[before[column]];
      column = before[column];
    }
    rowAt[m] = -1;
  }
  const columns = new Int32Array(n);
  let cost = 0;
  for (let j = 0; j < m; j += 1) {
    if (rowAt[j] >= 0) {
      columns[rowAt[j]] = j;
      cost += costs[rowAt[j]][j];
    }
  }
  return { columns, cost };
}

/**
 * Exact transport between equally many points of equal mass: W_p^p, its gradient in the source, and the partners.
 * @param {Points} source
 * @param {Points} target
 * @param {number} [p]
 */
export function exactLoss(source, target, p = 2) {
  const n = source.length;
  const { columns, cost } = assignment(groundCosts(source, target, p));
  const gradient = source.map((point, i) => {
    const other = target[columns[i]];
    const length = Math.hypot(...point.map((value, k) => value - other[k]));
    const factor = length > 0 ? (p * length ** (p - 2)) / n : 0;
    return point.map((value, k) => factor * (value - other[k]));
  });
  return { cost: cost / n, gradient, columns };
}

/**
 * ‖x − y‖^p for all pairs.
 * @param {Points} source
 * @param {Points} target
 * @param {number} p
 */
export function groundCosts(source, target, p) {
  return source.map((x) => target.map((y) => x.reduce((sum, value, k) => sum + (value - y[k]) ** 2, 0) ** (p / 2)));
}
