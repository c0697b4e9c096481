// Pairings of points on a line: lists of [source index, target index, mass].

function orderOf(values) {
  return values.map((_, i) => i).sort((i, j) => values[i] - values[j] || i - j);
}

// The first point of one side sends mass to the first point of the other, until one of them has no mass left.
export function couple(first, a, second, b) {
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

export function sorted(x, a, y, b) {
  return couple(orderOf(x), a, orderOf(y), b);
}

export function cost(plan, x, y, p) {
  return plan.reduce((sum, [i, j, m]) => sum + m * Math.abs(x[i] - y[j]) ** p, 0);
}

export function crosses([i, j], [k, l], x, y) {
  return (x[i] - x[k]) * (y[j] - y[l]) < 0;
}

export function crossings(plan, x, y) {
  return couplesOf(plan).filter(([one, other]) => crosses(one, other, x, y)).length;
}

// Swap the partners of the crossing pair that gains most by it (measured with p = 2, where every swap gains).
export function uncrossed(plan, x, y) {
  let [best, gain] = [null, 0];
  for (const [one, other] of couplesOf(plan)) {
    const saved = -(x[one[0]] - x[other[0]]) * (y[one[1]] - y[other[1]]) * Math.min(one[2], other[2]);
    if (saved > gain) {
      [best, gain] = [[one, other], saved];
    }
  }
  return best ? swapped(plan, ...best) : plan;
}

function swapped(plan, [i, j, m], [k, l, n]) {
  const moved = Math.min(m, n);
  const sums = new Map();
  for (const [from, to, mass] of [...plan, [i, j, -moved], [k, l, -moved], [i, l, moved], [k, j, moved]]) {
    const key = from + " " + to;
    sums.set(key, (sums.get(key) || 0) + mass);
  }
  return [...sums].filter(([, mass]) => mass > 1e-12).map(([key, mass]) => [...key.split(" ").map(Number), mass]);
}

function couplesOf(plan) {
  return plan.flatMap((one, r) => plan.slice(r + 1).map((other) => [one, other]));
}
