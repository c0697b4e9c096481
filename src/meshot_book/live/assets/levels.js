// The curves on which a function on a grid is zero: marching squares, as scikit-image's find_contours has them.

/**
 * Closed curves around the values below zero. All values at the border of the grid must be above it.
 * Between two positions the function is linear. Two values below zero that touch at a corner belong together.
 * @param {ArrayLike<number>} values of n rows of m, row after row
 * @param {number} n
 * @param {number} m
 * @returns {number[][][]} rows and columns of the corners of each curve
 */
export function levelCurves(values, n, m) {
  // An edge of the grid has a number: twice that of its first corner, and one more if it runs along a row.
  const ends = (edge) => [edge >> 1, (edge >> 1) + (edge & 1 ? 1 : m)];
  const beside = new Map();
  const link = (a, b) => {
    for (const [from, to] of [
      [a, b],
      [b, a],
    ]) {
      beside.set(from, [...(beside.get(from) ?? []), to]);
    }
  };
  for (let row = 0; row + 1 < n; row += 1) {
    for (let column = 0; column + 1 < m; column += 1) {
      const first = row * m + column;
      // Corners around the cell, and the edge from each to the next.
      const below = [first, first + m, first + m + 1, first + 1].map((corner) => values[corner] < 0);
      const around = [2 * first, 2 * (first + m) + 1, 2 * (first + 1), 2 * first + 1];
      const cut = around.filter((_, k) => below[k] !== below[(k + 1) % 4]);
      if (cut.length === 2) {
        link(cut[0], cut[1]);
      } else if (cut.length === 4) {
        // Each corner that is not below zero is cut off.
        const k = below[0] ? 1 : 0;
        link(around[k], around[(k + 3) % 4]);
        link(around[k + 2], around[k + 1]);
      }
    }
  }
  const curves = [];
  const place = (edge) => {
    const [a, b] = ends(edge);
    const share = values[a] / (values[a] - values[b]);
    const along = edge & 1;
    return [Math.floor(a / m) + (along ? 0 : share), (a % m) + (along ? share : 0)];
  };
  while (beside.size) {
    const curve = [];
    let [edge] = beside.keys();
    while (edge !== undefined) {
      const next = beside.get(edge);
      beside.delete(edge);
      curve.push(place(edge));
      edge = next.find((other) => beside.has(other));
    }
    curves.push(curve);
  }
  return curves;
}
