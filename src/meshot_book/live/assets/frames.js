// Directions in orthogonal blocks.
import { normal } from "./random.js";

/**
 * Unit vectors of R^d in random blocks of d orthogonal ones; the last block may be a part of one.
 * @param {number} count
 * @param {number} d
 * @param {() => number} random
 * @returns {number[][]}
 */
export function orthogonalDirections(count, d, random) {
  const found = [];
  while (found.length < count) {
    const block = [];
    while (block.length < d) {
      const vector = Array.from({ length: d }, () => normal(random));
      for (const other of block) {
        const along = other.reduce((sum, value, k) => sum + value * vector[k], 0);
        other.forEach((value, k) => (vector[k] -= along * value));
      }
      const length = Math.hypot(...vector);
      block.push(vector.map((value) => value / length));
    }
    found.push(...block);
  }
  return found.slice(0, count);
}
