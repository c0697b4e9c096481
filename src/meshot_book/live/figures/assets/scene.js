import { assignment, groundCosts } from "../../assets/assignment.js";
import { chamferLoss } from "../../assets/nearest.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { slicedLoss } from "../../assets/projection.js";
import { sinkhornLoss } from "../../assets/sinkhorn.js";

const LOSSES = ["Chamfer", "exact", "Sinkhorn", "sliced"];
const FAR = 150; // a reach from which on exact transport is whole
const END = { "text-anchor": "end" };
const TOLERANCE = 1e-5; // of Sinkhorn's potentials: the cost is then right to seven digits

// One scene of points, and the arrows of four losses: descent directions in mm.
export function main(root, data) {
  const figure = panel(root, {
    scene: data.scene,
    target: data.scenes[data.scene].target,
    flipped: data.scenes[data.scene].flipped,
    normals: false,
    blur: data.blur,
    reach: FAR,
    chosen: 0,
  });
  const { state } = figure;
  const small = root.clientWidth < 500;
  const plots = LOSSES.map((name) =>
    figure.plot({
      name: `arrows of ${name} on the moving points`,
      x: { range: [-50, 128] },
      y: { range: [-60, 62] },
      title: name === "exact" ? "exact transport" : name,
      width: small ? 172 : 310,
      equal: true,
    }),
  );
  let starts = [];

  const source = () => data.scenes[state.scene].source;
  // With normals, a point has four coordinates: its position, and its normal times the normal scale. A point that is
  // moved keeps its normal.
  function lifted(points, first, flipped) {
    if (!state.normals) {
      return points;
    }
    return points.map((point, i) => {
      const size = ((flipped[i] ? -1 : 1) * data.normal_scale) / Math.hypot(...first[i]);
      return [...point, size * first[i][0], size * first[i][1]];
    });
  }
  function partialLoss(x, y) {
    const costs = groundCosts(x, y, 2);
    const most = state.reach < FAR ? state.reach ** 2 : Infinity;
    const { columns, cost } = assignment(costs.map((row) => row.map((value) => Math.min(value, most))));
    const gradient = x.map((point, i) => {
      const j = columns[i];
      return point.map((value, k) => (costs[i][j] < most ? (2 * (value - y[j][k])) / x.length : 0));
    });
    return { cost: cost / x.length, gradient };
  }
  function losses(x, y) {
    const d = x[0].length;
    const smooth = sinkhornLoss(x, y, { blur: state.blur, tolerance: TOLERANCE, starts });
    starts = smooth.potentials;
    const lines = slicedLoss(x, y, data.lines[d]);
    // Each in the unit of a shift: a single point with a single partner has the same arrow under all of them.
    return [
      [chamferLoss(x, y), 1 / 2],
      [partialLoss(x, y), 1],
      [smooth, 1],
      [lines, d],
    ].map(([{ cost, gradient }, factor]) => ({
      shift: Math.sqrt(Math.max(0, factor * cost)),
      // Positions only: the part of a gradient in the normals is not drawn.
      arrows: gradient.map((row) => row.slice(0, 2).map((value) => (-factor * x.length * value) / 2)),
    }));
  }
  function draw() {
    const x = lifted(source(), source(), []);
    const y = lifted(state.target, data.scenes[state.scene].target, state.flipped);
    const found = losses(x, y);
    const values = { points: x.length };
    found.forEach(({ shift, arrows }, k) => {
      const plot = plots[k];
      const moved = arrows.filter((arrow) => Math.hypot(...arrow) > 1).length;
      plot.dots(state.target, { colour: COLOURS.grey, size: small ? 5 : 7, square: true });
      if (state.normals) {
        plot.arrows(
          state.target,
          y.map((point) => point.slice(2)),
          { colour: COLOURS.grey, width: 1 },
        );
      }
      plot.dots(source(), { colour: COLOURS.blue, size: small ? 3.5 : 5 });
      plot.arrows(source(), arrows, { colour: COLOURS.vermillion, width: small ? 1.2 : 1.6 });
      const count = `${moved} point${moved === 1 ? "" : "s"}`;
      const words = [`${digits(shift)} mm`, small ? count : `${count} by more than 1 mm`];
      words.forEach((text, row) => plot.text([126, (small ? -38 : -46) - row * (small ? 18 : 11)], text, END));
      values[`${LOSSES[k]}Shift`] = shift;
      values[`${LOSSES[k]}Moved`] = moved;
      values[`${LOSSES[k]}Longest`] = Math.max(...arrows.map((arrow) => Math.hypot(...arrow)));
    });
    const list = (key, unit) => LOSSES.map((name) => `${name} ${digits(values[name + key])}`).join(", ") + unit;
    const reach = state.reach < FAR ? ` Exact transport matches partners within ${state.reach} mm only.` : "";
    const status =
      `Equivalent shift: ${list("Shift", " mm")}. ` +
      `Points with an arrow longer than 1 mm: ${list("Moved", ` of ${x.length}`)}.${reach}`;
    return { status, values };
  }
  plots.forEach((plot, k) =>
    figure.movable(plot, {
      key: "target",
      name: `target points, under ${LOSSES[k]}`,
      points: () => state.target,
      step: 2,
      reach: small ? 10 : 15,
      choose: (i) => (state.chosen = i),
      move: (i, [u, v]) => (state.target[i] = [Math.min(126, Math.max(-48, u)), Math.min(48, Math.max(-48, v))]),
      say: (i) => `at ${state.target[i].map(Math.round).join(", ")} mm`,
    }),
  );
  figure.run({
    draw,
    changed(key) {
      starts = ["target", "chosen"].includes(key) ? starts : [];
      if (key === "scene") {
        const { target, flipped } = structuredClone(data.scenes[state.scene]);
        Object.assign(state, { target, flipped, normals: flipped.includes(true) });
      }
    },
    controls: [
      { kind: "choice", key: "scene", label: "Scene", options: Object.keys(data.scenes) },
      { kind: "range", key: "blur", label: "blur of Sinkhorn", min: 5, max: 60, step: 5, say: (mm) => `${mm} mm` },
      {
        kind: "range",
        key: "reach",
        label: "reach of exact transport",
        min: 10,
        max: FAR,
        step: 10,
        say: (mm) => (mm < FAR ? `${mm} mm` : "any"),
      },
      { kind: "check", key: "normals", label: "compare normals" },
      {
        kind: "button",
        label: "flip the normal of the chosen point",
        press: () => (state.flipped[state.chosen] = !state.flipped[state.chosen]),
        when: () => state.normals,
      },
    ],
  });
}
