import { exactLoss } from "../../assets/assignment.js";
import { descend, descent } from "../../assets/flow.js";
import { chamferLoss } from "../../assets/nearest.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { planeDirections, slicedLoss } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";

const COLOUR = { Chamfer: COLOURS.vermillion, "sliced Wasserstein": COLOURS.blue, "exact Wasserstein": COLOURS.green };
const LAST = 2000;

// Points of a circle descend on a loss to a polygon: where do they stop, and why?
export function main(root, data) {
  const figure = panel(root, {
    corners: data.corners,
    points: data.points,
    count: data.points.length,
    loss: "Chamfer",
    momentum: 0.9,
    rate: 0.05,
    lines: 20,
    drawn: "redrawn",
    show: "selections",
  });
  const { state } = figure;
  const plane = figure.plot({
    name: "moving points and the polygon",
    x: { range: [-1.75, 1.75] },
    y: { range: [-1.6, 1.75] },
    width: 318,
    equal: true,
  });
  const curves = figure.plot({
    name: "the loss and the exact distance over the steps",
    x: { range: [1, LAST], log: true, label: "step + 1" },
    y: { range: [1e-4, 2], log: true, label: "units²" },
    width: 318,
    height: 320,
  });
  const random = generator(2);
  let now = descent(state.points);
  let history = [];
  const memory = {};

  const goal = () => evenly(state.corners, now.points.length);
  const directions = () =>
    planeDirections("random", state.lines, state.drawn === "redrawn" ? random : generator(data.seed));
  const losses = {
    Chamfer: (points) => chamferLoss(points, goal()),
    "sliced Wasserstein": (points) => slicedLoss(points, goal(), directions(), { memory }),
    "exact Wasserstein": (points) => exactLoss(points, goal()),
  };
  function record(loss) {
    history.push({ step: now.steps + 1, loss, exact: exactLoss(now.points, goal()).cost });
  }
  function restart() {
    now = descent(state.points);
    history = [];
    record(losses[state.loss](now.points).cost);
  }
  function step() {
    const { gradient } = losses[state.loss](now.points);
    // The force −n/2 ∇L is a displacement in units of the points.
    const scaled = gradient.map((row) => row.map((value) => (value * now.points.length) / 2));
    now = descend(now, scaled, state);
    record(losses[state.loss](now.points).cost);
    return now.moved > 1e-6 && now.steps < LAST;
  }
  function drawPlane(found) {
    const target = goal();
    const colour = COLOUR[state.loss];
    plane.outline(state.corners, { colour: COLOURS.grey, width: 2, opacity: 0.6 });
    plane.dots(target, { colour: COLOURS.grey, size: 5, square: true });
    const force = found.gradient.map((row) => row.map((value) => (-value * now.points.length) / 2));
    if (state.show === "arrows") {
      plane.arrows(now.points, force, { colour });
    }
    if (state.show === "partners") {
      drawPartners(found, target, colour);
    }
    const counts = now.points.map(() => 0);
    found.selectors?.forEach((i) => (counts[i] += 1));
    const radii = counts.map((count) => (state.show === "selections" && found.selectors ? 2.5 + 2.5 * count : 4));
    plane.discs(now.points, radii, { colour, opacity: 0.85 });
    return counts.filter((count) => count === 0).length;
  }
  function drawPartners({ chosen, selectors, columns }, target, colour) {
    const partners = chosen ?? columns ?? [];
    const look = { colour, width: 1 };
    plane.segments(
      now.points.map((point, i) => [point, target[partners[i]] ?? point]),
      look,
    );
    plane.segments(target.map((point, j) => [point, now.points[selectors?.[j]] ?? point]).slice(0), {
      ...look,
      dash: "3 3",
    });
  }
  function draw() {
    const found = losses[state.loss](now.points);
    const alone = drawPlane(found);
    const values = { step: now.steps, loss: found.cost, exact: exactLoss(now.points, goal()).cost, alone };
    for (const [key, colour, dash] of [
      ["loss", COLOUR[state.loss], ""],
      ["exact", COLOURS.black, "6 4"],
    ]) {
      curves.curve(
        history.map((row) => [row.step, Math.max(row[key], 1e-4)]),
        { colour, width: 2, dash },
      );
      curves.dots([[now.steps + 1, values[key]]], { colour, size: 7 });
    }
    curves.text([1.2, 2.6e-4], `solid: ${state.loss}`, { fill: COLOUR[state.loss] });
    curves.text([1.2, 1.35e-4], "dashed: exact W₂²");
    const still = now.moved < 1e-6 ? " It has stopped: no point moves." : "";
    const selected = found.selectors ? ` ${alone} of ${now.points.length} points are selected by no target point.` : "";
    const status = `Step ${now.steps}. ${state.loss} ${digits(values.loss)}, exact W₂² ${digits(values.exact)}.`;
    return { status: status + selected + still, values };
  }
  figure.movable(plane, {
    key: "corners",
    name: "corners of the target",
    points: () => state.corners,
    step: 0.05,
    move: (i, to) => (state.corners[i] = to),
  });
  figure.movable(plane, {
    key: "points",
    name: "moving points",
    points: () => now.points,
    step: 0.05,
    reach: 10,
    move(i, to) {
      now.points = now.points.with(i, to);
      now.velocities = now.velocities.with(i, [0, 0]);
      now.moved = Infinity;
      if (now.steps === 0) {
        state.points = now.points;
      }
    },
  });
  figure.run({
    play: { step, perSecond: 30 },
    draw,
    changed(key) {
      if (key === "count") {
        state.points = state.count === data.points.length ? structuredClone(data.points) : onCircle(state.count);
      }
      if (key === null || key === "count" || key === "loss" || now.steps === 0) {
        restart();
      }
    },
    controls: [
      { kind: "button", label: "start again", press: restart },
      { kind: "choice", key: "loss", label: "Loss", options: Object.keys(losses) },
      { kind: "choice", key: "show", label: "Show", options: ["selections", "partners", "arrows", "nothing"] },
      { kind: "range", key: "count", label: "points", min: 6, max: 96, step: 6 },
      { kind: "range", key: "momentum", label: "momentum", min: 0, max: 0.95, step: 0.05 },
      { kind: "range", key: "rate", label: "step size", min: 0.01, max: 1, step: 0.01 },
      { kind: "range", key: "lines", label: "lines", min: 1, max: 100, step: 1, when: isSliced },
      { kind: "choice", key: "drawn", label: "Lines are", options: ["fixed", "redrawn"], when: isSliced },
    ],
  });
}

function isSliced({ loss }) {
  return loss === "sliced Wasserstein";
}

function onCircle(n) {
  const angles = Array.from({ length: n }, (_, i) => Math.PI * (0.5 + (2 * i + 1) / n));
  return angles.map((angle) => [Math.cos(angle), Math.sin(angle)]);
}

// Points at equal distances along a closed polygon.
function evenly(corners, n) {
  const sides = corners.map((corner, k) => [corner, corners[(k + 1) % corners.length]]);
  const lengths = sides.map(([s, e]) => Math.hypot(e[0] - s[0], e[1] - s[1]));
  const gap = lengths.reduce((sum, length) => sum + length, 0) / n;
  const points = [];
  let at = gap / 2;
  sides.forEach(([s, e], k) => {
    for (; at < lengths[k] && points.length < n; at += gap) {
      points.push(s.map((value, c) => value + ((e[c] - value) * at) / lengths[k]));
    }
    at -= lengths[k];
  });
  while (points.length < n) {
    points.push(corners[0]);
  }
  return points;
}
