// Outlines under a flow: velocities, sides cut into pieces, and how many pairs of sides cross.

export const velocities = {
  push: (f, [x]) => [0, f.strength * Math.exp((-x * x) / (2 * f.reach * f.reach))],
  whirl: (f, [x, y]) => {
    const turn = f.strength * Math.exp(-(x * x + y * y) / (2 * f.reach * f.reach));
    return [-turn * y, turn * x];
  },
};

export function cut(corners, pieces) {
  return corners.flatMap((a, i) => {
    const b = corners[(i + 1) % 3];
    return Array.from({ length: pieces }, (_, k) => [0, 1].map((c) => a[c] + (k / pieces) * (b[c] - a[c])));
  });
}

export function crossingPairs(shapes) {
  const sides = shapes.flatMap((shape) => shape.map((a, i) => [a, shape[(i + 1) % shape.length]]));
  let found = 0;
  for (let i = 0; i < sides.length; i++) {
    for (let j = 0; j < i; j++) {
      found += Number(cross(sides[i], sides[j]));
    }
  }
  return found;
}

function cross([a, b], [c, d]) {
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

function side(a, b, c) {
  return Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}
