import { levelCurves } from "../../assets/levels.js";
import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";
import { generator } from "../../assets/random.js";

const OUTCOMES = { whole: "whole", broken: "in pieces, or shorter", gone: "gone" };
const LOOKS = { whole: COLOURS.blue, broken: COLOURS.orange, gone: COLOURS.vermillion };

// A thin gyrus whose signed distance is known exactly, on a grid: what the level set keeps, over positions of the grid.
export function main(root, data) {
  const start = { width: data.width, spacing: data.spacing, angle: 0, across: 0.5, along: 0.5, seed: data.seed };
  const figure = panel(root, start);
  const { state } = figure;
  const reach = data.length / 2 + 3;
  const plane = figure.plot({
    name: "the gyrus, the positions of the grid, and the curve that is found",
    x: { range: [-reach, reach], ticks: [-8, -4, 0, 4, 8], label: "mm" },
    y: { range: [-6, 6] },
    width: 430,
    equal: true,
  });
  const bars = figure.plot({
    name: "shares of the positions of the grid",
    x: { range: [0, 1], label: "share of the positions of the grid" },
    y: { range: [-0.6, 2.6] },
    width: 260,
    height: 220,
  });
  let random = generator(state.seed);
  let counts = { whole: 0, broken: 0, gone: 0 };

  const near = ([x, y]) => Math.abs(x) < reach && Math.abs(y) < 6;

  // The signed distance from a strip with round ends: that from its middle line, less half its width.
  function distance([x, y]) {
    const [c, s] = [Math.cos((state.angle * Math.PI) / 180), Math.sin((state.angle * Math.PI) / 180)];
    const [u, v] = [c * x + s * y, c * y - s * x];
    const half = (data.length - state.width) / 2;
    return Math.hypot(Math.max(0, Math.abs(u) - half), v) - state.width / 2;
  }
  function found() {
    const { spacing, across, along } = state;
    const n = 2 * Math.ceil(reach / spacing) + 2;
    const place = (row, column) => [(row - n / 2 + along) * spacing, (column - n / 2 + across) * spacing];
    const places = Array.from({ length: n * n }, (_, k) => place(Math.floor(k / n), k % n));
    const values = places.map(distance);
    const curves = levelCurves(values, n, n).map((curve) => curve.map(([row, column]) => place(row, column)));
    const inside = places.filter((_, k) => values[k] < 0);
    return { curves, inside, outside: places.filter((_, k) => values[k] >= 0) };
  }
  function outcome(curves) {
    const length = (curve) => {
      const [c, s] = [Math.cos((state.angle * Math.PI) / 180), Math.sin((state.angle * Math.PI) / 180)];
      const along = curve.map(([x, y]) => c * x + s * y);
      return Math.max(...along) - Math.min(...along);
    };
    if (!curves.length) {
      return "gone";
    }
    return curves.length === 1 && length(curves[0]) > data.length - 2 * state.spacing ? "whole" : "broken";
  }
  function another() {
    [state.across, state.along] = [random(), random()];
    counts[outcome(found().curves)] += 1;
  }
  const tried = () => counts.whole + counts.broken + counts.gone;
  function again(key) {
    if (key === "across") {
      return;
    }
    random = generator(state.seed);
    counts = { whole: 0, broken: 0, gone: 0 };
    const kept = [state.across, state.along];
    for (let k = 0; k < data.positions; k += 1) {
      another();
    }
    [state.across, state.along] = kept;
  }
  function draw() {
    const { curves, inside, outside } = found();
    const half = (data.length - state.width) / 2;
    const [c, s] = [Math.cos((state.angle * Math.PI) / 180), Math.sin((state.angle * Math.PI) / 180)];
    const turns = Array.from({ length: 25 }, (_, k) => ((k - 12) * Math.PI) / 24);
    const cap = (sign) =>
      turns.map((turn) => [
        sign * (half + (state.width / 2) * Math.cos(turn)),
        (sign * state.width * Math.sin(turn)) / 2,
      ]);
    const outline = [...cap(1), ...cap(-1)].map(([u, v]) => [c * u - s * v, s * u + c * v]);
    plane.dots(outside.filter(near), { colour: COLOURS.grey, size: 3 });
    plane.outline(outline, { colour: COLOURS.black, width: 1.5 });
    curves.forEach((curve) => {
      plane.area(curve, { colour: COLOURS.blue });
      plane.outline(curve, { colour: COLOURS.blue, width: 2.5 });
    });
    plane.dots(inside, { colour: COLOURS.vermillion, size: 6, square: true });
    const shares = Object.keys(OUTCOMES).map((key) => counts[key] / tried());
    Object.keys(OUTCOMES).forEach((key, k) => {
      const low = 2 - k;
      bars.area(
        [
          [0, low - 0.25],
          [shares[k], low - 0.25],
          [shares[k], low + 0.1],
          [0, low + 0.1],
        ],
        { colour: LOOKS[key], opacity: 0.8 },
      );
      bars.text([0.01, low + 0.25], `${OUTCOMES[key]}: ${(100 * shares[k]).toFixed(0)} %`);
    });
    const many = { 0: "no curve", 1: "one curve" }[curves.length] ?? `${curves.length} curves`;
    const here = `Here the grid finds ${many}, and the gyrus is ${OUTCOMES[outcome(curves)]}.`;
    const [whole, broken, gone] = shares.map((share) => (100 * share).toFixed(0));
    return {
      status: `${here} In ${tried()} random positions of the grid it is whole in ${whole} %, in pieces or shorter in ${broken} %, gone in ${gone} %.`,
      values: { whole: shares[0], broken: shares[1], gone: shares[2], curves: curves.length, tried: tried() },
    };
  }
  figure.run({
    draw,
    changed: again,
    play: {
      perSecond: 4,
      step() {
        another();
        return tried() < data.most;
      },
    },
    controls: [
      { kind: "range", key: "width", label: "thickness of the gyrus", min: 0.3, max: 4.5, step: 0.15, say: mm },
      { kind: "range", key: "spacing", label: "spacing of the grid", min: 0.75, max: 3, step: 0.75, say: mm },
      { kind: "range", key: "angle", label: "turned by", min: 0, max: 45, step: 5, say: (angle) => `${angle}°` },
      { kind: "range", key: "across", label: "shift of the grid", min: 0, max: 1, step: 0.05, say: steps },
      { kind: "button", key: "seed", label: "other positions", press: () => (state.seed += 1) },
    ],
  });
}

function mm(length) {
  return `${length.toFixed(2)} mm`;
}

function steps(share) {
  return `${share.toFixed(2)} of a step`;
}
