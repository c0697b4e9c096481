import { turnable } from "../../../meshot/view/assets/turning.js";
import { replaceStill } from "./figure.js";
import { average, costAt, pairsAt, project, standardError } from "./line_costs.js";
import { player } from "./player.js";
import { generator } from "./random.js";
import { addShape, addText } from "./svg.js";

const NAMES = ["source", "target"];
const COLOURS = { source: "#0072B2", target: "#E69F00" };
const MIDDLE = [175, 175];
const BOX = { left: 430, right: 675, top: 40, bottom: 310 };

// A line through two clouds, turned by slider, button or hand, and lines at random.
export function main(root, data) {
  const svg = root.querySelector("svg");
  const controls = root.querySelector(".controls");
  const costs = Array.from({ length: 180 }, (_, degrees) => costAt(data.source, data.target, degrees));
  const mean = average(costs);
  const random = generator(1);
  const plane = addPlane(svg, data);
  const curve = addCurve(svg, costs, mean);
  let drawn = [];
  const cost = (degrees) => costAt(data.source, data.target, degrees);
  const line = player(controls, {
    show: (degrees) => {
      plane.drawLine(degrees);
      curve.mark(degrees, cost(degrees));
      Object.assign(root.dataset, { angle: degrees, cost: cost(degrees), mean, drawn: drawn.length });
      root.querySelector("[role=status]").textContent = sentence(degrees, cost(degrees), mean) + estimated(root, drawn);
    },
    say: (degrees) => `${Math.round(degrees)} degrees, cost ${cost(degrees).toPrecision(3)}`,
    pace: { perSecond: 20, step: 0 },
    reducedPace: { perSecond: 20, step: 15 },
    period: 180,
  });
  const turnTo = (degrees) => {
    line.rest();
    line.goTo(degrees);
  };
  const sample = (count) => {
    const angles = Array.from({ length: count }, () => 180 * random());
    for (const degrees of angles) {
      drawn.push(cost(degrees));
      curve.addSample(degrees, cost(degrees));
    }
    turnTo(angles.at(-1));
  };
  controls.querySelector(".one").addEventListener("click", () => sample(1));
  controls.querySelector(".ten").addEventListener("click", () => sample(10));
  controls.querySelector(".clear").addEventListener("click", () => {
    drawn = [];
    curve.clear();
    line.again();
  });
  const follow = (event) => {
    const frame = svg.getBoundingClientRect();
    const scale = 700 / frame.width;
    const x = (event.clientX - frame.left) * scale - MIDDLE[0];
    const y = (event.clientY - frame.top) * scale - MIDDLE[1];
    turnTo((Math.atan2(-y, x) * 180) / Math.PI);
  };
  turnable(plane.node, { press: follow, drag: follow });
  line.goTo(data.angle);
  replaceStill(root);
}

function sentence(degrees, cost, mean) {
  const angle = `Angle ${Math.round(degrees)}°: cost ${cost.toPrecision(3)}.`;
  return `${angle} Mean over all angles: ${mean.toPrecision(3)}.`;
}

function estimated(root, drawn) {
  delete root.dataset.error;
  if (!drawn.length) {
    return "";
  }
  root.dataset.estimate = average(drawn);
  const start = ` ${drawn.length} random ${drawn.length > 1 ? "lines" : "line"}: ${average(drawn).toPrecision(3)}`;
  if (drawn.length === 1) {
    return start + ".";
  }
  root.dataset.error = standardError(drawn);
  return `${start} ± ${standardError(drawn).toPrecision(2)}.`;
}

function addDot(parent, name, x, y, size) {
  if (name === "source") {
    addShape(parent, "circle", { cx: x, cy: y, r: size, fill: COLOURS.source });
  } else {
    addShape(parent, "rect", { x: x - size, y: y - size, width: 2 * size, height: 2 * size, fill: COLOURS.target });
  }
}

function addPlane(svg, data) {
  const radius = Math.max(...NAMES.flatMap((name) => data[name].map(([x, y]) => Math.hypot(x, y))));
  const unit = 92 / radius;
  const seen = ([x, y]) => [MIDDLE[0] + unit * x, MIDDLE[1] - unit * y];
  const node = addShape(svg, "g", { class: "plane" });
  addShape(node, "rect", { x: 0, y: 0, width: 350, height: 400, fill: "#fff" });
  const moving = addShape(node, "g", {});
  NAMES.forEach((name, i) => {
    data[name].forEach((point) => addDot(node, name, ...seen(point), 4.5));
    addDot(svg, name, 14 + 90 * i, 388, 5);
    addText(svg, name, { x: 26 + 90 * i, y: 394 });
  });
  const addLine = ([x1, y1], [x2, y2], look) => addShape(moving, "line", { x1, y1, x2, y2, ...look });
  const drawLine = (degrees) => {
    const [c, s] = [Math.cos, Math.sin].map((f) => f((degrees * Math.PI) / 180));
    const foot = (name, value) => {
      const shift = data.rows[NAMES.indexOf(name)] * radius;
      return seen([value * c + shift * s, value * s - shift * c]);
    };
    moving.replaceChildren();
    for (const name of NAMES) {
      addLine(foot(name, -1.1 * radius), foot(name, 1.1 * radius), { stroke: "#8c8c8c" });
      project(data[name], degrees).forEach((value, i) => {
        addLine(seen(data[name][i]), foot(name, value), { stroke: COLOURS[name], opacity: 0.35 });
      });
    }
    for (const [x, y] of pairsAt(data.source, data.target, degrees)) {
      addLine(foot("source", x), foot("target", y), { stroke: "#1a1a1a", "stroke-width": 1.5 });
      addDot(moving, "source", ...foot("source", x), 3);
      addDot(moving, "target", ...foot("target", y), 3);
    }
  };
  return { node, drawLine };
}

function addCurve(svg, costs, mean) {
  const { left, right, top, bottom } = BOX;
  const across = (degrees) => left + (degrees / 180) * (right - left);
  const up = (cost) => bottom - (cost / (1.08 * Math.max(...costs))) * (bottom - top);
  const addPath = (d, look) => addShape(svg, "path", { d, fill: "none", ...look });
  const centred = { "text-anchor": "middle" };
  const flush = { "text-anchor": "end" };
  addPath(`M${left} ${top}V${bottom}H${right}`, { stroke: "#1a1a1a" });
  for (const degrees of [0, 90, 180]) {
    addText(svg, degrees, { x: across(degrees), y: bottom + 22, ...centred });
  }
  addText(svg, "angle of the line (degrees)", { x: (left + right) / 2, y: bottom + 50, ...centred });
  addText(svg, "cost on the line", { x: left - 30, y: 24 });
  for (const cost of [0, mean]) {
    addText(svg, Number(cost.toPrecision(2)), { x: left - 8, y: up(cost) + 6, ...flush });
  }
  addPath(`M${left} ${up(mean)}H${right}`, { stroke: "#8c8c8c", "stroke-width": 2, "stroke-dasharray": "7 5" });
  const places = [...costs, costs[0]].map((cost, degrees) => `${across(degrees).toFixed(1)} ${up(cost).toFixed(1)}`);
  addPath("M" + places.join("L"), { stroke: "#1a1a1a", "stroke-width": 2.5 });
  addText(svg, "mean", { x: right, y: up(mean) - 7, ...flush });
  const samples = addShape(svg, "g", {});
  const marker = addShape(svg, "circle", { r: 7, fill: "#D55E00", stroke: "#fff" });
  return {
    mark: (degrees, cost) => {
      marker.setAttribute("cx", across(degrees));
      marker.setAttribute("cy", up(cost));
    },
    addSample: (degrees, cost) =>
      addShape(samples, "circle", { cx: across(degrees), cy: up(cost), r: 3.5, fill: "#D55E00", opacity: 0.6 }),
    clear: () => samples.replaceChildren(),
  };
}
