// The power of a two-sided t-test at 5 % for two groups, and the interval of a standard deviation.
import { normalBelow, normalDensity } from "./normal.js";

const LEVEL = 0.95;
const LEAST = -46; // logarithm of the weights that are left out
const limits = new Map(); // of t, by degrees of freedom

// The mean of a function over s = √(χ² / ν): the trapezoidal rule in log s, where it converges exponentially.
function meanOverScale(free, finest, value) {
  const step = 0.35 * Math.min(1 / Math.sqrt(2 * free), finest);
  let [sum, total] = [0, 0];
  for (const sign of [1, -1]) {
    for (let k = sign > 0 ? 0 : 1; ; k += 1) {
      const u = sign * k * step;
      const height = free * (u + 0.5 - Math.exp(2 * u) / 2);
      if (height < LEAST) {
        break;
      }
      const weight = Math.exp(height);
      total += weight;
      sum += weight * value(Math.exp(u));
    }
  }
  return sum / total;
}

/** The value that |t| exceeds with a probability of 5 %. */
export function limitOfT(free) {
  if (!limits.has(free)) {
    // The probability is convex in t: Newton's steps from the left never pass the root.
    let t = 1.9;
    for (let move = 1; move > 1e-14 * t; t += move) {
      const at = t;
      const above = meanOverScale(free, 0.5, (s) => 2 * normalBelow(-at * s));
      const slope = meanOverScale(free, 0.5, (s) => 2 * s * normalDensity(at * s));
      move = (above - (1 - LEVEL)) / slope;
    }
    limits.set(free, t);
  }
  return limits.get(free);
}

/**
 * The probability of finding a standardised effect with n people in each group.
 * @param {number} effect in standard deviations of the people, as they are measured
 * @param {number} n
 */
export function powerOfGroups(effect, n) {
  const free = 2 * n - 2;
  const shift = Math.abs(effect) * Math.sqrt(n / 2);
  const limit = limitOfT(free);
  return meanOverScale(free, 1 / (2 + shift), (s) => normalBelow(shift - limit * s) + normalBelow(-shift - limit * s));
}

/**
 * The smallest size of each of two groups with which the power is reached.
 * @param {number} effect in standard deviations of the people, as they are measured
 * @param {number} [power]
 */
export function peopleNeeded(effect, power = 0.8) {
  let n = 2;
  while (n < 1e7 && powerOfGroups(effect, 2 * n) < power) {
    n *= 2;
  }
  // Between n, which is too small unless it is 2, and 2 n.
  let [low, high] = [n === 2 ? 1 : n, 2 * n];
  while (high - low > 1) {
    const middle = Math.floor((low + high) / 2);
    [low, high] = powerOfGroups(effect, middle) >= power ? [low, middle] : [middle, high];
  }
  return high;
}

/**
 * The value below which χ² lies with a probability.
 * @param {number} probability
 * @param {number} free an even number
 */
export function chiSquareQuantile(probability, free) {
  const below = (x) => {
    // With an even number, χ² is above x where a Poisson variable of mean x/2 is below half of it.
    let [sum, term] = [0, Math.exp(-x / 2)];
    for (let j = 0; j < free / 2; j += 1) {
      sum += term;
      term *= x / 2 / (j + 1);
    }
    return 1 - sum;
  };
  let [low, high] = [0, 10 * free + 40];
  for (let k = 0; k < 60; k += 1) {
    const middle = (low + high) / 2;
    [low, high] = below(middle) < probability ? [middle, high] : [low, middle];
  }
  return (low + high) / 2;
}

/**
 * The ends of the 95 % interval of a variance, divided by its estimate.
 * @param {number} free degrees of freedom, an even number
 * @returns {number[]} the lower and the upper one
 */
export function varianceFactors(free) {
  return [(1 + LEVEL) / 2, (1 - LEVEL) / 2].map((q) => free / chiSquareQuantile(q, free));
}
