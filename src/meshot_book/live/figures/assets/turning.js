import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle, planeDirections, project, slicedLoss } from "../../assets/projection.js";
import { estimate, generator } from "../../assets/random.js";
import { orderOf } from "../../assets/transport.js";

const NAMES = ["source", "target"];
const LOOKS = { source: { colour: COLOURS.blue }, target: { colour: COLOURS.orange, square: true } };
/** @type {import("../../assets/projection.js").Kind[]} */
const KINDS = ["random", "orthogonal", "equally spaced", "low-discrepancy"];
const ROWS = [1.25, 1.5]; // distances of the two rows of projections from the middle, in radii

// A line through two clouds, turned by hand; then many lines: an estimate and its error.
export function main(root, data) {
  const figure = panel(root, {
    source: data.source,
    target: data.target,
    angle: data.angle,
    kind: KINDS[0],
    count: 10,
    draw: 0,
  });
  const { state } = figure;
  const radius = Math.max(...NAMES.flatMap((name) => data[name].map((point) => Math.hypot(...point))));
  const range = [-1.8 * radius, 1.8 * radius];
  const plane = figure.plot({
    name: "two clouds, a line, and their projections",
    x: { range },
    y: { range },
    equal: true,
  });
  const curve = figure.plot({
    name: "the cost over the angle of the line",
    x: { range: [0, 180], label: "angle of the line (degrees)", ticks: [0, 45, 90, 135, 180] },
    y: { range: [0, 1], label: "cost on the line (units²)" },
    height: 330,
  });
  const strip = figure.plot({
    name: "the estimates so far, for each kind of directions",
    x: { range: [0.5, 4.5], ticks: [] },
    y: { range: [0, 1], label: "estimates so far (units²)" },
    width: 640,
    height: 190,
  });
  let angles = [];
  let estimates = [];

  const costsAt = (degrees) => {
    const lines = degrees.map((angle) => atAngle((angle * Math.PI) / 180));
    return [...slicedLoss(state.source, state.target, lines).costs];
  };
  function sample() {
    const lines = planeDirections(state.kind, state.count, generator(state.draw));
    angles = lines.map(([c, s]) => ((Math.atan2(s, c) * 180) / Math.PI + 180) % 180);
    estimates.push([KINDS.indexOf(state.kind), estimate(costsAt(angles)).mean]);
  }
  // Of independent values: single lines, or the means of pairs at right angles.
  function errorOf(costs) {
    const pairs = costs.filter((_, l) => l % 2 === 0).map((cost, k) => (cost + (costs[2 * k + 1] ?? cost)) / 2);
    return { random: () => estimate(costs).error, orthogonal: () => estimate(pairs).error }[state.kind]?.() ?? NaN;
  }
  function drawPlane() {
    const [c, s] = atAngle((state.angle * Math.PI) / 180);
    const ends = [];
    NAMES.forEach((name, k) => {
      const shift = ROWS[k] * radius;
      const foot = (value) => [value * c + shift * s, value * s - shift * c];
      const values = project(state[name], [c, s]);
      plane.segments([[foot(-1.1 * radius), foot(1.1 * radius)]], { colour: COLOURS.grey, width: 1 });
      plane.segments(
        state[name].map((point, i) => [point, foot(values[i])]),
        { ...LOOKS[name], width: 1, opacity: 0.35 },
      );
      plane.dots(state[name], { ...LOOKS[name], size: 9 });
      ends.push(Array.from(orderOf(values), (i) => foot(values[i])));
      plane.dots(ends[k], { ...LOOKS[name], size: 6 });
    });
    plane.segments(
      ends[0].map((end, r) => [end, ends[1][r]]),
      { colour: COLOURS.black, width: 1.5 },
    );
    const tip = [1.6 * radius * c, 1.6 * radius * s];
    plane.segments([[[0, 0], tip]], { colour: COLOURS.vermillion, width: 1.5, dash: "6 4" });
    plane.dots([tip], { colour: COLOURS.vermillion, size: 13 });
  }
  function drawCosts(truth, found, costs) {
    const all = Array.from({ length: 181 }, (_, angle) => angle);
    const values = costsAt(all);
    curve.rescale([0, 1.1 * Math.max(...values)]);
    const { mean, error } = found;
    const band = (from, to) => [
      [from, mean - error],
      [to, mean - error],
      [to, mean + error],
      [from, mean + error],
    ];
    if (error >= 0) {
      curve.area(band(0, 180), { colour: COLOURS.vermillion, opacity: 0.15 });
    }
    curve.segments([[[0, truth], [180, truth]]], { colour: COLOURS.grey, width: 2, dash: "7 5" }); // prettier-ignore
    curve.segments([[[0, mean], [180, mean]]], { colour: COLOURS.vermillion, width: 1.5 }); // prettier-ignore
    curve.curve(all.map((angle) => [angle, values[angle]]), { colour: COLOURS.black, width: 2.5 }); // prettier-ignore
    curve.dots(
      angles.map((angle, l) => [angle, costs[l]]),
      { colour: COLOURS.vermillion, size: 7, opacity: 0.7 },
    );
    curve.dots([[state.angle, costsAt([state.angle])[0]]], { colour: COLOURS.black, size: 11 });
    const spread = Math.max(0.3 * truth, ...estimates.map(([, value]) => 1.1 * Math.abs(value - truth)));
    strip.rescale([truth - spread, truth + spread]);
    strip.segments([[[0.5, truth], [4.5, truth]]], { colour: COLOURS.grey, width: 2, dash: "7 5" }); // prettier-ignore
    const places = estimates.map(([kind, value], k) => [kind + 0.7 + 0.6 * ((k * 0.618) % 1), value]);
    strip.dots(places, { colour: COLOURS.vermillion, size: 7, opacity: 0.7 });
    // In two rows, so that the names do not meet on a telephone.
    KINDS.forEach((kind, k) =>
      strip.text([k + 1.45, truth - (k % 2 ? 0.7 : 0.95) * spread], kind, { "text-anchor": "end" }),
    );
  }
  function draw() {
    const costs = costsAt(angles);
    const found = { mean: estimate(costs).mean, error: errorOf(costs) };
    const truth = estimate(costsAt(Array.from({ length: 180 }, (_, angle) => angle))).mean;
    drawPlane();
    drawCosts(truth, found, costs);
    const cost = costsAt([state.angle])[0];
    const bar = found.error >= 0 ? ` ± ${digits(found.error, 2)}` : " (no error bar from one draw)";
    const status =
      `Angle ${Math.round(state.angle)}°: cost ${digits(cost)}. Mean over all angles: ${digits(truth)}. ` +
      `${state.count} ${state.kind} ${state.count === 1 ? "line" : "lines"}: ${digits(found.mean)}${bar}.`;
    const values = { angle: state.angle, cost, mean: truth, estimate: found.mean, error: found.error };
    return { status, values: { ...values, drawn: estimates.length } };
  }
  for (const name of NAMES) {
    figure.movable(plane, {
      key: name,
      name: `${name} points`,
      points: () => state[name],
      step: 0.05,
      move: (i, to) => (state[name][i] = to),
    });
  }
  const turn = (degrees) => (state.angle = ((degrees % 180) + 180) % 180);
  figure.movable(plane, {
    key: "angle",
    name: "direction of the line",
    step: 0.05,
    say: () => `${Math.round(state.angle)} degrees`,
    points: () => [atAngle((state.angle * Math.PI) / 180).map((value) => 1.6 * radius * value)],
    move: (_, [u, v]) => turn((Math.atan2(v, u) * 180) / Math.PI),
    keys: { ArrowLeft: () => by(1), ArrowUp: () => by(1), ArrowRight: () => by(-1), ArrowDown: () => by(-1) },
  });
  function by(degrees) {
    turn(state.angle + degrees);
    figure.changed("angle");
  }
  figure.run({
    play: { step: () => turn(state.angle + 1) >= 0, perSecond: 20 },
    draw,
    changed(key) {
      if (key === null || NAMES.includes(key)) {
        estimates = [];
      }
      if (key !== "angle") {
        sample();
      }
    },
    controls: [
      {
        kind: "range",
        key: "angle",
        label: "angle",
        min: 0,
        max: 179,
        step: 1,
        say: (angle) => `${Math.round(angle)}°`,
      },
      { kind: "choice", key: "kind", label: "Lines", options: KINDS },
      { kind: "range", key: "count", label: "how many", min: 1, max: 100, step: 1 },
      { kind: "button", key: "draw", label: "draw again", press: () => (state.draw += 1) },
    ],
  });
}
