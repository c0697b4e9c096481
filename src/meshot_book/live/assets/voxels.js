// Masks of voxels: components, cavities, handles, and a part with the topology of a ball.

/**
 * @typedef {object} Grid a block of voxels in a layer of background; places count through it, the last axis fastest
 * @property {number[]} shape with the layer
 * @property {number[]} strides
 */

/**
 * @param {number[]} inner the numbers of voxels along three axes, without the layer
 * @returns {Grid}
 */
export function voxelGrid(inner) {
  const shape = inner.map((n) => n + 2);
  return { shape, strides: [shape[1] * shape[2], shape[2], 1] };
}

/** Values of a block, one after another, in their grid; the layer around them is `outside`. */
export function onGrid(values, { shape, strides }, outside = 0) {
  const found = new Float64Array(shape[0] * shape[1] * shape[2]).fill(outside);
  let next = 0;
  for (let i = 1; i < shape[0] - 1; i += 1) {
    for (let j = 1; j < shape[1] - 1; j += 1) {
      for (let k = 1; k < shape[2] - 1; k += 1) {
        found[i * strides[0] + j * strides[1] + k] = values[next];
        next += 1;
      }
    }
  }
  return found;
}

const TRIPLES = Array.from({ length: 27 }, (_, p) => [Math.floor(p / 9) - 1, (Math.floor(p / 3) % 3) - 1, (p % 3) - 1]);
const SPAN = TRIPLES.map((triple) => triple.reduce((sum, x) => sum + Math.abs(x), 0));

// Steps to the voxels that share a face (1), a face or edge (2), or a face, edge or corner (3).
function stepsOf({ strides }, most) {
  return TRIPLES.filter((_, p) => SPAN[p] > 0 && SPAN[p] <= most).map((triple) =>
    triple.reduce((sum, x, axis) => sum + x * strides[axis], 0),
  );
}

// All places of a value that are connected with a start. The layer around the block makes wrapping harmless: a step
// out of the block ends in the layer, which is connected anyway.
function partFrom(mask, steps, start, seen) {
  const value = mask[start];
  const found = [start];
  seen[start] = 1;
  for (let next = 0; next < found.length; next += 1) {
    for (const step of steps) {
      const other = found[next] + step;
      if (mask[other] === value && !seen[other]) {
        seen[other] = 1;
        found.push(other);
      }
    }
  }
  return found;
}

/** The connected parts of a mask (value 1) or of its background (0), as lists of places. */
export function connectedParts(mask, grid, value, most) {
  const steps = stepsOf(grid, most);
  const seen = new Uint8Array(mask.length);
  const parts = [];
  mask.forEach((found, place) => {
    if (found === value && !seen[place]) {
      parts.push(partFrom(mask, steps, place, seen));
    }
  });
  return parts;
}

/**
 * Euler number of the solid: of closed cubes where voxels are connected by corners, else of cubes joined by faces.
 * @param {ArrayLike<number>} mask zeros and ones on the grid
 * @param {Grid} grid
 * @param {boolean} corners
 */
export function solidEuler(mask, { strides }, corners) {
  // The voxels around a corner, an edge in each direction, a face in each direction, and a voxel.
  const shapes = [...Array(8).keys()].map((axes) => {
    const used = strides.filter((_, axis) => axes & (1 << axis));
    return { places: used.reduce((all, s) => [...all, ...all.map((p) => p + s)], [0]), sign: used.length % 2 ? -1 : 1 };
  });
  let sum = 0;
  for (let place = 0; place < mask.length; place += 1) {
    for (const { places, sign } of shapes) {
      if (corners ? places.some((p) => mask[place + p]) : places.every((p) => mask[place + p])) {
        sum += sign;
      }
    }
  }
  return corners ? -sum : sum;
}

/**
 * Components, cavities and handles of a mask.
 * @param {ArrayLike<number>} mask zeros and ones on the grid
 * @param {Grid} grid
 * @param {boolean} corners whether voxels that share an edge or corner only are connected; the background then is not
 */
export function solidTopology(mask, grid, corners) {
  const components = connectedParts(mask, grid, 1, corners ? 3 : 1).length;
  const cavities = connectedParts(mask, grid, 0, corners ? 1 : 3).length - 1;
  return { components, cavities, handles: components + cavities - solidEuler(mask, grid, corners) };
}

/** The largest part of a mask, connected by faces, with its cavities filled. */
export function wholePart(mask, grid) {
  const parts = connectedParts(mask, grid, 1, 1);
  const largest = parts.reduce((best, part) => (part.length > best.length ? part : best), []);
  const whole = new Uint8Array(mask.length);
  largest.forEach((place) => (whole[place] = 1));
  // Every part of the background but the outer one, which holds the first place.
  connectedParts(whole, grid, 0, 3).slice(1).forEach((part) => part.forEach((place) => (whole[place] = 1))); // prettier-ignore
  return whole;
}

// In the 3³ neighbourhood: the positions next to each, among all but the centre, and among those near by face or edge.
function adjacency(most, allowed) {
  return TRIPLES.map((from, p) =>
    TRIPLES.flatMap((to, q) => {
      const gaps = from.map((x, axis) => Math.abs(x - to[axis]));
      const near = Math.max(...gaps) === 1 && gaps.reduce((sum, gap) => sum + gap, 0) <= most;
      return near && allowed(p) && allowed(q) ? [q] : [];
    }),
  );
}
const ALL = TRIPLES.flatMap((_, p) => (SPAN[p] > 0 ? [p] : []));
const FACES = TRIPLES.flatMap((_, p) => (SPAN[p] === 1 ? [p] : []));
const BY_CORNERS = adjacency(3, (p) => SPAN[p] > 0);
const BY_FACES = adjacency(1, (p) => SPAN[p] > 0 && SPAN[p] < 3);

function partsWith(around, wanted, seeds, adjacent) {
  let seen = 0;
  let count = 0;
  for (const seed of seeds) {
    if (around[seed] !== wanted || seen & (1 << seed)) {
      continue;
    }
    count += 1;
    seen |= 1 << seed;
    for (const stack = [seed]; stack.length;) {
      for (const other of adjacent[stack.pop()]) {
        if (around[other] === wanted && !(seen & (1 << other))) {
          seen |= 1 << other;
          stack.push(other);
        }
      }
    }
  }
  return count;
}

/** Whether adding the centre of a 3³ neighbourhood changes no topology (Bertrand and Malandain, 1994). */
export function isSimple(around) {
  return partsWith(around, 1, ALL, BY_CORNERS) === 1 && partsWith(around, 0, FACES, BY_FACES) === 1;
}

/** Whether, with its centre, no two voxels inside or outside meet in an edge or corner only (Latecki, 1997). */
export function staysWellComposed(around) {
  // In each of the eight cubes of 2³ voxels around the centre.
  for (let octant = 0; octant < 8; octant += 1) {
    const [x, y, z] = [9, 3, 1].map((s, axis) => (octant & (1 << axis) ? s : -s));
    const [a, b, c, ab, ac, bc, abc] = [x, y, z, x + y, x + z, y + z, x + y + z].map((p) => around[13 + p]);
    const total = a + b + c + ab + ac + bc + abc;
    if ((ab && !a && !b) || (ac && !a && !c) || (bc && !b && !c) || (abc && total === 1)) {
      return false;
    }
    if (total === 5 && ((!a && !bc) || (!b && !ac) || (!c && !ab))) {
      return false;
    }
  }
  return true;
}

/**
 * A ball that grows in a mask, from the voxel of highest priority: each call of `next` tries one voxel.
 * @param {ArrayLike<number>} mask zeros and ones on the grid
 * @param {ArrayLike<number>} priority
 * @param {Grid} grid
 */
export function ballGrowth(mask, priority, grid) {
  const steps = TRIPLES.map((triple) => triple.reduce((sum, x, axis) => sum + x * grid.strides[axis], 0));
  const grown = new Uint8Array(mask.length);
  const waiting = new Uint8Array(mask.length);
  const heap = [];
  const before = (a, b) => priority[a] > priority[b] || (priority[a] === priority[b] && a < b);
  function push(place) {
    let at = heap.push(place) - 1;
    for (let up = (at - 1) >> 1; at > 0 && before(place, heap[up]); at = up, up = (at - 1) >> 1) {
      heap[at] = heap[up];
      heap[up] = place;
    }
  }
  function pop() {
    const first = heap[0];
    const last = heap.pop();
    if (heap.length) {
      let at = 0;
      heap[0] = last;
      for (;;) {
        const below = [2 * at + 1, 2 * at + 2].filter((k) => k < heap.length);
        const best = below.reduce((one, k) => (before(heap[k], heap[one]) ? k : one), at);
        if (best === at) {
          break;
        }
        [heap[at], heap[best]] = [heap[best], heap[at]];
        at = best;
      }
    }
    return first;
  }
  let start = -1;
  for (let place = 0; place < mask.length; place += 1) {
    if (mask[place] && (start < 0 || priority[place] > priority[start])) {
      start = place;
    }
  }
  if (start >= 0) {
    push(start);
  }
  return {
    grown,
    /** The voxel that was tried and whether it was added; null at the end. */
    next() {
      if (heap.length === 0) {
        return null;
      }
      const place = pop();
      waiting[place] = 0;
      const around = steps.map((step) => grown[place + step]);
      const added = place === start || (isSimple(around) && staysWellComposed(around));
      if (added) {
        grown[place] = 1;
        for (const step of steps) {
          const other = place + step;
          if (mask[other] && !grown[other] && !waiting[other]) {
            waiting[other] = 1;
            push(other);
          }
        }
      }
      return { place, added };
    },
  };
}

/** Whether no two voxels of a mask, or of its background, meet in an edge or a corner only. */
export function isWellComposed(mask, { strides }) {
  const [x, y, z] = strides;
  const squares = [[x, y], [x, z], [y, z]]; // prettier-ignore
  const diagonals = [[0, x + y + z], [x, y + z], [y, x + z], [z, x + y]]; // prettier-ignore
  return !mask.some(
    (value, p) =>
      squares.some(([a, b]) => value === mask[p + a + b] && mask[p + a] === mask[p + b] && value !== mask[p + a]) ||
      diagonals.some(([a, b]) => {
        const total = diagonals.flat().reduce((sum, step) => sum + mask[p + step], 0);
        return mask[p + a] === mask[p + b] && total === (mask[p + a] ? 2 : 6);
      }),
  );
}

// A mask around some places, two voxels wider than they, as a grid of its own; and where its voxels lie in the mask.
function boxAround(mask, { shape, strides }, places) {
  const at = (place, axis) => Math.floor(place / strides[axis]) % shape[axis];
  const low = strides.map((_, axis) => Math.min(...places.map((place) => at(place, axis))) - 2);
  const high = strides.map((_, axis) => Math.max(...places.map((place) => at(place, axis))) + 2);
  const box = voxelGrid(low.map((first, axis) => high[axis] - first + 1));
  const part = new Uint8Array(box.shape.reduce((product, n) => product * n, 1));
  const homes = new Map();
  for (let place = 0; place < part.length; place += 1) {
    const index = box.strides.map((step, axis) => Math.floor(place / step) % box.shape[axis]);
    const there = index.map((n, axis) => n - 1 + low[axis]);
    const layer = index.some((n, axis) => n === 0 || n === box.shape[axis] - 1);
    if (!layer && there.every((n, axis) => n >= 0 && n < shape[axis])) {
      const home = there.reduce((sum, n, axis) => sum + n * strides[axis], 0);
      homes.set(home, place);
      part[place] = mask[home];
    }
  }
  return { box, part, homes };
}

const sameTopology = (one, other, grid) => {
  const [a, b] = [one, other].map((mask) => solidTopology(mask, grid, true));
  return isWellComposed(other, grid) && Object.keys(a).every((key) => a[key] === b[key]);
};

/** A part of the mask with the topology of a ball: by growth to its end, and then of whole pieces that fit. */
export function ballWithin(mask, priority, grid) {
  const growth = ballGrowth(mask, priority, grid);
  while (growth.next()) {
    // on to the last voxel
  }
  const whole = growth.grown.slice();
  const left = Uint8Array.from(mask, (value, place) => (value && !growth.grown[place] ? 1 : 0));
  for (const piece of connectedParts(left, grid, 1, 3)) {
    const { box, part, homes } = boxAround(whole, grid, piece);
    const larger = part.slice();
    piece.forEach((place) => (larger[homes.get(place)] = 1));
    if (sameTopology(part, larger, box)) {
      piece.forEach((place) => (whole[place] = 1));
    }
  }
  const { components, cavities, handles } = solidTopology(whole, grid, true);
  const isBall = components === 1 && cavities === 0 && handles === 0 && isWellComposed(whole, grid);
  return isBall ? whole : growth.grown;
}
