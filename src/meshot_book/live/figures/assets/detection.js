import { exactLoss } from "../../assets/assignment.js";
import { chamferLoss } from "../../assets/nearest.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { slicedLoss } from "../../assets/projection.js";
import { generator, normal } from "../../assets/random.js";

const LOSSES = ["Chamfer", "exact", "sliced"];
const FIRST = 8; // pairs that are drawn at once
const [LOW, HIGH, BINS] = [0.1, 80, 60]; // of the histograms, in mm

// Pairs of samples without and with a fault: where do the values of each loss lie, and how many exceed the threshold?
export function main(root, data) {
  const figure = panel(root, { fault: data.fault, spacing: "random", points: data.points, seed: 0 });
  const { state } = figure;
  const plots = LOSSES.map((name) =>
    figure.plot({
      name: `values of ${name} for pairs without and with a fault`,
      title: name === "exact" ? "exact transport" : name,
      x: { range: [LOW, HIGH], log: true, label: "equivalent shift (mm)" },
      y: { range: [0, 1] },
      width: root.clientWidth < 500 ? 340 : 210,
      height: 210,
    }),
  );
  const kept = new Map(); // the values so far, by what decides on them

  // Shares of the circle: independent, or equal steps from a random start.
  function shares(n, random) {
    const first = random();
    return Array.from({ length: n }, (_, i) =>
      state.spacing === "even" ? (i + first) / n : i === 0 ? first : random(),
    );
  }
  /** @type {(turn: number) => number[]} */
  const onCircle = (turn) => [data.radius * Math.cos(2 * Math.PI * turn), data.radius * Math.sin(2 * Math.PI * turn)];
  const alongBump = alongPolygon(data.bump);
  const scenes = {
    "crowded 3 : 1": (n, random) =>
      shares(n, random).map((u) => onCircle(u < 0.75 ? u / 1.5 - 0.25 : 0.25 + 2 * (u - 0.75))),
    "a quarter missing": (n, random) => shares(n, random).map((u) => onCircle(0.75 * u)),
    "a tenth far away"(n, random) {
      const far = Math.floor(n / 10);
      const near = shares(n - far, random).map(onCircle);
      return [...near, ...Array.from({ length: far }, () => [100 + 4 * normal(random), 4 * normal(random)])];
    },
    "one outlier": (n, random) => [...shares(n - 1, random).map(onCircle), [120, 0]],
    "bump of 6 mm": (n, random) => shares(n, random).map(alongBump),
    "moved by 3 mm": (n, random) => shares(n, random).map((u) => [onCircle(u)[0] + 3, onCircle(u)[1]]),
    "a quarter flipped": (n, random) => shares(n, random).map((u) => withNormal(onCircle(u), u < 0.25)),
  };
  /** @param {number[]} point */
  function withNormal([u, v], inwards = false) {
    const size = ((inwards ? -1 : 1) * data.normal_scale) / data.radius;
    return [u, v, size * u, size * v];
  }
  function shiftsOf(x, y) {
    const d = x[0].length;
    const costs = [chamferLoss(x, y).cost / 2, exactLoss(x, y).cost, d * slicedLoss(x, y, data.lines[d]).cost];
    return costs.map((cost) => Math.sqrt(Math.max(0, cost)));
  }
  // Pair k: the same draws for the second sample, without and with the fault.
  function pair(k, fault) {
    const { points: n, seed } = state;
    const oriented = state.fault === "a quarter flipped";
    const none = (random) => shares(n, random).map((u) => (oriented ? withNormal(onCircle(u)) : onCircle(u)));
    const [one, other] = [0, 1].map((side) => generator(2 * (1000 * seed + k) + side));
    return shiftsOf(none(one), fault ? scenes[state.fault](n, other) : none(other));
  }
  function valuesOf(fault) {
    const { spacing, points, seed } = state;
    const key = [fault ? state.fault : state.fault === "a quarter flipped", spacing, points, seed].join();
    return kept.get(key) ?? kept.set(key, []).get(key);
  }
  function add(count) {
    for (const fault of [false, true]) {
      const values = valuesOf(fault);
      while (values.length < count) {
        values.push(pair(values.length, fault));
      }
    }
  }
  function step() {
    const count = valuesOf(true).length;
    add(Math.min(data.pairs, count + 1));
    return count + 1 < data.pairs;
  }
  function draw() {
    const [with_, all] = [valuesOf(true), valuesOf(false)];
    const none = all.slice(0, with_.length);
    const values = { pairs: with_.length };
    const words = LOSSES.map((name, k) => {
      const [floor, found] = [none, with_].map((rows) => rows.map((row) => row[k]));
      const limit = quantile(floor, 0.95);
      const power = found.filter((value) => value > limit).length / found.length;
      const most = Math.max(...counts(floor), ...counts(found));
      drawValues(plots[k], floor, most, { colour: COLOURS.grey, opacity: 0.45 });
      drawValues(plots[k], found, most, { colour: COLOURS.vermillion, opacity: 0.3 });
      const place = Math.max(limit, LOW);
      plots[k].segments([[[place, 0], [place, 0.86]]], { colour: COLOURS.black, dash: "5 4" }); // prettier-ignore
      plots[k].text([LOW, 0.91], `power ${power.toFixed(2)}`);
      const mean = floor.reduce((sum, value) => sum + value, 0) / floor.length;
      Object.assign(values, { [`${name}Power`]: power, [`${name}Floor`]: mean, [`${name}Limit`]: limit });
      const alike = state.spacing === "random" && state.points === data.points;
      const table = alike ? ` (table ${data.powers[state.fault][k].toFixed(2)})` : "";
      return `${name} ${power.toFixed(2)}${table}`;
    });
    const floors = LOSSES.map((name) => digits(values[`${name}Floor`], 2)).join(", ");
    const status =
      `${with_.length} of ${data.pairs} pairs of ${state.points} points, ${state.fault}: power ${words.join(", ")}. ` +
      `Mean without a fault: ${floors} mm.`;
    return { status, values };
  }
  figure.run({
    draw,
    play: { step, perSecond: 20 },
    changed: () => add(FIRST),
    controls: [
      { kind: "choice", key: "fault", label: "Fault", options: Object.keys(scenes) },
      { kind: "choice", key: "spacing", label: "Samples", options: ["random", "even"] },
      { kind: "range", key: "points", label: "points", min: 30, max: 120, step: 30 },
      { kind: "button", label: "other samples", press: () => (state.seed += 1) },
    ],
  });
}

// One histogram, as steps.
function drawValues(plot, values, most, look) {
  const corners = [[LOW, 0]];
  counts(values).forEach((count, bin) =>
    [bin, bin + 1].forEach((edge) => corners.push([LOW * (HIGH / LOW) ** (edge / BINS), (0.8 * count) / most])),
  );
  plot.area([...corners, [HIGH, 0]], look);
  plot.curve(corners, { colour: look.colour, width: 1.2 });
}

// A point of a closed polygon, by its share of the length.
function alongPolygon(corners) {
  const next = [...corners.slice(1), corners[0]];
  const ends = [0];
  corners.forEach((a, i) => ends.push(ends[i] + Math.hypot(next[i][0] - a[0], next[i][1] - a[1])));
  return (share) => {
    const at = share * ends[corners.length];
    const i = Math.max(0, ends.findIndex((end) => end > at) - 1);
    const t = (at - ends[i]) / (ends[i + 1] - ends[i]);
    return corners[i].map((value, k) => value + t * (next[i][k] - value));
  };
}

function counts(values) {
  const found = Array.from({ length: BINS }, () => 0);
  for (const value of values) {
    const bin = Math.floor((BINS * Math.log(Math.max(value, LOW) / LOW)) / Math.log(HIGH / LOW));
    found[Math.min(BINS - 1, bin)] += 1;
  }
  return found;
}

// Between neighbouring values it is linear.
function quantile(values, share) {
  const sorted = Float64Array.from(values).sort();
  const at = share * (sorted.length - 1);
  const [low, high] = [sorted[Math.floor(at)], sorted[Math.ceil(at)]];
  return low + (at - Math.floor(at)) * (high - low);
}
