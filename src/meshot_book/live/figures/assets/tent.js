import { distributionCost, massUpTo, projectedDistribution } from "../../assets/distribution.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle, project } from "../../assets/projection.js";
import { generator } from "../../assets/random.js";

const SMALLEST = 0.05; // area of a triangle, in units²
const LOOKS = { samples: COLOURS.vermillion, barycentres: COLOURS.blue };

// A triangle projected on a line: the tent, its distribution function, and those of samples and of barycentres.
export function main(root, data) {
  const figure = panel(root, { corners: data.corners, angle: data.angle, n: 2, draw: 0 });
  const { state } = figure;
  const reach = 2.2;
  const plane = figure.plot({
    name: "a triangle, a line, and the projections of the corners",
    x: { range: [-reach, reach] },
    y: { range: [-reach, reach] },
    width: 310,
    equal: true,
  });
  const side = { width: 310, height: 318 };
  const tent = figure.plot({
    name: "the projected density",
    x: { range: [-reach, reach], label: "position on the line (units)" },
    y: { range: [0, 2], label: "density (1/unit)" },
    ...side,
  });
  const shares = figure.plot({
    name: "distribution functions of the triangle, of samples and of barycentres",
    x: { range: [-reach, reach], label: "position on the line (units)" },
    y: { range: [0, 1], label: "share of the mass" },
    width: 640,
    height: 260,
  });

  const direction = () => atAngle((state.angle * Math.PI) / 180);
  const inside = (s, t) =>
    state.corners[0].map((a, k) => a + s * (state.corners[1][k] - a) + t * (state.corners[2][k] - a));
  // Uniform points: the square of shares folded onto the triangle.
  function samples() {
    const random = generator(state.draw);
    return Array.from({ length: state.n ** 2 }, () => {
      const [s, t] = [random(), random()];
      return s + t > 1 ? inside(1 - s, 1 - t) : inside(s, t);
    });
  }
  // Of n² equal parts: those that stand like the triangle, and those upside down.
  function barycentres() {
    const found = [];
    for (const [third, last] of [
      [1 / 3, 1],
      [2 / 3, 2],
    ]) {
      for (let i = 0; i < state.n; i += 1) {
        for (let j = 0; i + j <= state.n - last; j += 1) {
          found.push(inside((i + third) / state.n, (j + third) / state.n));
        }
      }
    }
    return found;
  }
  function atoms(points) {
    const values = project(points, direction()).sort();
    return Array.from(values, (value) => ({ from: value, to: value, mass: 1 / values.length, tilt: 0 }));
  }
  function drawPlane(points) {
    const [c, s] = direction();
    const foot = (value) => [value * c, value * s];
    plane.area(state.corners, { colour: COLOURS.grey, opacity: 0.3 });
    plane.outline(state.corners, { colour: COLOURS.black });
    plane.segments([[foot(-1.5 * reach), foot(1.5 * reach)]], { colour: COLOURS.grey, width: 1 });
    const values = project(state.corners, [c, s]);
    plane.segments(
      state.corners.map((corner, i) => [corner, foot(values[i])]),
      { colour: COLOURS.black, width: 1, dash: "4 4" },
    );
    plane.dots(points.samples, { colour: LOOKS.samples, size: 5 });
    plane.dots(points.barycentres, { colour: LOOKS.barycentres, size: 6, square: true });
    plane.dots(state.corners, { colour: COLOURS.black, size: 11 });
    plane.dots([foot(2)], { colour: COLOURS.green, size: 13 });
  }
  function drawShares(exact, found) {
    const grid = Array.from({ length: 441 }, (_, k) => reach * (k / 220 - 1));
    shares.curve(
      grid.map((x) => [x, massUpTo(exact, x)]),
      { colour: COLOURS.grey, width: 5 },
    );
    for (const [name, parts] of Object.entries(found)) {
      const steps = [[-reach, 0]];
      parts.forEach(({ from, mass }, k) => steps.push([from, k * mass], [from, (k + 1) * mass]));
      const look = { colour: LOOKS[name], width: 1.5, ...(name === "samples" ? { dash: "6 3" } : {}) };
      shares.curve([...steps, [reach, 1]], look);
    }
  }
  function draw() {
    const exact = projectedDistribution(state.corners, [[0, 1, 2]], direction());
    const points = { samples: samples(), barycentres: barycentres() };
    const found = { samples: atoms(points.samples), barycentres: atoms(points.barycentres) };
    const [low, middle, high] = project(state.corners, direction()).sort();
    const peak = 2 / (high - low);
    drawPlane(points);
    tent.rescale([0, Math.max(2, 1.1 * peak)]);
    const sides = exact.flatMap(({ from, to, mass, tilt }) =>
      [
        [from, 1 - tilt],
        [to, 1 + tilt],
      ].map(([x, share]) => [x, (mass * share) / (to - from)]),
    );
    const outline = [[low, 0], ...sides, [high, 0]];
    tent.area(outline, { colour: COLOURS.grey, opacity: 0.3 });
    tent.curve(outline, { colour: COLOURS.black, width: 2 });
    drawShares(exact, found);
    const own = (name) => Math.sqrt(distributionCost(exact, found[name], 2));
    const values = { low, middle, high, peak, samples: own("samples"), barycentres: own("barycentres") };
    const m = state.n ** 2;
    const many = m === 1 ? ["1 sample", "the barycentre"] : [`${m} samples`, `${m} barycentres`];
    const status =
      `The corners project to ${[low, middle, high].map((value) => digits(value)).join(", ")}: the peak is ` +
      `2/(${digits(high)} − ${low < 0 ? `(${digits(low)})` : digits(low)}) = ${digits(peak)}. W₂ to the triangle on this line: ` +
      `${many[0]} ${digits(values.samples)}, ${many[1]} ${digits(values.barycentres)}.`;
    return { status, values };
  }
  figure.movable(plane, {
    key: "corners",
    name: "corners",
    points: () => state.corners,
    step: 0.1,
    move(i, to) {
      const corners = state.corners.with(
        i,
        to.map((value) => Math.min(1.9, Math.max(-1.9, value))),
      );
      const [a, b, c] = corners;
      // A triangle without area has no uniform distribution: the corner stays.
      if (Math.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) > 2 * SMALLEST) {
        state.corners = corners;
      }
    },
  });
  const turn = (degrees) => (state.angle = ((degrees % 360) + 360) % 360);
  function by(degrees) {
    turn(state.angle + degrees);
    figure.changed("angle");
  }
  figure.movable(plane, {
    key: "angle",
    name: "direction of the line",
    step: 0.05,
    say: () => `${Math.round(state.angle)} degrees`,
    points: () => [direction().map((value) => 2 * value)],
    move: (_, [u, v]) => turn((Math.atan2(v, u) * 180) / Math.PI),
    keys: { ArrowLeft: () => by(1), ArrowUp: () => by(1), ArrowRight: () => by(-1), ArrowDown: () => by(-1) },
  });
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "angle",
        label: "angle",
        min: 0,
        max: 359,
        step: 1,
        say: (angle) => `${Math.round(angle)}°`,
      },
      {
        kind: "range",
        key: "n",
        label: "samples and parts",
        min: 1,
        max: 10,
        step: 1,
        say: (n) => `${n * n}`,
      },
      { kind: "button", label: "other samples", press: () => (state.draw += 1) },
    ],
  });
}
