import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const REACH = 15; // mm along the normal
const LOOKS = [COLOURS.vermillion, COLOURS.orange, COLOURS.purple];

// A vertex near the true border of a slice, and the cubes of voxels that the network cuts out around it.
export function main(root, data) {
  const figure = panel(root, { along: data.along, offset: data.offset });
  const { state } = figure;
  const levels = data.levels.map(({ values, ...level }) => ({
    ...level,
    values: Array.from({ length: values.length / 2 }, (_, p) => Number(values.slice(2 * p, 2 * p + 2)) / 100),
  }));
  const ring = Array.from({ length: data.border.length / 2 }, (_, p) => data.border.slice(2 * p, 2 * p + 2));
  const side = data.size;
  const { low, high } = data.view;
  const slice = figure.plot({
    name: "a slice of the scan, the true border, a vertex and its cubes",
    x: { range: [low[0], high[0]] },
    y: { range: [low[1], high[1]] },
    equal: true,
    width: 360,
  });
  const curve = figure.plot({
    name: "range of the values in each cube, over the position along the normal",
    x: { range: [-REACH, REACH], label: "mm outside the border" },
    y: { range: [0, 1], label: "largest − smallest value" },
    width: 300,
    height: 330,
  });
  const patches = figure.plot({
    name: "the middle planes of the cubes",
    x: { range: [-0.6, levels.length * (side + 1) - 0.4] },
    y: { range: [-1.6, side - 0.2] },
    equal: true,
    width: 660,
  });

  // The position on the border, and the unit normal that points out of the ring, which runs anticlockwise.
  function frameAt(along) {
    const n = ring.length;
    const from = ring[(along + n - data.smooth) % n];
    const to = ring[(along + data.smooth) % n];
    const [u, v] = [to[0] - from[0], to[1] - from[1]];
    const length = Math.hypot(u, v) || 1;
    return { foot: ring[along], normal: [v / length, -u / length] };
  }
  function placeAt(offset) {
    const { foot, normal } = frameAt(state.along);
    return foot.map((x, axis) => x + offset * normal[axis]);
  }
  // Values of a level at the voxels of the cube around a place, in its middle plane: linear between voxels.
  function patchOf({ values, shape, origin, step }, place) {
    const half = (side - 1) / 2;
    const centre = place.map((x, axis) => (x - origin[axis]) / step[axis]);
    const at = (i, k) => (i >= 0 && k >= 0 && i < shape[0] && k < shape[1] ? values[i * shape[1] + k] : 0);
    return Array.from({ length: side * side }, (_, p) => {
      const [x, z] = [centre[0] + Math.floor(p / side) - half, centre[1] + (p % side) - half];
      const [i, k] = [Math.floor(x), Math.floor(z)];
      const [u, v] = [x - i, z - k];
      const lower = (1 - u) * at(i, k) + u * at(i + 1, k);
      return (1 - v) * lower + v * ((1 - u) * at(i, k + 1) + u * at(i + 1, k + 1));
    });
  }
  const rangeOf = (level, place) => {
    const patch = patchOf(level, place);
    return Math.max(...patch) - Math.min(...patch);
  };
  const holds = ({ step }, place) =>
    ring.some((point) => point.every((x, axis) => Math.abs(x - place[axis]) <= (side / 2) * step[axis]));

  function drawSlice(place) {
    const { values, shape, origin, step } = levels[0];
    const unit = slice.at([step[0], 0])[0] - slice.at([0, 0])[0];
    const shades = Array.from({ length: 20 }, () => []);
    values.forEach((value, p) => {
      const at = [Math.floor(p / shape[1]), p % shape[1]].map((index, axis) => origin[axis] + index * step[axis]);
      if (at.every((x, axis) => x >= low[axis] && x <= high[axis])) {
        shades[Math.min(19, Math.floor(20 * value))].push(at);
      }
    });
    shades.forEach((places, shade) => {
      const grey = Math.round((255 * (shade + 0.5)) / 20);
      slice.dots(places, { colour: `rgb(${grey}, ${grey}, ${grey})`, size: unit + 0.4, square: true });
    });
    slice.outline(ring, { colour: COLOURS.sky, width: 1.5 });
    slice.segments([[placeAt(-REACH), placeAt(REACH)]], { colour: COLOURS.green, width: 1, dash: "4 3" }); // prettier-ignore
    levels.forEach((level, s) => {
      const [u, v] = level.step.map((width) => (side / 2) * width);
      const corners = [[-u, -v], [u, -v], [u, v], [-u, v]]; // prettier-ignore
      slice.outline(
        corners.map(([a, b]) => [place[0] + a, place[1] + b]),
        { colour: LOOKS[s], width: 2.5 },
      );
    });
    slice.dots([place], { colour: COLOURS.green, size: 11 });
  }
  function drawPatches(place) {
    const unit = patches.at([1, 0])[0] - patches.at([0, 0])[0];
    levels.forEach((level, s) => {
      const left = s * (side + 1);
      patches.outline(
        [[-0.55, -0.55], [side - 0.45, -0.55], [side - 0.45, side - 0.45], [-0.55, side - 0.45]].map(([a, b]) => [left + a, b]), // prettier-ignore
        { colour: LOOKS[s], width: 3 },
      );
      patchOf(level, place).forEach((value, p) => {
        const grey = Math.round(255 * Math.min(1, value));
        const at = [left + Math.floor(p / side), p % side];
        patches.dots([at], { colour: `rgb(${grey}, ${grey}, ${grey})`, size: 0.95 * unit, square: true });
      });
      patches.text([left + (side - 1) / 2, -1.35], `${digits(level.step[0] * side)} mm`, { "text-anchor": "middle" });
    });
  }
  function draw() {
    const place = placeAt(state.offset);
    drawSlice(place);
    drawPatches(place);
    const ticks = Array.from({ length: 61 }, (_, k) => (k / 30 - 1) * REACH);
    levels.forEach((level, s) => {
      const look = { colour: LOOKS[s], width: 2.5 };
      curve.curve(ticks.map((offset) => [offset, rangeOf(level, placeAt(offset))]), look); // prettier-ignore
    });
    curve.segments([[[state.offset, 0], [state.offset, 1]]], { colour: COLOURS.black, dash: "4 3" }); // prettier-ignore
    const inside = levels.map((level) => holds(level, place));
    const ranges = levels.map((level) => rangeOf(level, place));
    const words = levels.map(
      ({ step }, s) =>
        `${digits(step[0] * side)} mm: ${inside[s] ? "border inside" : "no border"}, range ${digits(ranges[s], 2)}`,
    );
    const where = state.offset < 0 ? "inside" : "outside";
    const status = `The vertex is ${digits(Math.abs(state.offset))} mm ${where} the border. Cubes of ${words.join("; ")}.`;
    const named = Object.fromEntries(levels.flatMap((_, s) => [[`range${s}`, ranges[s]], [`holds${s}`, Number(inside[s])]])); // prettier-ignore
    return { status, values: { x: place[0], z: place[1], ...named } };
  }
  // The nearest position on the border, and how far outside of it a place lies.
  function moveTo(place) {
    const away = ring.map((point) => Math.hypot(place[0] - point[0], place[1] - point[1]));
    state.along = away.indexOf(Math.min(...away));
    const { foot, normal } = frameAt(state.along);
    const offset = normal.reduce((sum, x, axis) => sum + x * (place[axis] - foot[axis]), 0);
    state.offset = Math.max(-REACH, Math.min(REACH, offset));
  }
  figure.movable(slice, {
    key: "along",
    name: "the vertex",
    step: 0.5,
    points: () => [placeAt(state.offset)],
    move: (_, place) => moveTo(place),
    say: () => `${state.offset.toFixed(1)} mm outside the border`,
  });
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "offset",
        label: "along the normal",
        min: -REACH,
        max: REACH,
        step: 0.5,
        say: (mm) => `${digits(mm)} mm`,
      },
      { kind: "range", key: "along", label: "along the border", min: 0, max: ring.length - 1, step: 1 },
    ],
  });
}
