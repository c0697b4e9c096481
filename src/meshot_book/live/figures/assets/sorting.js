import { crosses, crossings, uncrossed } from "../../assets/crossings.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { generator, shuffled } from "../../assets/random.js";
import { couple, lineGradient, linePlan, planCost, quantiles } from "../../assets/transport.js";

const SIDES = { source: { row: 1, colour: COLOURS.blue }, target: { row: 0, colour: COLOURS.grey } };
const [LOW, HIGH] = [0, 10];

// Two rows of points that a reader drags and weighs: plan, quantiles, cost and gradient move together.
export function main(root, data) {
  const figure = panel(root, {
    source: data.source,
    target: data.target,
    a: data.source_masses,
    b: data.target_masses,
    unequal: false,
    p: data.exponent,
    pairing: "sorted",
    draw: 7,
    side: "source",
    index: 0,
  });
  const { state } = figure;
  const rows = figure.plot({
    name: "source above, target below, and the mass that goes from one to the other",
    x: { range: [LOW, HIGH], label: "position (units)" },
    y: { range: [-0.3, 1.3] },
    width: 640,
    height: 230,
  });
  const shares = figure.plot({
    name: "the quantile functions of both sides",
    x: { range: [0, 1], label: "share of mass" },
    y: { range: [LOW, HIGH], label: "position (units)" },
    width: 310,
    height: 250,
  });
  const costs = figure.plot({
    name: "the cost over the position of the chosen point",
    x: { range: [LOW, HIGH], label: "position of the chosen point (units)" },
    y: { range: [0, 1], label: "least cost" },
    width: 310,
    height: 250,
  });
  const unit = (rows.box.right - rows.box.left) / 620;
  let plan = [];

  const weights = (key) => {
    const raw = state.unequal ? state[key] : state[key].map(() => 1);
    const sum = raw.reduce((s, v) => s + v, 0);
    return raw.map((v) => v / sum);
  };
  const least = (x, y) => linePlan(x, weights("a"), y, weights("b"));
  // The least cost, with the chosen point elsewhere.
  function costAt(place) {
    const moved = { source: state.source, target: state.target };
    moved[state.side] = moved[state.side].with(state.index, place);
    return planCost(least(moved.source, moved.target), moved.source, moved.target, state.p);
  }
  function slopes() {
    const [place, h] = [state[state.side][state.index], 1e-6];
    return [-1, 1].map((sign) => (sign * (costAt(place + sign * h) - costAt(place))) / h);
  }
  function drawRows(best) {
    const { source: x, target: y } = state;
    for (const one of plan) {
      const crossed = plan.some((other) => crosses(one, other, x, y));
      const ends = [
        [x[one[0]], 1],
        [y[one[1]], 0],
      ];
      const look = crossed ? { colour: COLOURS.vermillion, dash: "9 7" } : { colour: COLOURS.blue };
      rows.segments([ends], { ...look, width: Math.max(1.2, 36 * unit * one[2]), opacity: 0.7 });
    }
    for (const [side, key] of [
      ["source", "a"],
      ["target", "b"],
    ]) {
      const places = state[side].map((place) => [place, SIDES[side].row]);
      rows.discs(
        places,
        weights(key).map((mass) => 36 * unit * Math.sqrt(mass)),
        SIDES[side],
      );
      rows.text([LOW, SIDES[side].row + 0.22], side);
    }
    const down = lineGradient(best, x, y, state.p);
    const longest = Math.max(...down.map(Math.abs), 1e-9);
    rows.arrows(
      x.map((place) => [place, 1]),
      x.map((_, i) => [(-1.2 * down[i]) / longest, 0]),
      { colour: COLOURS.black, width: 2.5 },
    );
    rows.text([HIGH, 1.2], "arrows: descent direction", { "text-anchor": "end" });
    return down;
  }
  function drawShares(best) {
    let from = 0;
    for (const [i, j, mass] of best) {
      const [low, high] = [state.source[i], state.target[j]];
      const corners = [
        [from, low],
        [from + mass, low],
        [from + mass, high],
        [from, high],
      ];
      shares.area(corners, { colour: COLOURS.blue });
      from += mass;
    }
    for (const [side, key, dash] of [
      ["target", "b", "7 4"],
      ["source", "a", ""],
    ]) {
      const steps = quantiles(state[side], weights(key));
      const corners = steps.flatMap(([start, end, place]) => [start, end].map((share) => [share, place]));
      shares.curve(corners, { colour: SIDES[side].colour, width: 2.5, dash });
    }
  }
  function drawCosts() {
    const places = Array.from({ length: 201 }, (_, k) => LOW + ((HIGH - LOW) * k) / 200);
    const curve = places.map((place) => [place, costAt(place)]);
    costs.rescale([0, 1.1 * Math.max(...curve.map(([, cost]) => cost), 1e-6)]);
    costs.curve(curve, { colour: COLOURS.black, width: 2 });
    const place = state[state.side][state.index];
    costs.dots([[place, costAt(place)]], { colour: COLOURS.vermillion, size: 11 });
  }
  function draw() {
    const { source: x, target: y, p } = state;
    const best = least(x, y);
    plan = state.pairing === "sorted" ? best : plan;
    const gradient = drawRows(best);
    drawShares(best);
    drawCosts();
    const [before, after] = slopes();
    const values = { cost: planCost(plan, x, y, p), least: planCost(best, x, y, p), crossings: crossings(plan, x, y) };
    const count = `${values.crossings} crossing${values.crossings === 1 ? "" : "s"}`;
    const shown =
      state.pairing === "sorted"
        ? `Sorted, p = ${p}: mean cost ${digits(values.least, 4)}, the least there is.`
        : `This pairing, p = ${p}: mean cost ${digits(values.cost, 4)}, ${count}. Sorted: ${digits(values.least, 4)}.`;
    const slope =
      Math.abs(after - before) > 1e-3 * (1 + Math.abs(after))
        ? `slope ${digits(before)} to its left and ${digits(after)} to its right: no gradient here.`
        : `slope ${digits(after)}.`;
    const which = `${state.side} point ${state.index + 1}`;
    return { status: `${shown} Least cost over the position of ${which}: ${slope}`, values: { ...values, gradient } };
  }
  function pair() {
    const random = generator(state.draw);
    const orders = [state.source, state.target].map((places) => shuffled(places.length, random));
    plan = couple(orders[0], weights("a"), orders[1], weights("b"));
  }
  function weigh(i, factor) {
    const masses = state.side === "source" ? state.a : state.b;
    masses[i] = Math.min(10, Math.max(0.1, masses[i] * factor));
    state.unequal = true;
    figure.changed("a");
  }
  for (const [side, { row }] of Object.entries(SIDES)) {
    const choose = (i) => Object.assign(state, { side, index: i });
    figure.movable(rows, {
      key: side,
      name: `${side} points`,
      points: () => state[side].map((place) => [place, row]),
      step: 0.1,
      choose(i) {
        choose(i);
        figure.changed("index");
      },
      move(i, [place]) {
        choose(i);
        state[side][i] = Math.min(HIGH, Math.max(LOW, Math.round(place * 100) / 100));
      },
      keys: { ArrowUp: (i) => (choose(i), weigh(i, 1.25)), ArrowDown: (i) => (choose(i), weigh(i, 0.8)) },
      say: (i) => `at ${state[side][i].toFixed(2)}, mass ${weights(side === "source" ? "a" : "b")[i].toFixed(3)}`,
    });
  }
  const isRandom = () => state.pairing === "random";
  figure.run({
    draw,
    changed: (key) => [null, "a", "draw", "pairing", "unequal"].includes(key) && pair(),
    controls: [
      { kind: "range", key: "p", label: "exponent p", min: 1, max: 4, step: 0.1 },
      { kind: "choice", key: "pairing", label: "Pairing", options: ["sorted", "random"] },
      { kind: "button", key: "draw", label: "another random pairing", press: () => (state.draw += 1), when: isRandom },
      {
        kind: "button",
        label: "uncross one pair",
        press: () => (plan = uncrossed(plan, state.source, state.target)),
        when: () => isRandom() && crossings(plan, state.source, state.target) > 0,
      },
      { kind: "check", key: "unequal", label: "unequal masses" },
      { kind: "button", label: "lighter", press: () => weigh(state.index, 0.8) },
      { kind: "button", label: "heavier", press: () => weigh(state.index, 1.25) },
    ],
  });
}
