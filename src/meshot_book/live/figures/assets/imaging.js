import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { generator, normal } from "../../assets/random.js";

const SHADES = 24;
const EDGE = 2; // mm along the window's edge that do not count, where a voxel ends the half-way border
const PIECE = 0.5; // mm
const DEFECTS = ["blur", "noise", "bias"];
const PICTURES = ["voxels alone", ...DEFECTS, "all"];

// A slice with its true border in a simulated scanner: where is the border half-way between white and grey?
export function main(root, data) {
  const figure = panel(root, { size: 1, blur: 2.5, noise: 25, bias: 25, draw: 1, picture: "all" });
  const { state } = figure;
  const wide = (data.n * data.step) / 2;
  const parts = Object.entries(data.fractions).map(([tissue, text]) => ({
    mean: data.means[tissue],
    of: twoDigits(text),
  }));
  // The true border in mm from the lower left corner.
  const border = data.border.map((chain) =>
    Array.from({ length: chain.length / 2 }, (_, p) => [0, 1].map((axis) => wide * (1 + chain[2 * p + axis] / 400))),
  );
  const lines = border.flatMap((chain) => chain.slice(1).map((end, p) => [chain[p], end]));
  const level = (data.means.white + data.means.grey) / 2;
  const range = [0, 2 * wide];
  const slice = figure.plot({
    name: "a slice of a scan with the true border, and the half-way border",
    x: { range },
    y: { range },
    equal: true,
    width: 400,
  });
  const bars = figure.plot({
    name: "error of the half-way border for each defect alone, and for all",
    x: { range: [0, 1], label: "" },
    y: { range: [PICTURES.length - 0.3, -0.7] },
    width: 260,
    height: 300,
  });

  function imageOf(picture) {
    const [blur, noise, bias] = DEFECTS.map((name) => (picture === name || picture === "all" ? state[name] : 0));
    const n = Math.round((data.n * data.step) / state.size);
    let image = meanSignal(parts, data.n, n);
    image = image.map((value, p) => value * Math.exp(((bias / 100) * (2 * Math.floor(p / n) + 1 - n)) / n));
    image = blurred(image, n, blur / Math.sqrt(8 * Math.log(2)) / state.size);
    if (noise) {
      const random = generator(state.draw);
      image = image.map((value) => Math.hypot(value + noise * normal(random), noise * normal(random)));
    }
    const halfway = crossingsOf(image, n, level).map((pair) => pair.map((place) => place.map((x) => x * state.size)));
    return { image, n, halfway, error: distanceBetween(lines, halfway, 2 * wide) };
  }
  function drawSlice({ image, n, halfway }) {
    const unit = (slice.at([1, 0])[0] - slice.at([0, 0])[0]) * state.size;
    const shades = Array.from({ length: SHADES }, () => []);
    image.forEach((value, p) => {
      const shade = Math.max(0, Math.min(SHADES - 1, Math.floor((value / 520) * SHADES)));
      shades[shade].push([(Math.floor(p / n) + 0.5) * state.size, ((p % n) + 0.5) * state.size]);
    });
    shades.forEach((places, shade) => {
      const grey = Math.round((255 * (shade + 0.5)) / SHADES);
      slice.dots(places, { colour: `rgb(${grey}, ${grey}, ${grey})`, size: unit + 0.4, square: true });
    });
    slice.segments(halfway, { colour: COLOURS.vermillion, width: 2 });
    border.forEach((chain) => slice.curve(chain, { colour: COLOURS.sky, width: 2 }));
  }
  function draw() {
    const found = Object.fromEntries(PICTURES.map((picture) => [picture, imageOf(picture)]));
    drawSlice(found[state.picture]);
    const errors = PICTURES.map((picture) => found[picture].error);
    const most = Math.max(...errors);
    // Names above their bars, values at the end of them.
    PICTURES.forEach((picture, k) => {
      const share = (0.72 * errors[k]) / most;
      const colour = picture === state.picture ? COLOURS.vermillion : COLOURS.grey;
      bars.text([0.01, k - 0.25], picture);
      bars.segments([[[0.01, k + 0.05], [0.01 + share, k + 0.05]]], { colour, width: 14 }); // prettier-ignore
      bars.text([0.04 + share, k + 0.15], `${digits(errors[k], 2)} mm`);
    });
    const contrast = state.noise ? digits((data.means.white - data.means.grey) / state.noise, 2) : "infinite";
    const rest = DEFECTS.map((name, k) => `${name} ${digits(errors[k + 1], 2)}`).join(", ");
    const status =
      `Voxels of ${state.size} mm, contrast to noise ${contrast}. Mean distance between the half-way border and the ` +
      `true one: ${digits(errors[0], 2)} mm for voxels alone; with ${rest}; with all ${digits(errors[4], 2)} mm.`;
    const { image } = found[state.picture];
    const mean = image.reduce((sum, value) => sum + value, 0) / image.length;
    const power = image.reduce((sum, value) => sum + value ** 2, 0) / image.length;
    const [plain, ...others] = errors;
    return {
      status,
      values: { mean, power, plain, ...Object.fromEntries(others.map((e, k) => [PICTURES[k + 1], e])) },
    };
  }
  figure.run({
    draw,
    controls: [
      { kind: "choice", key: "picture", label: "Picture", options: PICTURES },
      { kind: "choice", key: "size", label: "Voxels (mm)", options: data.sizes.map((size) => [size, `${size}`]) },
      { kind: "range", key: "blur", label: "blur, FWHM", min: 0, max: 4, step: 0.1, say: (mm) => `${mm} mm` },
      { kind: "range", key: "noise", label: "noise σ", min: 0, max: 60, step: 1 },
      { kind: "range", key: "bias", label: "bias", min: 0, max: 40, step: 1, say: (share) => `±${share} %` },
      { kind: "button", label: "other noise", press: () => (state.draw += 1) },
    ],
  });
}

function twoDigits(text) {
  return Array.from({ length: text.length / 2 }, (_, p) => Number(text.slice(2 * p, 2 * p + 2)) / 100);
}

// Partial volume: the mean signal of the small squares in each of n × n voxels.
function meanSignal(parts, fine, n) {
  const image = new Float64Array(n * n);
  const ratio = fine / n;
  for (const { mean, of } of parts) {
    of.forEach((share, p) => {
      const [i, k] = [Math.floor(p / fine), p % fine].map((index) => Math.floor(index / ratio));
      image[i * n + k] += (mean * share) / ratio ** 2;
    });
  }
  return image;
}

// A Gaussian along both axes, cut off at four standard deviations, with the image mirrored at its edges.
function blurred(image, n, sigma) {
  const radius = Math.floor(4 * sigma + 0.5);
  const raw = Array.from({ length: 2 * radius + 1 }, (_, k) => Math.exp(-0.5 * ((k - radius) / (sigma || 1)) ** 2));
  const total = raw.reduce((sum, value) => sum + value, 0);
  const mirror = (index) => {
    const folded = ((index % (2 * n)) + 2 * n) % (2 * n);
    return folded < n ? folded : 2 * n - 1 - folded;
  };
  const along = (values, stride, other) =>
    values.map((_, p) => {
      const [index, rest] = [Math.floor(p / stride) % n, Math.floor(p / other) % n];
      return raw.reduce(
        (sum, w, k) => sum + (w / total) * values[mirror(index + k - radius) * stride + rest * other],
        0,
      );
    });
  return along(along(image, n, 1), 1, n);
}

// Line segments at a level between the middles of voxels; where two high corners face each other they stay apart.
function crossingsOf(image, n, level) {
  const found = [];
  for (let i = 0; i < n - 1; i += 1) {
    for (let k = 0; k < n - 1; k += 1) {
      const corners = [[i, k], [i + 1, k], [i + 1, k + 1], [i, k + 1]]; // prettier-ignore
      const high = corners.map(([a, b]) => image[a * n + b] - level);
      const ways = [];
      corners.forEach((from, c) => {
        const d = (c + 1) % 4;
        if (high[c] > 0 !== high[d] > 0) {
          const share = high[c] / (high[c] - high[d]);
          const place = from.map((x, axis) => x + 0.5 + share * (corners[d][axis] - x));
          ways.push({ place, leaving: high[c] > 0 });
        }
      });
      // From each way out of a high corner back to the way into it.
      ways.forEach((way, w) => {
        if (way.leaving) {
          found.push([ways[(w + ways.length - 1) % ways.length].place, way.place]);
        }
      });
    }
  }
  return found;
}

// Mean distance of short pieces of each set of lines to the other set: the mean of the two means, in mm.
function distanceBetween(lines, others, side) {
  const means = [
    [lines, others],
    [others, lines],
  ].map(([from, to]) => {
    // prettier-ignore
    let [sum, length] = [0, 0];
    for (const [a, b] of from) {
      const long = Math.hypot(b[0] - a[0], b[1] - a[1]);
      const count = Math.ceil(long / PIECE) || 1;
      for (let k = 0; k < count; k += 1) {
        const place = a.map((x, axis) => x + ((k + 0.5) / count) * (b[axis] - x));
        if (place.every((x) => x > EDGE && x < side - EDGE)) {
          sum += (long / count) * nearestOn(to, place);
          length += long / count;
        }
      }
    }
    return sum / length;
  });
  return (means[0] + means[1]) / 2;
}

function nearestOn(lines, [x, y]) {
  let least = Infinity;
  for (const [[a, b], [c, d]] of lines) {
    const [u, v] = [c - a, d - b];
    const share = Math.max(0, Math.min(1, ((x - a) * u + (y - b) * v) / (u * u + v * v || 1)));
    least = Math.min(least, (x - a - share * u) ** 2 + (y - b - share * v) ** 2);
  }
  return Math.sqrt(least);
}
