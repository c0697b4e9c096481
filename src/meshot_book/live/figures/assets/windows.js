import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle, slicedLoss } from "../../assets/projection.js";
import { fieldCosine, windowedLoss } from "../../assets/windows.js";

const RADII = [1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 48];
const SURPLUS = [0, 2, 5, 10, 15, 20, 30, 40];
const LONGEST = 9; // of the arrows that are drawn, in mm

const perMass = (gradient, a) => gradient.map((g, i) => g.map((value) => -value / a[i]));

// Two folded sheets out of phase, one with too much mass on its left half: windows, the whole, and what is needed.
export function main(root, data) {
  const figure = panel(root, { radius: 4, surplus: 10, phase: 0.25, p: 1 });
  const { state } = figure;
  const n = data.points;
  const x = Array.from({ length: n }, (_, i) => ((i + 0.5) / n - 0.5) * data.width);
  const sheet = (phase) => x.map((s) => [s, data.height * Math.cos(2 * Math.PI * (s / data.wave + phase))]);
  const lines = Array.from({ length: data.lines }, (_, k) => atAngle((Math.PI * (k + 0.5)) / data.lines));
  const even = x.map(() => 1 / n);
  const known = new Map();
  const half = data.width / 2 + 6;
  const [inWindows, whole] = ["windows", "the whole"].map((title) =>
    figure.plot({ name: title, title, x: { range: [-half, half] }, y: { range: [-13, 13] }, width: 640, equal: true }),
  );
  const overRadius = figure.plot({
    name: "cosine over the radius of the windows",
    title: "cosine over radius",
    x: { range: [0.9, 54], log: true, ticks: [1, 2, 4, 8, 16, 48], label: "radius (mm)" },
    y: { range: [-0.05, 1], label: "cosine", ticks: [0, 0.25, 0.5, 0.75, 1] },
    width: 320,
  });
  const overSurplus = figure.plot({
    name: "cosine of the whole and local share over the surplus",
    title: "sliced loss of the whole",
    x: { range: [0, 41], label: "surplus of the left half (%)", ticks: [0, 10, 20, 30, 40] },
    y: { range: [-0.05, 1], label: "cosine, share", ticks: [0, 0.25, 0.5, 0.75, 1] },
    width: 320,
  });

  function masses(surplus) {
    const own = x.map((s) => 1 + (s < 0 ? surplus : -surplus) / 100);
    const sum = own.reduce((all, value) => all + value, 0);
    return own.map((value) => value / sum);
  }
  function once(key, compute) {
    const name = JSON.stringify([key, state.phase, state.p]);
    if (!known.has(name)) {
      known.set(name, compute());
    }
    return known.get(name);
  }
  function global(surplus) {
    return once(["whole", surplus], () => {
      const [source, target] = [sheet(0), sheet(state.phase)];
      const a = masses(surplus);
      const { cost, gradient } = slicedLoss(source, target, lines, { p: state.p, a, b: even });
      const arrows = perMass(gradient, a);
      const balanced = slicedLoss(source, target, lines, { p: state.p, a: even, b: even }).cost;
      return { cost, arrows, cosine: fieldCosine(arrows, needed(), a), share: balanced / cost };
    });
  }
  function local(radius, surplus) {
    return once(["windows", radius, surplus], () => {
      const a = masses(surplus);
      const target = { points: sheet(state.phase), masses: even };
      const centres = target.points.filter((_, i) => i % data.every === data.first);
      const found = windowedLoss({ points: sheet(0), masses: a }, target, centres, radius, lines, state.p);
      const arrows = perMass(found.gradient, a);
      return { ...found, arrows, cosine: fieldCosine(arrows, needed(), a), windows: centres.length, centres };
    });
  }
  function needed() {
    const target = sheet(state.phase);
    return sheet(0).map(([u, v], i) => [target[i][0] - u, target[i][1] - v]);
  }

  function field(plot, arrows, colour) {
    plot.curve(sheet(state.phase), { colour: COLOURS.grey, width: 3 });
    plot.curve(sheet(0), { colour, width: 1, opacity: 0.7 });
    const longest = Math.max(...arrows.map((arrow) => Math.hypot(...arrow)), 1e-12);
    const shown = arrows.map((arrow) => arrow.map((value) => (LONGEST * value) / longest));
    plot.arrows(sheet(0), shown, { colour, width: 1.3 });
  }
  function draw() {
    const [windows, all] = [local(state.radius, state.surplus), global(state.surplus)];
    field(inWindows, windows.arrows, COLOURS.orange);
    const middle = windows.centres[Math.floor(windows.centres.length / 2)];
    const ring = Array.from({ length: 61 }, (_, k) => atAngle((2 * Math.PI * k) / 60));
    for (const { reach, dash } of [{ reach: 1 }, { reach: 2.5, dash: "3 4" }]) {
      const circle = ring.map((u) => u.map((value, c) => middle[c] + reach * state.radius * value));
      inWindows.curve(
        circle.filter(([u, v]) => Math.abs(u) < half && Math.abs(v) < 13),
        { colour: COLOURS.black, width: 1, dash },
      );
    }
    field(whole, all.arrows, COLOURS.blue);
    const curve = RADII.map((radius) => [radius, local(radius, state.surplus).cosine]);
    overRadius.curve(curve, { colour: COLOURS.orange, width: 2 });
    overRadius.segments(
      [
        [
          [0.9, all.cosine],
          [54, all.cosine],
        ],
      ],
      { colour: COLOURS.blue, width: 2, dash: "6 3" },
    );
    overRadius.discs([[state.radius, windows.cosine]], [7], { colour: COLOURS.orange });
    const rows = SURPLUS.map((surplus) => ({ surplus, ...global(surplus) }));
    overSurplus.curve(
      rows.map((row) => [row.surplus, row.cosine]),
      { colour: COLOURS.blue, width: 2, dash: "6 3" },
    );
    overSurplus.curve(
      rows.map((row) => [row.surplus, row.share]),
      { colour: COLOURS.black, width: 1.5, dash: "2 3" },
    );
    overSurplus.discs([[state.surplus, all.cosine]], [7], { colour: COLOURS.blue });
    overSurplus.discs([[state.surplus, all.share]], [5], { colour: COLOURS.black });
    return {
      status:
        `Windows of ${state.radius} mm: cosine ${digits(windows.cosine, 2)} with what is needed ` +
        `(${windows.counted} of ${windows.windows} windows hold mass of both). Sliced loss of the whole: ` +
        `cosine ${digits(all.cosine, 2)}; with the masses balanced ${digits(100 * all.share, 2)} % of its value would be left.`,
      values: {
        windows: windows.cosine,
        whole: all.cosine,
        share: all.share,
        cost: all.cost,
        counted: windows.counted,
        local: windows.cost,
      },
    };
  }
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "radius",
        label: "radius of the windows",
        min: 1,
        max: 48,
        step: 0.5,
        say: (r) => `${r} mm`,
      },
      {
        kind: "range",
        key: "surplus",
        label: "surplus of the left half",
        min: 0,
        max: 40,
        step: 1,
        say: (s) => `${s} %`,
      },
      {
        kind: "choice",
        key: "phase",
        label: "the target is shifted by",
        options: [
          [0.25, "a quarter of a wave"],
          [0.5, "half a wave"],
        ],
      },
      {
        kind: "choice",
        key: "p",
        label: "exponent p",
        options: [
          [1, "1"],
          [2, "2"],
        ],
      },
    ],
  });
}
