import { contourDistance, contourLoss, descentDirections, edgesOf, edgeVariation } from "../../assets/contours.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle } from "../../assets/projection.js";

const LOSSES = { Chamfer: COLOURS.vermillion, "sliced Wasserstein": COLOURS.blue };
// A move to the partner in both: Chamfer counts every squared distance twice, the sliced loss half of it.
const UNITS = { Chamfer: 0.5, "sliced Wasserstein": 2 };
const LAST = 300;

// A circle that descends on two losses to a folded contour: how near it comes, and how even its edges stay.
export function main(root, data) {
  const names = Object.keys(LOSSES);
  const figure = panel(root, { start: "even", rate: 0.1, width: 0, arrows: false });
  const { state } = figure;
  const target = edgesOf(data.target);
  const lines = Array.from({ length: data.lines }, (_, k) => atAngle((Math.PI * (k + 0.5)) / data.lines));
  const runs = {};
  const plots = names.map((name) =>
    figure.plot({ name, title: name, x: { range: [-54, 54] }, y: { range: [-54, 54] }, width: 270, equal: true }),
  );
  const chart = figure.plot({
    name: "edge variation over the distance from the target",
    x: { range: [0.1, 10], log: true, ticks: [0.1, 1, 10], label: "distance from the target (mm)" },
    y: { range: [0, 0.6], label: "edge variation" },
    width: 380,
    height: 320,
  });

  const judged = (vertices) => [contourDistance(vertices, data.target), edgeVariation(vertices)];
  function begin() {
    for (const name of names) {
      const vertices = data.starts[state.start];
      runs[name] = { vertices, path: [judged(vertices)] };
    }
  }
  function arrowsOf(name) {
    const { vertices } = runs[name];
    const { gradient } = contourLoss(name, vertices, target, lines);
    return descentDirections(vertices, gradient, state.width).map((g) => g.map((value) => UNITS[name] * value));
  }
  function step() {
    for (const name of names) {
      const arrows = arrowsOf(name);
      const vertices = runs[name].vertices.map((x, i) => x.map((value, c) => value + state.rate * arrows[i][c]));
      runs[name] = { vertices, path: [...runs[name].path, judged(vertices)] };
    }
    return runs[names[0]].path.length <= LAST;
  }

  function draw() {
    names.forEach((name, k) => {
      const { vertices } = runs[name];
      plots[k].area(data.target, { colour: COLOURS.grey, opacity: 0.25 });
      plots[k].outline(vertices, { colour: LOSSES[name], width: 2 });
      plots[k].dots(vertices, { colour: LOSSES[name], size: 6 });
      if (state.arrows) {
        plots[k].arrows(vertices, arrowsOf(name), { colour: COLOURS.black, width: 1 });
      }
      chart.curve(runs[name].path, { colour: LOSSES[name], width: 2, dash: k ? "6 3" : undefined });
      chart.dots(runs[name].path.slice(-1), { colour: LOSSES[name], size: 10, square: k === 1 });
    });
    const ends = names.map((name) => runs[name].path.at(-1));
    // Both are compared where they first came as near as the one that is now farther away.
    const level = Math.max(...ends.map(([distance]) => distance));
    const [ofChamfer, ofSliced] = names.map((name) => runs[name].path.find(([distance]) => distance <= level)[1]);
    const count = runs[names[0]].path.length - 1;
    const words = names.map((name, k) => `${name} ${digits(ends[k][0])} mm, edge variation ${ends[k][1].toFixed(3)}`);
    const compared = `At equal distance, ${digits(level)} mm: ${ofChamfer.toFixed(3)} and ${ofSliced.toFixed(3)}.`;
    return {
      status: `After ${count} steps: ${words.join("; ")}. ${count ? compared : "Press play or step."}`,
      values: {
        count,
        level,
        ...Object.fromEntries(["chamfer", "sliced"].map((key, k) => [key, ends[k][0]])),
        chamferVaries: ends[0][1],
        slicedVaries: ends[1][1],
        chamferAtLevel: ofChamfer,
        slicedAtLevel: ofSliced,
      },
    };
  }
  figure.run({
    draw,
    changed(key) {
      if (key !== "arrows") {
        begin();
      }
    },
    play: { step, perSecond: 15 },
    controls: [
      {
        kind: "choice",
        key: "start",
        label: "edges of the circle at the start",
        options: [
          ["even", "even"],
          ["uneven", "uneven"],
        ],
      },
      {
        kind: "range",
        key: "rate",
        label: "step size",
        min: 0.02,
        max: 0.16,
        step: 0.02,
        say: (rate) => rate.toFixed(2),
      },
      {
        kind: "range",
        key: "width",
        label: "directions averaged over",
        min: 0,
        max: 2,
        step: 0.5,
        say: (w) => (w ? `± ${w} edges` : "nothing"),
      },
      { kind: "check", key: "arrows", label: "show the directions" },
      { kind: "button", label: "start again", press: begin },
    ],
  });
}
