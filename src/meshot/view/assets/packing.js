// Decodes the data of a scene. The encoding is described in scene_data.py.

// Decodes integers: zigzag-encoded differences in three planes of bytes, which compress well.
export async function unpack(packed, lengths) {
  if (!window.DecompressionStream) {
    throw new Error("this browser is too old");
  }
  const stream = new Blob([bytesOf(packed)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  let from = 0;
  return lengths.map((n) => {
    const numbers = new Int32Array(n);
    for (let i = 0; i < n; i++) {
      const z = planes[from + i] | (planes[from + n + i] << 8) | (planes[from + 2 * n + i] << 16);
      numbers[i] = (z >>> 1) ^ -(z & 1);
    }
    from += 3 * n;
    return numbers;
  });
}

export function bytesOf(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
}

export function placed(steps, low, size) {
  const n = steps.length / 3;
  const points = new Float32Array(steps.length);
  for (let k = 0; k < 3; k++) {
    for (let i = 0, sum = 0; i < n; i++) {
      sum += steps[k * n + i];
      points[3 * i + k] = low[k] + sum * size;
    }
  }
  return points;
}

export function joinedCorners(steps) {
  const n = steps.length / 3;
  const corners = new Uint32Array(steps.length);
  for (let i = 0, first = 0; i < n; i++) {
    first += steps[i];
    corners.set([first, first + steps[n + i], first + steps[2 * n + i]], 3 * i);
  }
  return corners;
}

// Vertex normals: the area-weighted mean of the normals of the faces around each vertex.
export function perpendicular(p, f) {
  const normals = new Float32Array(p.length);
  for (let i = 0; i < f.length; i += 3) {
    const [a, b, c] = [3 * f[i], 3 * f[i + 1], 3 * f[i + 2]];
    const u = [0, 1, 2].map((k) => p[b + k] - p[a + k]);
    const v = [0, 1, 2].map((k) => p[c + k] - p[a + k]);
    for (let k = 0; k < 3; k++) {
      const x = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
      normals[a + k] += x;
      normals[b + k] += x;
      normals[c + k] += x;
    }
  }
  return normals;
}
