import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const DEVIATIONS = 2; // a value counts as above the floor from here

// The floor of a metric over the number of points, and the errors whose expected value lies above it.
export function main(root, data) {
  const figure = panel(root, { metric: "SWD", size: 4.3 });
  const { state } = figure;
  const names = Object.keys(data.levels.SWD);
  const [low, high] = [3, 5];
  const curve = figure.plot({
    name: "the floor over the number of points, with two standard deviations",
    x: { range: [10 ** low, 10 ** high], log: true, label: "points on each side" },
    y: { range: [0, 1], label: "target with itself (mm)" },
    width: 300,
    height: 330,
  });
  const rows = figure.plot({
    name: "ten errors: the value without sampling, and the expected value with it",
    x: { range: [0, 1] },
    y: { range: [names.length + 0.6, -0.9] },
    width: 360,
    height: 330,
  });

  function draw() {
    const count = Math.round(10 ** state.size);
    const { mean, spread, measured } = floorAt(data.floors[state.metric], count);
    const edge = mean + DEVIATIONS * spread;
    const levels = data.levels[state.metric];
    const expected = names.map((name) => Math.hypot(levels[name], mean));
    const above = names.filter((_, k) => expected[k] > edge + 1e-9);
    drawCurve(count, mean);
    drawRows(mean, edge, levels, expected);
    const floor = mean ? `${digits(mean, 2)} ± ${digits(spread, 2)} mm${measured ? "" : " (extrapolated)"}` : "0";
    const status =
      `${state.metric}, ${count.toLocaleString("en")} points: floor ${floor}. ` +
      `${above.length} of ${names.length} errors are expected above it: ${above.join(", ") || "none"}.`;
    return { status, values: { count, mean, spread, edge, above: above.length, shift: expected[0] } };
  }
  function drawCurve(count, mean) {
    const sizes = Array.from({ length: 41 }, (_, k) => 10 ** (low + (k / 40) * (high - low)));
    const found = sizes.map((m) => ({ m, ...floorAt(data.floors[state.metric], m) }));
    const most = 1.2 * (found[0].mean + DEVIATIONS * found[0].spread) || 1;
    curve.rescale([0, most]);
    const side = (sign) => found.map(({ m, mean: at, spread }) => [m, at + sign * DEVIATIONS * spread]);
    curve.area([...side(1), ...side(-1).toReversed()], { colour: COLOURS.grey });
    const line = (kept, look) => curve.curve(kept.map((one) => [one.m, one.mean]), { colour: COLOURS.black, width: 2, ...look }); // prettier-ignore
    line(found.filter(({ measured }) => measured)); // prettier-ignore
    line(
      found.filter(({ measured }) => !measured),
      { dash: "6 4" },
    );
    curve.segments([[[count, 0], [count, most]]], { colour: COLOURS.vermillion, dash: "4 3" }); // prettier-ignore
    curve.dots([[count, mean]], { colour: COLOURS.vermillion, size: 11 });
  }
  function drawRows(mean, edge, levels, expected) {
    const most = 1.06 * Math.max(edge, ...expected);
    // The names stand left of zero: places are shares of what is left.
    const at = (value) => 0.38 + (0.6 * value) / most;
    const [bottom, top] = [names.length - 0.5, -0.5];
    rows.area([[at(Math.max(0, 2 * mean - edge)), bottom], [at(edge), bottom], [at(edge), top], [at(Math.max(0, 2 * mean - edge)), top]], { colour: COLOURS.grey }); // prettier-ignore
    rows.segments([[[at(mean), bottom], [at(mean), top]], [[at(0), bottom], [at(0), top]]], { colour: COLOURS.black, width: 1 }); // prettier-ignore
    rows.text([at(mean), -0.55], "floor", { "text-anchor": "middle" });
    for (const value of [0, most / 1.06]) {
      rows.text([at(value), names.length + 0.4], `${digits(value, 2)} mm`, { "text-anchor": "middle" });
    }
    names.forEach((name, k) => {
      const seen = expected[k] > edge + 1e-9;
      rows.text([0.36, k + 0.2], name, { "text-anchor": "end" });
      rows.segments(
        [
          [
            [at(levels[name]), k],
            [at(expected[k]), k],
          ],
        ],
        { colour: COLOURS.grey, width: 1 },
      );
      rows.dots([[at(levels[name]), k]], { colour: COLOURS.blue, size: 8, square: true });
      rows.dots([[at(expected[k]), k]], { colour: seen ? COLOURS.vermillion : COLOURS.grey, size: 11 });
    });
  }
  figure.run({
    draw,
    controls: [
      { kind: "choice", key: "metric", label: "Metric", options: Object.keys(data.floors) },
      {
        kind: "range",
        key: "size",
        label: "points",
        min: low,
        max: high,
        step: 0.05,
        say: (size) => Math.round(10 ** size).toLocaleString("en"),
      },
    ],
  });
}

// Mean and standard deviation: straight in logarithms between the sizes measured; above them by the law of matching,
// √(A (log m + c) / 2πm), with the last ratio of the two. A metric without sizes has no floor.
function floorAt({ m, mean, spread, area, c }, count) {
  if (m.length === 0) {
    return { mean: 0, spread: 0, measured: true };
  }
  const last = m.length - 1;
  if (count > m[last]) {
    const value = Math.sqrt((area * (Math.log(count) + c)) / (2 * Math.PI * count));
    return { mean: value, spread: (value * spread[last]) / mean[last], measured: false };
  }
  const after = Math.max(1, m.findIndex((size) => size >= count)); // prettier-ignore
  const share = Math.log(count / m[after - 1]) / Math.log(m[after] / m[after - 1]);
  const between = (values) => values[after - 1] * (values[after] / values[after - 1]) ** share;
  return { mean: between(mean), spread: between(spread), measured: true };
}
