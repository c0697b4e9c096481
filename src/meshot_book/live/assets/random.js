// Random numbers that are the same in every browser: Mulberry32, and what is made from it.

/** @typedef {() => number} Random a function that draws from [0, 1) */

/**
 * A stream of uniform numbers.
 * @param {number} seed a whole number
 * @returns {Random}
 */
export function generator(seed) {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/**
 * A standard normal number, from two uniform ones (Box and Muller, 1958).
 * @param {Random} random
 */
export function normal(random) {
  const radius = Math.sqrt(-2 * Math.log(1 - random()));
  return radius * Math.cos(2 * Math.PI * random());
}

/**
 * A permutation of 0 … n − 1, each with the same probability.
 * @param {number} n
 * @param {Random} random
 */
export function shuffled(n, random) {
  const order = Array.from({ length: n }, (_, i) => i);
  for (let i = n - 1; i > 0; i -= 1) {
    const j = Math.floor(random() * (i + 1));
    [order[i], order[j]] = [order[j], order[i]];
  }
  return order;
}

/**
 * Mean and standard error of independent values; the error of a single value is NaN.
 * @param {number[]} values
 */
export function estimate(values) {
  const n = values.length;
  const mean = values.reduce((sum, value) => sum + value, 0) / n;
  const squares = values.reduce((sum, value) => sum + (value - mean) ** 2, 0);
  return { mean, error: Math.sqrt(squares / (n - 1) / n) };
}
