// Two clouds projected on a line at an angle: pairs by rank, and what they cost.

export function project(points, degrees) {
  const c = Math.cos((degrees * Math.PI) / 180);
  const s = Math.sin((degrees * Math.PI) / 180);
  return points.map(([x, y]) => c * x + s * y);
}

export function pairsAt(source, target, degrees) {
  const x = project(source, degrees);
  const y = project(target, degrees);
  const ranks = byRank(y);
  return byRank(x).map((i, rank) => [x[i], y[ranks[rank]]]);
}

export function costAt(source, target, degrees) {
  return average(pairsAt(source, target, degrees).map(([x, y]) => (x - y) ** 2));
}

export function average(values) {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

export function standardError(values) {
  const middle = average(values);
  const n = values.length;
  return Math.sqrt(values.reduce((sum, value) => sum + (value - middle) ** 2, 0) / (n - 1) / n);
}

function byRank(values) {
  return values.map((_, i) => i).sort((i, j) => values[i] - values[j]);
}
