import { exactLoss } from "../../assets/assignment.js";
import { orthogonalDirections } from "../../assets/frames.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { generator } from "../../assets/random.js";

const [CELLS, SIDE] = [8, 20]; // a sheet of 8 × 8 squares, each of two triangles, in mm
const POWERS = Array.from({ length: 25 }, (_, k) => (k - 12) / 12); // of ten: lengths of the curves
const [EXACT, SLICED] = [COLOURS.green, COLOURS.blue];

// A blade and a slit: their distance, and the arrows on the blade, over the length of the normals.
export function main(root, data) {
  const figure = panel(root, { power: data.power, gap: data.gap });
  const { state } = figure;
  const scene = figure.plot({
    name: "blade and slit from the side, with the arrows on the blade",
    x: { range: [-11, 15], label: "across the sheets (mm)", ticks: [-10, -5, 0, 5, 10, 15] },
    y: { range: [-0.4, 10.8] },
    width: 640,
    height: 250,
  });
  const over = { range: [0.1, 10], log: true, label: "length of a normal (mm)" };
  const look = { width: 310, height: 290 };
  const values = figure.plot({
    name: "squared distance over the length of a normal",
    x: over,
    y: { range: [0.005, 30], log: true, label: "squared distance (mm²)" },
    ...look,
  });
  const ways = figure.plot({
    name: "share of the way across the gap, over the length of a normal",
    x: over,
    y: { range: [0, 1.05], label: "share of the way across" },
    ...look,
  });
  const lines = orthogonalDirections(data.lines, 6, generator(data.seed));
  const sheet = barycentres();
  let bases = []; // for each line, the sorted projections of one sheet
  let curves = [];

  // The sheets on a line are one sorted list with two shifts: merging takes a tenth of the time of sorting.
  function slicedAt(length) {
    const sums = [0, 0];
    const n = sheet.length;
    lines.forEach((line, l) => {
      const [turn, across] = [length * line[3], state.gap * line[0]];
      merge(bases[l], [-turn, across + turn], [turn, across - turn], (gap, back) => {
        sums[0] += gap * gap;
        sums[1] -= back ? 2 * gap * line[0] : 0;
      });
    });
    const [cost, pull] = sums.map((sum) => (6 * sum) / (2 * n * lines.length));
    return { cost, share: pull / state.gap };
  }
  function exactAt(length) {
    const heights = [0, 1, 2, 3];
    const side = (sign) =>
      [-1, 1].flatMap((face) => heights.map((y) => [face > 0 ? state.gap : 0, 10 * y, 0, sign * face * length, 0, 0]));
    const { cost, gradient } = exactLoss(side(1), side(-1));
    const pull = -heights.reduce((sum, i) => sum + gradient[i][0], 0);
    return { cost, share: pull / state.gap };
  }
  function sweep() {
    bases = lines.map((line) => Float64Array.from(sheet, ([y, z]) => line[1] * y + line[2] * z).sort());
    // On both sides of the jump, too.
    const powers = [...POWERS, ...[-1e-6, 1e-6].map((step) => Math.log10(state.gap / 2) + step)].sort((a, b) => a - b);
    curves = [slicedAt, exactAt].map((at) => powers.map((power) => [10 ** power, at(10 ** power)]));
  }
  function drawScene(length, found) {
    const { gap } = state;
    ["exact transport", "sliced loss"].forEach((name, row) => {
      const low = 5.6 * (1 - row);
      for (const [x, sign] of [
        [0, -1],
        [gap, 1],
      ]) {
        scene.segments([[[x, low], [x, low + 4.2]]], { colour: COLOURS.black, width: 3 }); // prettier-ignore
        scene.arrows([[x, low + 3.6]], [[sign * length, 0]], { colour: COLOURS.black, width: 1.5 });
        scene.arrows([[x, low + 2.6]], [[-sign * length, 0]], { colour: COLOURS.grey, width: 1.5 });
        const way = -sign * gap * found[row].share;
        scene.arrows([[x, low + 1]], [[way, 0]], { colour: [EXACT, SLICED][row], width: 4 });
      }
      scene.text([-11, low + 1], name);
    });
    scene.text([15, 9.2], "normals of the blade", { "text-anchor": "end" });
    scene.text([15, 8.2], "normals of the slit", { "text-anchor": "end", fill: COLOURS.grey });
    scene.text([15, 6.6], "arrows on the blade", { "text-anchor": "end", fill: EXACT });
  }
  function draw() {
    const length = 10 ** state.power;
    const found = [exactAt(length), slicedAt(length)];
    const tie = Math.abs(2 * length - state.gap) < 1e-9;
    drawScene(length, found);
    const half = state.gap / 2;
    for (const { plot, key, ends } of [
      { plot: values, key: "cost", ends: [0.005, 30] },
      { plot: ways, key: "share", ends: [0, 1] },
    ]) {
      plot.segments([ends.map((end) => [half, end])], { colour: COLOURS.grey, dash: "4 4" });
      for (const k of [1, 0]) {
        const curve = curves[k].map(([at, one]) => [at, one[key]]);
        plot.curve(curve, { colour: [SLICED, EXACT][k], width: 2.5, dash: k ? "" : "8 4" });
      }
      plot.dots([[length, found[0][key]]], { colour: EXACT, size: 11 });
      plot.dots([[length, found[1][key]]], { colour: SLICED, size: 11, square: true });
    }
    values.text([0.12, 12], "exact", { fill: EXACT });
    values.text([0.3, 0.011], "sliced, times 6", { fill: SLICED });
    const status =
      `Normals of ${digits(length, 2)} mm, gap ${state.gap} mm. Squared distance: exact ${digits(found[0].cost)} mm², ` +
      `sliced (times 6) ${digits(found[1].cost)} mm². Way across the gap: exact ` +
      `${tie ? "undecided, for both plans cost the same" : percent(found[0].share)}, sliced ${percent(found[1].share)}.`;
    const [exact, sliced] = found;
    const shown = { exact: exact.cost, exactShare: exact.share, sliced: sliced.cost, slicedShare: sliced.share };
    return { status, values: { ...shown, length } };
  }
  figure.run({
    draw,
    changed: (key) => key !== "power" && sweep(),
    controls: [
      {
        kind: "range",
        key: "power",
        label: "length of a normal",
        min: -1,
        max: 1,
        step: 0.05,
        say: (power) => `${digits(10 ** power, 2)} mm`,
      },
      { kind: "choice", key: "gap", label: "Gap", options: [1, 2, 4].map((gap) => [gap, `${gap} mm`]) },
    ],
  });
}

function percent(share) {
  return `${digits(100 * share, 2)} %`;
}

// Of the triangles of a sheet.
function barycentres() {
  const size = SIDE / CELLS;
  const cells = Array.from({ length: CELLS ** 2 }, (_, k) => [k % CELLS, Math.floor(k / CELLS)]);
  return cells.flatMap(([i, j]) => [
    [size * (i + 2 / 3), size * (j + 1 / 3)],
    [size * (i + 1 / 3), size * (j + 2 / 3)],
  ]);
}

// Two lists on a line, each the same sorted numbers with two shifts: the gap at every rank, and whether the number of the
// first list comes from its first shift.
function merge(base, first, second, at) {
  const n = base.length;
  let [i, j, k, l] = [0, 0, 0, 0];
  for (let rank = 0; rank < 2 * n; rank += 1) {
    const back = j === n || (i < n && base[i] + first[0] <= base[j] + first[1]);
    const x = back ? base[i++] + first[0] : base[j++] + first[1];
    const y = l === n || (k < n && base[k] + second[0] <= base[l] + second[1]) ? base[k++] + second[0] : base[l++] + second[1]; // prettier-ignore
    at(x - y, back);
  }
}
