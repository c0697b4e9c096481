import { integrate } from "../../assets/flow.js";
import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";
import { crossingPairs, cut, velocities } from "../../assets/triangles.js";

const LOOKS = [COLOURS.blue, COLOURS.orange];

// Two triangles under a flow of their points: time, Euler steps, strength of the field, and the pieces of each side.
export function main(root, data) {
  const figure = panel(root, { field: "push", time: data.time, steps: data.steps, pieces: 0, strength: 1 });
  const { state } = figure;
  const plane = figure.plot({
    name: "two triangles under the flow",
    x: { range: [-1.6, 1.6] },
    y: { range: [-2.04, 1.4] },
    width: 480,
    equal: true,
  });
  const fine = Array.from({ length: 51 }, (_, i) => -2 + i / 12.5);
  const grid = Array.from({ length: 13 }, (_, k) => (k - 6) / 3).flatMap((at) => [
    fine.map((s) => [at, s]),
    fine.map((s) => [s, at]),
  ]);

  function draw() {
    const field = data.fields[state.field];
    const scaled = { ...field, strength: field.strength * state.strength };
    const velocity = (point) => velocities[state.field](scaled, point);
    const moved = (points) => integrate(velocity, points, { time: state.time, steps: state.steps });
    // A browser paints one long path of all lines much more slowly, and transparent ones, too.
    grid.forEach((line) => plane.segments([moved(line)], { colour: COLOURS.grey, width: 0.5 }));
    const shapes = data.corners.map((corners) => moved(cut(corners, 2 ** state.pieces)));
    shapes.forEach((shape, k) => {
      plane.area(shape, { colour: LOOKS[k], opacity: 0.35 });
      plane.outline(shape, { colour: LOOKS[k], width: 2.5 });
      plane.outline(moved(cut(data.corners[k], 64)), { colour: COLOURS.black, width: 1.2, dash: "2 4" });
      plane.dots(shape, { colour: COLOURS.black, size: state.pieces > 4 ? 3 : 6 });
    });
    const pairs = crossingPairs(shapes);
    const bound = (state.time / state.steps) * field.lipschitz * state.strength;
    const points = bound < 1 ? "below 1: no two points of the plane meet" : "not below 1: points may meet";
    const many = pairs === 1 ? "One pair" : pairs + " pairs";
    const sides = pairs ? `${many} of straight sides cross.` : "No sides cross.";
    return {
      status: `Step times Lipschitz constant: ${bound.toFixed(3)}, ${points}. ${sides}`,
      values: { pairs, bound },
    };
  }
  figure.run({
    draw,
    play: {
      perSecond: 25,
      step() {
        state.time = state.time >= 1 ? 0 : Math.min(1, state.time + 0.01);
        return state.time < 1;
      },
    },
    controls: [
      {
        kind: "choice",
        key: "field",
        label: "What moves the points",
        options: [
          ["push", "a push down the middle"],
          ["whirl", "a whirl about the middle"],
        ],
      },
      { kind: "range", key: "time", label: "time", min: 0, max: 1, step: 0.01, say: (time) => time.toFixed(2) },
      { kind: "range", key: "steps", label: "Euler steps", min: 1, max: 64, step: 1 },
      { kind: "range", key: "strength", label: "strength", min: 0.25, max: 2, step: 0.25, say: (k) => `× ${k}` },
      { kind: "range", key: "pieces", label: "pieces of each side", min: 0, max: 5, step: 1, say: (k) => `${2 ** k}` },
    ],
  });
}
