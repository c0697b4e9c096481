"""The arithmetic of the sorting page, in JavaScript: pairings, their cost, their crossings."""

#: Pure functions, so that a browser without a page can be asked for their answers. A pairing is a list of
#: [source index, target index, mass].
ARITHMETIC = """
const ORDER = (values) => values.map((_, i) => i).sort((i, j) => values[i] - values[j] || i - j);
// Whoever comes first on one side sends to whoever comes first on the other, until one has nothing left.
function couple(first, a, second, b) {
  const plan = [];
  let i = 0, j = 0, left = a[first[0]], right = b[second[0]];
  while (i < first.length && j < second.length) {
    const mass = Math.min(left, right);
    if (mass > 1e-12) { plan.push([first[i], second[j], mass]); }
    left -= mass;
    right -= mass;
    if (left <= right) { i += 1; left = i < first.length ? a[first[i]] : 0; }
    else { j += 1; right = j < second.length ? b[second[j]] : 0; }
  }
  return plan;
}
const sorted = (x, a, y, b) => couple(ORDER(x), a, ORDER(y), b);
const cost = (plan, x, y, p) => plan.reduce((sum, [i, j, m]) => sum + m * Math.abs(x[i] - y[j]) ** p, 0);
const crosses = ([i, j], [k, l], x, y) => (x[i] - x[k]) * (y[j] - y[l]) < 0;
function crossings(plan, x, y) {
  let count = 0;
  plan.forEach((one, r) => plan.slice(r + 1).forEach((other) => { count += crosses(one, other, x, y) ? 1 : 0; }));
  return count;
}
// Swap the partners of the crossing pair that gains most by it (measured with p = 2, where every swap gains).
function uncrossed(plan, x, y) {
  let best = null, gain = 0;
  plan.forEach((one, r) => plan.slice(r + 1).forEach((other) => {
    const saved = -(x[one[0]] - x[other[0]]) * (y[one[1]] - y[other[1]]) * Math.min(one[2], other[2]);
    if (saved > gain) { gain = saved; best = [one, other]; }
  }));
  if (!best) { return plan; }
  const [[i, j, m], [k, l, n]] = best, moved = Math.min(m, n), sums = new Map();
  const put = (from, to, mass) => { const key = from + " " + to; sums.set(key, (sums.get(key) || 0) + mass); };
  plan.forEach(([from, to, mass]) => put(from, to, mass));
  put(i, j, -moved);
  put(k, l, -moved);
  put(i, l, moved);
  put(k, j, moved);
  return [...sums].filter(([, mass]) => mass > 1e-12).map(([key, mass]) => [...key.split(" ").map(Number), mass]);
}
// Mulberry32: the same "random" pairings in every browser.
function generator(seed) {
  return () => {
    seed = (seed + 0x6D2B79F5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}
function shuffled(n, random) {
  const order = Array.from({ length: n }, (_, i) => i);
  for (let i = n - 1; i > 0; i -= 1) {
    const j = Math.floor(random() * (i + 1));
    [order[i], order[j]] = [order[j], order[i]];
  }
  return order;
}
"""
