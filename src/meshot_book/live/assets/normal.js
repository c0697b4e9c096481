// The standard normal distribution, and the largest of several values that have it.

const STEP = 0.05; // of the trapezoidal rule, whose error is then below rounding
const FARTHEST = 12;

/** The probability that a standard normal value is below x. */
export function normalBelow(x) {
  const height = normalDensity(x);
  if (Math.abs(x) < 3) {
    let [sum, term] = [x, x];
    for (let k = 3; Math.abs(term) > 1e-17 * Math.abs(sum); k += 2) {
      term *= (x * x) / k;
      sum += term;
    }
    return 0.5 + height * sum;
  }
  // Beyond three the continued fraction of Laplace.
  let rest = Math.abs(x);
  for (let k = 80; k > 0; k -= 1) {
    rest = Math.abs(x) + k / rest;
  }
  return x < 0 ? height / rest : 1 - height / rest;
}

export function normalDensity(x) {
  return Math.exp(-0.5 * x * x) / Math.sqrt(2 * Math.PI);
}

/**
 * The mean of the largest of n independent standard normal values: n ∫ x φ(x) Φ(x)ⁿ⁻¹ dx.
 * @param {number} n
 */
export function expectedLargest(n) {
  return meanOverNormal((x) => n * x * normalBelow(x) ** (n - 1));
}

/**
 * The probability that the largest of n such values exceeds a given one of them by more than a lead.
 * @param {number} n
 * @param {number} lead
 */
export function leadByChance(n, lead) {
  return 1 - meanOverNormal((x) => normalBelow(x + lead) ** (n - 1));
}

function meanOverNormal(value) {
  let sum = 0;
  for (let x = -FARTHEST; x <= FARTHEST; x += STEP) {
    sum += normalDensity(x) * value(x);
  }
  return sum * STEP;
}
