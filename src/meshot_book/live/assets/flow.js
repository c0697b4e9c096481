// Points in motion: gradient descent with momentum, and the flow of a velocity field.

/** @typedef {number[][]} Points rows of coordinates */

/**
 * A descent that has not moved yet.
 * @param {Points} points
 */
export function descent(points) {
  return { points, velocities: points.map((point) => point.map(() => 0)), steps: 0, moved: Infinity };
}

/**
 * The descent one step later: v ← momentum · v + gradient, x ← x − rate · v.
 * @param {ReturnType<typeof descent>} before
 * @param {Points} gradient at before.points
 * @param {{rate: number, momentum: number}} options
 * @returns {ReturnType<typeof descent>} with the largest distance moved
 */
export function descend(before, gradient, { rate, momentum }) {
  const velocities = before.velocities.map((v, i) => v.map((value, k) => momentum * value + gradient[i][k]));
  const points = before.points.map((x, i) => x.map((value, k) => value - rate * velocities[i][k]));
  const moved = rate * Math.max(...velocities.map((v) => Math.hypot(...v)));
  return { points, velocities, steps: before.steps + 1, moved };
}

/**
 * The flow of a velocity field: dx/dt = v(x), in equal steps. A negative time runs it backwards.
 * @param {(point: number[]) => number[]} velocity
 * @param {Points} points
 * @param {{steps: number, time?: number, method?: "euler" | "midpoint" | "rk4"}} options
 * @returns {Points}
 */
export function integrate(velocity, points, { steps, time = 1, method = "euler" }) {
  const h = time / steps;
  const advances = {
    euler: (x) => moveAlong(x, velocity(x), h),
    midpoint: (x) => moveAlong(x, velocity(moveAlong(x, velocity(x), h / 2)), h),
    // Kutta's rule of three eighths, as torchdiffeq has it.
    rk4(x) {
      const first = velocity(x);
      const second = velocity(moveAlong(x, first, h / 3));
      const third = velocity(x.map((value, k) => value + h * (second[k] - first[k] / 3)));
      const last = velocity(x.map((value, k) => value + h * (first[k] - second[k] + third[k])));
      return x.map((value, k) => value + (h / 8) * (first[k] + 3 * (second[k] + third[k]) + last[k]));
    },
  };
  const advance = advances[method];
  return points.map((point) => {
    let x = point;
    for (let k = 0; k < steps; k += 1) {
      x = advance(x);
    }
    return x;
  });
}

function moveAlong(x, v, share) {
  return x.map((value, k) => value + share * v[k]);
}

/**
 * A small velocity field: a sum of pushes that fade with distance, v(x) = Σ u exp(−‖x − c‖² / (2 r²)).
 * @param {{centre: number[], push: number[], reach: number}[]} bumps c, u and r
 * @returns {(point: number[]) => number[]}
 */
export function bumpField(bumps) {
  return (point) => {
    const sum = point.map(() => 0);
    for (const { centre, push, reach } of bumps) {
      const squared = point.reduce((all, value, k) => all + (value - centre[k]) ** 2, 0);
      const share = Math.exp(-squared / (2 * reach * reach));
      push.forEach((value, k) => (sum[k] += share * value));
    }
    return sum;
  };
}
