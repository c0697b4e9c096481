import { turnable } from "../../../meshot/view/assets/turning.js";
import { replaceStill } from "./figure.js";
import { cost, couple, crosses, crossings, sorted, uncrossed } from "./pairing.js";
import { generator, shuffled } from "./random.js";
import { addShape, addText } from "./svg.js";

const MARGIN = 34;
const WIDTH = 640;
const ROWS = { source: 88, target: 242 };
const COLOURS = { source: "#0072B2", target: "#8C8C8C" };

// Two rows of points that a reader drags and weighs; the pairing is drawn anew at once.
export function main(root, data) {
  const svg = root.querySelector("svg");
  const [low, high] = data.range;
  const find = (name) => root.querySelector("." + name);
  const random = generator(7);
  const state = { exponent: data.exponent, pairing: "sorted", equal: true, plan: [], chosen: null };
  const at = (position) => MARGIN + ((position - low) / (high - low)) * (WIDTH - 2 * MARGIN);
  const weights = ({ raw }) => normal(state.equal ? raw.map(() => 1) : raw);
  drawRulers(svg, at, low, high);
  const lines = addShape(svg, "g", { "stroke-linecap": "round" });
  const sides = {};
  for (const name of ["source", "target"]) {
    const side = { positions: data[name].slice(), raw: data[name + "_masses"].slice() };
    const hands = { move: (i, place) => move(side, i, place), weigh: (i, factor) => weigh(side, i, factor) };
    const choose = (i) => {
      state.chosen = [side, i];
    };
    side.points = side.positions.map((_, i) => addPoint(svg, name, i, [low, high], side, { ...hands, choose }));
    sides[name] = side;
  }

  function move(side, i, place) {
    side.positions[i] = Math.min(high, Math.max(low, Math.round(place * 100) / 100));
    draw();
  }
  function weigh(side, i, factor) {
    side.raw[i] = Math.min(10, Math.max(0.1, side.raw[i] * factor));
    state.equal = false;
    find("masses").checked = true;
    pair();
  }
  function pair() {
    const [a, b] = [weights(sides.source), weights(sides.target)];
    if (state.pairing === "random") {
      state.plan = couple(shuffled(a.length, random), a, shuffled(b.length, random), b);
    }
    draw();
  }
  function draw() {
    const [x, y] = [sides.source.positions, sides.target.positions];
    const [a, b] = [weights(sides.source), weights(sides.target)];
    const best = sorted(x, a, y, b);
    const plan = state.pairing === "sorted" ? best : state.plan;
    drawPlan(lines, plan, x, y, at);
    drawPoints(sides.source, a, at, ROWS.source);
    drawPoints(sides.target, b, at, ROWS.target);
    say(plan, best, x, y);
  }
  function say(plan, best, x, y) {
    const shown = cost(plan, x, y, state.exponent);
    const least = cost(best, x, y, state.exponent);
    const count = crossings(plan, x, y);
    Object.assign(root.dataset, { cost: shown, least, crossings: count });
    const many = count === 1 ? "1 crossing" : count + " crossings";
    root.querySelector("[role=status]").textContent =
      state.pairing === "sorted"
        ? `Sorted pairing, p = ${state.exponent}: mean cost ${digits(least)}, the least there is. No crossings.`
        : `This pairing, p = ${state.exponent}: mean cost ${digits(shown)}, ${many}. Sorted: ${digits(least)}.`;
    find("uncross").disabled = state.pairing === "sorted" || count === 0;
    find("again").disabled = state.pairing === "sorted";
  }
  function reset() {
    for (const [name, side] of Object.entries(sides)) {
      side.positions = data[name].slice();
      side.raw = data[name + "_masses"].slice();
    }
    pair();
  }
  listen(root.querySelectorAll("[name$=exponent]"), "change", (input) => {
    state.exponent = Number(input.value);
    draw();
  });
  listen(root.querySelectorAll("[name$=pairing]"), "change", (input) => {
    state.pairing = input.value;
    pair();
  });
  listen([find("masses")], "change", (box) => {
    state.equal = !box.checked;
    pair();
  });
  listen([find("again")], "click", pair);
  listen([find("uncross")], "click", () => {
    state.plan = uncrossed(state.plan, sides.source.positions, sides.target.positions);
    draw();
  });
  listen([find("lighter")], "click", () => weigh(...(state.chosen || [sides.source, 0]), 0.8));
  listen([find("heavier")], "click", () => weigh(...(state.chosen || [sides.source, 0]), 1.25));
  listen([find("reset")], "click", reset);
  reset();
  replaceStill(root);
}

function listen(nodes, event, action) {
  nodes.forEach((node) => node.addEventListener(event, () => action(node)));
}

function normal(values) {
  const sum = values.reduce((s, v) => s + v, 0);
  return values.map((v) => v / sum);
}

function digits(value) {
  return Number(value.toPrecision(4)).toString();
}

function drawRulers(svg, at, low, high) {
  for (const [y, length] of [
    [ROWS.source, -7],
    [ROWS.target, 7],
  ]) {
    addShape(svg, "line", { x1: at(low), x2: at(high), y1: y, y2: y, stroke: "#1a1a1a" });
    for (let k = Math.ceil(low); k <= high; k += 1) {
      addShape(svg, "line", { x1: at(k), x2: at(k), y1: y, y2: y + length, stroke: "#1a1a1a" });
    }
  }
  const middle = { "text-anchor": "middle" };
  for (let k = Math.ceil(low); k <= high; k += 1) {
    if (k % 2 === 0) {
      addText(svg, k, { x: at(k), y: ROWS.target + 30, ...middle });
    }
  }
  addText(svg, "source", { x: MARGIN, y: 24 });
  addText(svg, "target", { x: MARGIN, y: ROWS.target + 66 });
  addText(svg, "position on the line (units)", { x: WIDTH / 2, y: ROWS.target + 66, ...middle });
}

function addPoint(svg, name, i, [low, high], side, { move, weigh, choose }) {
  const node = addShape(svg, "g", {
    class: "point",
    role: "slider",
    tabindex: 0,
    "aria-valuemin": low,
    "aria-valuemax": high,
    "aria-label": `${name} point ${i + 1}`,
  });
  addShape(node, "circle", { class: "ring", r: 24 });
  addShape(node, "circle", { class: "body", fill: COLOURS[name], stroke: "#fff" });
  node.addEventListener("focus", () => choose(i));
  const stepBy = (sign) => (event) => move(i, side.positions[i] + sign * (event.shiftKey ? 1 : 0.1));
  const heavier = () => weigh(i, 1.25);
  const lighter = () => weigh(i, 0.8);
  turnable(node, {
    press: (event) => {
      event.preventDefault();
      node.focus();
    },
    drag: (event) => {
      const box = svg.getBoundingClientRect();
      const place = ((event.clientX - box.left) / box.width) * WIDTH;
      move(i, low + ((place - MARGIN) / (WIDTH - 2 * MARGIN)) * (high - low));
    },
    keys: {
      ArrowLeft: stepBy(-1),
      ArrowRight: stepBy(1),
      Home: () => move(i, low),
      End: () => move(i, high),
      ArrowUp: heavier,
      "+": heavier,
      ArrowDown: lighter,
      "-": lighter,
    },
  });
  return node;
}

function drawPlan(lines, plan, x, y, at) {
  lines.replaceChildren();
  for (const one of plan) {
    const crossed = plan.some((other) => crosses(one, other, x, y));
    const ends = { x1: at(x[one[0]]), y1: ROWS.source, x2: at(y[one[1]]), y2: ROWS.target };
    addShape(lines, "line", {
      ...ends,
      stroke: crossed ? "#D55E00" : "#0072B2",
      "stroke-opacity": 0.7,
      "stroke-dasharray": crossed ? "9 7" : "none",
      "stroke-width": Math.max(1.2, 36 * one[2]),
    });
  }
}

function drawPoints(side, masses, at, row) {
  side.points.forEach((node, i) => {
    const place = side.positions[i];
    node.setAttribute("transform", `translate(${at(place)} ${row})`);
    node.setAttribute("aria-valuenow", place);
    node.setAttribute("aria-valuetext", `at ${place.toFixed(2)}, mass ${masses[i].toFixed(3)}`);
    node.querySelector(".body").setAttribute("r", (36 * Math.sqrt(masses[i])).toFixed(2));
  });
}
