import { exactLoss, groundCosts } from "../../assets/assignment.js";
import { equalMasses } from "../../assets/nearest.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { entropicTransport } from "../../assets/sinkhorn.js";

const BLURS = [10, 14, 20, 28, 40, 57, 80, 140, 200, 400];
const RATE = 0.5; // of an arrow, in one step
const SHARES = [0.5, 0.2, 0.08, 0.03]; // of a point's mass: a line of the plan is drawn for more than the last

// Entropic transport between points on two circles: the plan, the arrows, the value, and what debiasing changes.
export function main(root, data) {
  const figure = panel(root, { points: data.points, blur: Math.log10(data.blur), debiased: false, show: "arrows" });
  const { state } = figure;
  const { target } = data;
  const range = data.range.map((value) => [-value, value]);
  const plane = figure.plot({
    name: "points, the target, and arrows or the plan",
    x: { range: range[0] },
    y: { range: range[1] },
    width: 340,
    equal: true,
  });
  const values = figure.plot({
    name: "the cost and the divergence over the blur",
    x: { range: [9, 440], log: true, label: "blur (mm)", ticks: [10, 20, 50, 100, 200, 400] },
    y: { range: [0, 1], label: "cost of the plan, divergence (mm²)" },
    width: 340,
    height: 330,
  });
  let now = state.points;
  let steps = 0;
  let chosen = 0;
  let moved = Infinity;

  const blurNow = () => 10 ** state.blur;
  const ofTarget = new Map();
  function solve(points, blur) {
    if (!ofTarget.has(blur)) {
      ofTarget.set(blur, solved(target, target, blur).cost);
    }
    const [there, own] = [solved(points, target, blur), solved(points, points, blur)];
    return { there, own, plain: there.cost, divergence: there.cost - (own.cost + ofTarget.get(blur)) / 2 };
  }
  // To the mean of the partners; with debiasing from the mean of the partners that a point has in its own measure.
  function arrowsOf(points, { there, own }) {
    const means = [meansOf(there.plan, target), meansOf(own.plan, points)];
    return points.map((point, i) =>
      point.map((value, k) => means[0][i][k] - (state.debiased ? means[1][i][k] : value)),
    );
  }
  function step() {
    const arrows = arrowsOf(now, solve(now, blurNow()));
    now = now.map((point, i) => point.map((value, k) => value + RATE * arrows[i][k]));
    moved = RATE * Math.max(...arrows.map((arrow) => Math.hypot(...arrow)));
    steps += 1;
    return moved > 1e-4 && steps < 500;
  }
  function restart() {
    [now, steps, moved] = [state.points, 0, Infinity];
  }
  let courses = [];
  function drawPlan({ plan }) {
    const rows = state.show === "plan" ? plan.keys() : [chosen];
    const lines = SHARES.map(() => []);
    for (const i of rows) {
      plan[i].forEach((mass, j) => {
        const level = SHARES.findIndex((share) => mass * plan.length >= share);
        if (level >= 0) {
          lines[level].push([now[i], target[j]]);
        }
      });
    }
    lines.forEach((pairs, k) => plane.segments(pairs, { colour: COLOURS.blue, width: 3.2 - 0.8 * k, opacity: 0.8 - 0.17 * k })); // prettier-ignore
  }
  function draw() {
    const found = solve(now, blurNow());
    const arrows = arrowsOf(now, found);
    plane.dots(target, { colour: COLOURS.grey, size: 7, square: true });
    if (state.show === "arrows") {
      plane.arrows(now, arrows, { colour: COLOURS.blue });
    } else {
      drawPlan(found.there);
    }
    plane.dots(now, { colour: COLOURS.orange, size: 9 });
    const exact = exactLoss(now, target).cost;
    values.rescale([0, 1.08 * Math.max(...courses.map(([, plain]) => plain), found.plain)]);
    ["plain", "divergence"].forEach((key, k) => {
      const look = { colour: k ? COLOURS.green : COLOURS.vermillion, width: 2, dash: k ? "7 4" : "" };
      values.curve(
        courses.map((row) => [row[0], row[k + 1]]),
        look,
      );
      values.dots([[blurNow(), found[key]]], { ...look, size: 11 });
    });
    values.segments([[[9, exact], [440, exact]]], { colour: COLOURS.grey, dash: "2 4" }); // prettier-ignore
    values.text([11, 0.93 * courses.at(-1)[1]], "with its bias", { fill: COLOURS.vermillion });
    values.text([430, exact + 0.02 * courses.at(-1)[1]], "exact W₂²", { "text-anchor": "end" });
    values.text([60, 0.22 * courses.at(-1)[1]], "debiased", { fill: COLOURS.green });
    const size = spreadOf(now);
    const status =
      `Step ${steps}, blur ${digits(blurNow())} mm. OT_ε ${digits(found.plain)} mm², divergence ` +
      `${digits(Math.max(found.divergence, 0))} mm², exact W₂² ${digits(exact)} mm². The points are ${digits(size)} mm ` +
      `from their mean, those of the target ${digits(spreadOf(target))} mm.${moved < 1e-3 ? " They have stopped." : ""}`;
    const [u, v] = arrows[0];
    return { status, values: { plain: found.plain, divergence: found.divergence, exact, size, u, v, step: steps } };
  }
  figure.movable(plane, {
    key: "points",
    name: "points of the source",
    points: () => now,
    step: 1,
    reach: 9,
    choose(i) {
      chosen = i;
      figure.changed("chosen");
    },
    move(i, to) {
      now = now.with(i, to);
      moved = Infinity;
      if (steps === 0) {
        state.points = now;
      }
    },
  });
  figure.run({
    draw,
    play: { step, perSecond: 12 },
    changed(key) {
      if (key === null || key === "blur" || key === "debiased") {
        restart();
      }
      if (key === null) {
        courses = BLURS.map((blur) => {
          const { plain, divergence } = solve(state.points, blur);
          return [blur, plain, divergence];
        });
      }
    },
    controls: [
      {
        kind: "range",
        key: "blur",
        label: "blur",
        min: 1,
        max: 2.6,
        step: 0.01,
        say: (value) => `${digits(10 ** value)} mm`,
      },
      { kind: "check", key: "debiased", label: "debiased" },
      { kind: "choice", key: "show", label: "Show", options: ["arrows", "plan", "plan of one point"] },
      { kind: "button", label: "start again", press: restart },
    ],
  });
}

function meansOf(plan, points) {
  return plan.map((row) => {
    const mass = row.reduce((sum, value) => sum + value, 0);
    return [0, 1].map((k) => row.reduce((sum, value, j) => sum + value * points[j][k], 0) / mass);
  });
}

// The mean distance from the mean.
function spreadOf(points) {
  const mean = [0, 1].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);
  return points.reduce((sum, [u, v]) => sum + Math.hypot(u - mean[0], v - mean[1]), 0) / points.length;
}

function solved(x, y, blur) {
  return entropicTransport(groundCosts(x, y, 2), equalMasses(x), equalMasses(y), 2 * blur ** 2, { tolerance: 1e-11 });
}
