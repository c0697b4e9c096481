import { integrate } from "../../assets/flow.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { velocities } from "../../assets/triangles.js";

const METHODS = { euler: COLOURS.orange, midpoint: COLOURS.sky, rk4: COLOURS.purple };
const NAMES = { euler: "Euler", midpoint: "Midpoint", rk4: "RK4" };
const EXPONENTS = [0, 1, 2, 3, 4, 5, 6];

const far = (points, goal) => Math.max(...points.map((p, i) => Math.hypot(p[0] - goal[i][0], p[1] - goal[i][1])));

// Points under a whirl that drifts, forwards and back again, by three methods; errors over the number of steps.
export function main(root, data) {
  const figure = panel(root, { method: "midpoint", exponent: 1, strength: data.strengths[1], moment: 2 });
  const { state } = figure;
  const known = new Map();
  const plane = figure.plot({
    name: "points on their way there and back",
    title: "there and back",
    x: { range: [-2.1, 2.1] },
    y: { range: [-2.1, 2.1] },
    width: 330,
    equal: true,
  });
  const chart = figure.plot({
    name: "errors over the number of steps",
    title: "errors",
    x: { range: [0.8, 80], log: true, ticks: [1, 4, 16, 64], label: "steps" },
    y: { range: [1e-11, 10], log: true, ticks: [1e-10, 1e-8, 1e-6, 1e-4, 0.01, 1], label: "largest error (units)" },
    width: 400,
    height: 380,
  });

  // Time is a third coordinate that runs by itself, so that the whirl can drift.
  function velocity([x, y, t]) {
    const [u, v] = data.drift;
    const [a, b] = velocities.whirl({ strength: state.strength, reach: data.reach }, [x - t * u, y - t * v]);
    return [a + u, b + v, 1];
  }
  function moved(points, method, n, taken, time) {
    return taken ? integrate(velocity, points, { steps: taken, time: (time * taken) / n, method }) : points;
  }
  const starts = data.points.map((point) => [...point, 0]);
  function exact([x, y]) {
    const angle = state.strength * Math.exp(-(x * x + y * y) / (2 * data.reach ** 2));
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [c * x - s * y + data.drift[0], s * x + c * y + data.drift[1]];
  }

  function errors() {
    if (!known.has(state.strength)) {
      const goal = data.points.map(exact);
      const rows = Object.keys(METHODS).map((method) => [
        method,
        EXPONENTS.map((exponent) => {
          const n = 2 ** exponent;
          const ends = moved(starts, method, n, n, 1);
          return { n, flow: far(ends, goal), back: far(moved(ends, method, n, n, -1), starts) };
        }),
      ]);
      known.set(state.strength, Object.fromEntries(rows));
    }
    return known.get(state.strength);
  }

  function draw() {
    const n = 2 ** state.exponent;
    const colour = METHODS[state.method];
    const taken = Math.round(state.moment * n);
    const forth = moved(starts, state.method, n, Math.min(taken, n), 1);
    const now = moved(forth, state.method, n, Math.max(0, taken - n), -1);
    plane.dots(starts, { colour: COLOURS.grey, size: 6 });
    if (taken === 2 * n) {
      plane.segments(
        now.map((point, i) => [starts[i], point]),
        { colour: COLOURS.black, width: 1 },
      );
    }
    plane.dots(now, { colour, size: 6 });
    const found = errors();
    for (const [method, rows] of Object.entries(found)) {
      const look = { colour: METHODS[method], width: method === state.method ? 3 : 1.5 };
      const shown = (key) => rows.filter((row) => row[key] > 1e-11).map((row) => [row.n, row[key]]);
      chart.curve(shown("flow"), { ...look, dash: "3 4" });
      chart.curve(shown("back"), look);
      chart.dots(shown("back"), { colour: METHODS[method], size: method === state.method ? 9 : 6 });
    }
    const rows = found[state.method];
    const { flow, back } = rows[state.exponent];
    chart.discs([[n, Math.max(back, 1e-11)]], [9], { colour: COLOURS.black, opacity: 0.4 });
    const next = rows[state.exponent + 1];
    const ratios = next ? [back / next.back, flow / next.flow] : [0, 0];
    const twice = next
      ? ` With twice as many, the return error is divided by ${digits(ratios[0])} and that of the flow by ${digits(ratios[1])}.`
      : "";
    const where = taken === 2 * n ? "back" : `after ${taken} of ${2 * n} steps`;
    return {
      status:
        `${NAMES[state.method]}, ${n} ${n === 1 ? "step" : "steps"} each way, points ${where}. ` +
        `Largest distance from the exact flow ${digits(flow)} (dotted), from the start after the return ${digits(back)} (solid).${twice}`,
      values: { flow, back, ratio: ratios[0], taken, now: far(now, starts) },
    };
  }
  figure.run({
    draw,
    play: {
      perSecond: 16,
      step() {
        state.moment = state.moment >= 2 ? 0 : state.moment + 1 / 32;
        return state.moment < 2;
      },
    },
    controls: [
      { kind: "choice", key: "method", label: "method", options: Object.entries(NAMES) },
      { kind: "range", key: "exponent", label: "steps each way", min: 0, max: 6, step: 1, say: (k) => `${2 ** k}` },
      {
        kind: "range",
        key: "moment",
        label: "time, there and back",
        min: 0,
        max: 2,
        step: 0.03125,
        say: (t) => t.toFixed(2),
      },
      {
        kind: "choice",
        key: "strength",
        label: "strength of the whirl (h Λ = strength / steps)",
        options: data.strengths.map((s) => [s, String(s)]),
      },
    ],
  });
}
