import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";
import { ballWithin, onGrid, solidTopology, voxelGrid, wholePart } from "../../assets/voxels.js";

const THRESHOLDS = Array.from({ length: 19 }, (_, k) => 5 * (k + 1)); // in hundredths
const SIDES = [[1, 0], [-1, 0], [0, 1], [0, -1]]; // prettier-ignore
const TOUCH = ["a face, edge or corner", "a face"];

// A block of fractions: handles of its mask over the threshold, and the voxels that the repair gives up.
export function main(root, data) {
  const figure = panel(root, { threshold: 50, touch: TOUCH[0], priority: data.priority, slice: data.slice });
  const { state } = figure;
  const [nx, ny, nz] = data.shape;
  const grid = voxelGrid(data.shape);
  const fractions = onGrid(pairsOf(data.fractions), grid);
  const depths = onGrid(
    pairsOf(data.depths).map((value) => (value - 50) / 10),
    grid,
  );
  const priorities = {
    fraction: fractions.map((value, place) => value / 100 + 1e-6 * depths[place]),
    depth: depths,
    "depth and fraction": depths.map((depth, place) => depth + (data.weight * fractions[place]) / 100),
  };
  const slice = figure.plot({
    name: "a slice of the block: fractions, the mask, and the voxels given up",
    x: { range: [0, nx] },
    y: { range: [0, nz] },
    equal: true,
    width: 330,
  });
  const curve = figure.plot({
    name: "handles and components of the mask over the threshold",
    x: { range: [0, 1], label: "threshold" },
    y: { range: [0, 1], label: "number" },
    width: 330,
    height: 330,
  });

  const maskAt = (threshold) => Uint8Array.from(fractions, (value) => Number(value > threshold));
  const corners = () => state.touch === TOUCH[0];
  // One count for each threshold and way of touching, made when first asked for.
  const counts = {};
  function countsOf() {
    counts[state.touch] ??= THRESHOLDS.map((threshold) => solidTopology(maskAt(threshold), grid, corners()));
    return counts[state.touch];
  }
  // The place of a voxel of the slice.
  const at = (i, k) => (i + 1) * grid.strides[0] + (state.slice + 1) * grid.strides[1] + k + 1;
  const places = Array.from({ length: nx * nz }, (_, p) => [Math.floor(p / nz), p % nz]);
  function drawSlice(mask, whole, ball) {
    const unit = slice.at([1, 0])[0] - slice.at([0, 0])[0];
    for (let shade = 0; shade < 10; shade += 1) {
      const alike = places.filter(([i, k]) => Math.min(9, Math.floor(fractions[at(i, k)] / 10)) === shade);
      const grey = 20 + 24 * shade;
      slice.dots(alike.map(centre), { colour: `rgb(${grey}, ${grey}, ${grey})`, size: unit + 0.3, square: true });
    }
    const lost = places.filter(([i, k]) => whole[at(i, k)] && !ball[at(i, k)]);
    slice.dots(lost.map(centre), { colour: COLOURS.vermillion, size: 0.55 * unit, square: true });
    const inside = places.filter(([i, k]) => mask[at(i, k)]);
    const walls = inside.flatMap(([i, k]) =>
      SIDES.filter(([u, v]) => !mask[at(i + u, k + v)]).map(([u, v]) =>
        [1, -1].map((sign) => [i + 0.5 + (u + sign * v) / 2, k + 0.5 + (v + sign * u) / 2]),
      ),
    );
    slice.segments(walls, { colour: COLOURS.sky, width: 2.5 });
  }
  function drawCurve(found) {
    const most = Math.max(...found.flatMap(({ handles, components }) => [handles, components]));
    curve.rescale([0, most + 1]);
    for (const [key, colour] of [
      ["components", COLOURS.blue],
      ["handles", COLOURS.vermillion],
    ]) {
      const points = found.map((one, k) => [THRESHOLDS[k] / 100, one[key]]);
      curve.curve(points, { colour, width: 2 });
      curve.dots(points, { colour, size: 6, square: key === "components" });
    }
    const k = THRESHOLDS.indexOf(state.threshold);
    curve.segments([[[state.threshold / 100, 0], [state.threshold / 100, most + 1]]], { colour: COLOURS.black, dash: "4 3" }); // prettier-ignore
    curve.dots([[state.threshold / 100, found[k].handles]], { colour: COLOURS.vermillion, size: 13 });
    curve.text([0.03, most + 0.6], "● handles", { fill: COLOURS.vermillion });
    curve.text([0.97, most + 0.6], "■ components", { fill: COLOURS.blue, "text-anchor": "end" });
  }
  function draw() {
    const mask = maskAt(state.threshold);
    const found = countsOf();
    const { components, cavities, handles } = found[THRESHOLDS.indexOf(state.threshold)];
    const whole = wholePart(mask, grid);
    const ball = ballWithin(whole, priorities[state.priority], grid);
    const size = sum(whole);
    const lost = size - sum(ball);
    drawSlice(mask, whole, ball);
    drawCurve(found);
    const status =
      `Threshold ${state.threshold / 100}, voxels connected by ${state.touch}: ${many(components, "component")}, ` +
      `${many(handles, "handle")}, ${many(cavities, "cavity")}. The repair by ${state.priority} keeps ` +
      `${(size - lost).toLocaleString("en")} of ${size.toLocaleString("en")} voxels of the largest part, without any ` +
      `handle, and gives up ${lost}.`;
    return { status, values: { components, cavities, handles, size, lost } };
  }
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "threshold",
        label: "threshold",
        min: THRESHOLDS[0],
        max: THRESHOLDS.at(-1),
        step: 5,
        say: (value) => `${value / 100}`,
      },
      { kind: "range", key: "slice", label: "slice", min: 0, max: ny - 1, step: 1, say: (k) => `${k + 1} of ${ny}` },
      { kind: "choice", key: "touch", label: "Voxels are connected by", options: TOUCH },
      { kind: "choice", key: "priority", label: "Priority of the repair", options: Object.keys(priorities) },
    ],
  });
}

// Numbers of two digits, one after another.
function pairsOf(text) {
  return Array.from({ length: text.length / 2 }, (_, k) => Number(text.slice(2 * k, 2 * k + 2)));
}

function sum(values) {
  return values.reduce((total, value) => total + value, 0);
}

function centre([i, k]) {
  return [i + 0.5, k + 0.5];
}

function many(n, word) {
  return `${n} ${n === 1 ? word : `${word}s`.replace("ys", "ies")}`;
}
