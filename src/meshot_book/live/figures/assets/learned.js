import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle, planeDirections, slicedLoss } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";
import { ascent, climb, energySlicedLoss } from "../../assets/slices.js";

// The sign of a slice's factor, and its look.
const SIGNS = [
  { colour: COLOURS.green, sign: 1 },
  { colour: COLOURS.vermillion, sign: -1 },
];

const EVERY = 4; // of the arrows
const ALL = Array.from({ length: 181 }, (_, angle) => angle);

// One pair of clouds, and the slices that three losses choose: all alike, by their cost, or the one of largest cost.
export function main(root, data) {
  const figure = panel(root, { way: "equal weights", power: 3, lines: "even", draw: 1, angle: data.angle });
  const { state } = figure;
  const reach = 1.05 * Math.max(...[...data.source, ...data.target].map((point) => Math.hypot(...point)));
  const range = [-1.5 * reach, 1.5 * reach];
  const plane = figure.plot({
    name: "two clouds, the slices that count, and the arrows",
    x: { range },
    y: { range: [-1.25 * reach, 1.25 * reach] },
    width: 350,
    equal: true,
  });
  const curve = figure.plot({
    name: "the cost over the angle of the direction, and the slices that count",
    x: { range: [0, 180], label: "angle of the direction (°)", ticks: [0, 45, 90, 135, 180] },
    y: { range: [0, 1], label: "cost (units²)" },
    width: 320,
    height: 320,
  });
  let points = data.source;
  let now = null;
  let path = [];

  const isMax = () => state.way === "largest cost";
  const power = () => (state.way === "by energy" ? 2 ** state.power : 0);
  const directions = () => (state.lines === "even" ? data.lines : planeDirections("random", 30, generator(state.draw)));
  function begin() {
    now = ascent(points, data.target, radians(state.angle));
    path = [now];
  }
  function restart() {
    points = data.source;
    begin();
  }
  // One step of a descent. Where one slice is kept, the ascent comes first, a step at a time.
  function step() {
    if (!isMax() || now.over) {
      follow();
      return lossNow().cost > 1e-6;
    }
    let next = climb(points, data.target, now);
    while (!next.over && next.cost === now.cost) {
      next = climb(points, data.target, next); // it was too long, and has become shorter
    }
    now = next.cost - now.cost > 1e-9 * now.cost ? next : { ...next, over: true };
    path.push(now);
    return true;
  }
  function lossNow() {
    if (!isMax() && power() === 0) {
      const even = directions().map((_, __, all) => 1 / all.length);
      return { ...slicedLoss(points, data.target, directions()), weights: even, factors: even, lines: directions() };
    }
    if (!isMax()) {
      return { ...energySlicedLoss(points, data.target, directions(), power()), lines: directions() };
    }
    const { cost, gradient } = slicedLoss(points, data.target, [now.line]);
    return { cost, costs: [cost], weights: [1], factors: [1], gradient, lines: [now.line] };
  }
  const arrowsOf = (gradient) => gradient.map((row) => row.map((value) => (-value * points.length) / 2));
  function follow() {
    const arrows = arrowsOf(lossNow().gradient);
    points = points.map((point, i) => point.map((value, k) => value + arrows[i][k]));
    const { line } = now;
    now = ascent(points, data.target, line);
    path = [now];
  }
  // Spokes on both sides, as long as the weight of the slice.
  function drawSpokes({ lines, weights, factors }) {
    const most = Math.max(...weights);
    for (const { colour, sign } of SIGNS) {
      const spokes = lines.flatMap((line, l) => {
        const length = 1.1 + 0.28 * (weights[l] / most);
        const ends = [1.1, length].map((r) => line.map((value) => r * reach * value));
        return factors[l] >= 0 === sign > 0 ? [ends, ends.map((end) => end.map((value) => -value))] : [];
      });
      plane.segments(spokes, { colour, width: isMax() ? 5 : 2 });
    }
    if (isMax()) {
      const ends = [-1.1, 1.1].map((r) => now.line.map((value) => r * reach * value));
      plane.segments([ends], { colour: COLOURS.green, width: 1.5, dash: "6 4" });
    }
  }
  function drawCurve(costs, found) {
    const high = 1.12 * Math.max(...costs, found.cost);
    curve.rescale([0, high]);
    curve.curve(ALL.map((angle) => [angle, costs[angle]]), { colour: COLOURS.black, width: 2 }); // prettier-ignore
    curve.segments([[[0, found.cost], [180, found.cost]]], { colour: COLOURS.blue, width: 2, dash: "6 4" }); // prettier-ignore
    const at = found.lines.map((line, l) => [degrees(line), found.costs[l], found.factors[l]]);
    for (const { colour, sign } of SIGNS) {
      const dots = at.filter(([, , factor]) => factor >= 0 === sign > 0).map(([angle, cost]) => [angle, cost]);
      curve.dots(dots, { colour, size: isMax() ? 12 : 5 });
    }
    if (isMax()) {
      curve.dots(path.map(({ line, cost }) => [degrees(line), cost]), { colour: COLOURS.vermillion, size: 6 }); // prettier-ignore
    }
  }
  function draw() {
    const found = lossNow();
    const costs = [...slicedLoss(points, data.target, ALL.map(radians)).costs];
    drawSpokes(found);
    plane.dots(data.target, { colour: COLOURS.grey, size: 3, square: true });
    plane.dots(points, { colour: COLOURS.orange, size: 4 });
    plane.arrows(few(points), few(arrowsOf(found.gradient)), { colour: COLOURS.blue });
    drawCurve(costs, found);
    const [u, v] = now.line;
    const beside = slicedLoss(points, data.target, [[-v, u]]).cost;
    const raised = found.factors.filter((factor) => factor < 0).length / found.factors.length;
    const status = isMax()
      ? `Ascent, ${path.length - 1} ${path.length === 2 ? "step" : "steps"}: the direction of ${digits(degrees(now.line), 4)}° has the cost ` +
        `${digits(now.cost, 4)} units²; at a right angle to it ${digits(beside, 4)}.${now.over ? " A maximum." : ""}`
      : `${found.lines.length} directions${power() ? `, energy with α = ${power()}` : ""}: the loss is ` +
        `${digits(found.cost, 4)} units². Along ${digits(100 * raised)} % of them a descent raises the cost.`;
    const values = { loss: found.cost, raised, angle: degrees(now.line), beside, steps: path.length - 1 };
    return { status, values };
  }
  figure.run({
    draw,
    play: { step, perSecond: 2 },
    changed(key) {
      if (key === null) {
        restart();
      }
      if (key === "angle") {
        begin();
      }
    },
    controls: [
      { kind: "choice", key: "way", label: "Slices", options: ["equal weights", "by energy", "largest cost"] },
      {
        kind: "range",
        key: "power",
        label: "power α",
        min: 0,
        max: 5,
        step: 1,
        say: (value) => `${2 ** value}`,
        when: ({ way }) => way === "by energy",
      },
      {
        kind: "choice",
        key: "lines",
        label: "Directions",
        options: [
          ["even", `${data.lines.length} even`],
          ["random", "30 random"],
        ],
      },
      {
        kind: "button",
        key: "draw",
        label: "draw anew",
        press: () => (state.draw += 1),
        when: ({ way, lines }) => way !== "largest cost" && lines === "random",
      },
      {
        kind: "range",
        key: "angle",
        label: "start of the ascent",
        min: 0,
        max: 179,
        step: 1,
        say: (value) => `${value}°`,
        when: ({ way }) => way === "largest cost",
      },
      { kind: "button", label: "move along the arrows", press: follow },
      { kind: "button", label: "points back", press: restart },
    ],
  });
}

function few(rows) {
  return rows.filter((_, i) => i % EVERY === 0);
}

function radians(angle) {
  return atAngle((angle * Math.PI) / 180);
}

function degrees([u, v]) {
  return ((Math.atan2(v, u) * 180) / Math.PI + 360) % 180;
}
