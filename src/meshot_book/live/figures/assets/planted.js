import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { estimate } from "../../assets/random.js";

// An error planted in a surface, a metric, a number of points: is the value above those of the target with itself?
export function main(root, data) {
  const names = Object.keys(data.errors);
  const figure = panel(root, {
    error: data.start.error,
    size: data.start.size,
    metric: data.start.metric,
    count: data.start.count,
    show: "after my guess",
    guess: "",
    right: 0,
    asked: 0,
  });
  const { state } = figure;
  const section = figure.plot({
    name: "a section through the target, and through the surface with the error",
    x: { range: [-1, 1] },
    y: { range: [-1, 1] },
    equal: true,
    width: 300,
  });
  const strip = figure.plot({
    name: "the value for the error beside ten values of the target with itself",
    x: { range: [0, 1] },
    y: { range: [0, 1], label: "value (mm)" },
    width: 300,
    height: 300,
  });
  const bars = figure.plot({
    name: "each metric at 20,000 points, relative to its value for noise of 0.2 mm",
    x: { range: [0.002, 700], log: true, label: "times the value for noise of 0.2 mm", ticks: [0.1, 1, 10, 100] },
    y: { range: [data.metrics.length - 0.4, -0.6] },
    width: 480,
    height: 26 * data.metrics.length + 60,
  });

  const planted = () => data.errors[state.error].states[state.size];
  // The chosen value, the reference and the ten values of the target; null where a value was not measured.
  function chosen() {
    const k = data.counts.indexOf(state.count);
    const [value, reference, floor] = [planted().measured, data.reference, data.floors].map(
      (all) => all[state.metric][k] ?? null,
    );
    return value === null ? null : { value, reference, floor, above: value > Math.max(...floor) + 1e-9 };
  }
  const open = () => state.show === "at once" || state.guess !== "";

  function drawSection() {
    const { half, bar, target } = data.errors[state.error];
    const drawn = (chains, look) => chains.forEach((chain) => section.curve(pairs(chain), look));
    drawn(target, { colour: COLOURS.grey, width: 5, opacity: 0.6 });
    drawn(planted().lines, { colour: COLOURS.vermillion, width: 1.5 });
    section.segments([[[0.92 - bar / half, -0.92], [0.92, -0.92]]], { colour: COLOURS.black, width: 2 }); // prettier-ignore
    section.text([0.92, -0.86], `${bar} mm`, { "text-anchor": "end" });
  }
  function drawStrip(found) {
    if (!found) {
      strip.text([0.5, 0.5], "not measured", { "text-anchor": "middle" });
      return;
    }
    const { value, reference, floor } = found;
    const shown = open() ? [...floor, reference, value] : [...floor, reference];
    const most = 1.25 * Math.max(...shown) || 1;
    strip.rescale([0, most]);
    const top = Math.max(...floor);
    strip.segments([[[0, top], [1, top]]], { colour: COLOURS.grey, width: 1.5, dash: "6 4" }); // prettier-ignore
    strip.dots(floor.map((each, k) => [0.12 + 0.02 * k, each]), { colour: COLOURS.grey, size: 10 }); // prettier-ignore
    strip.dots([[0.5, reference]], { colour: COLOURS.blue, size: 11, square: true });
    const at = (x, words) => strip.text([x, 0.93 * most], words, { "text-anchor": "middle" });
    at(0.21, "target");
    at(0.5, "noise");
    at(0.82, open() ? "error" : "error: ?");
    if (open()) {
      strip.dots([[0.82, value]], { colour: COLOURS.vermillion, size: 14 });
    }
  }
  // Grey up to twice the reference; a tenth of it where a bar begins, and at most a hundred times.
  function drawBars() {
    const { ratios, values } = planted();
    data.metrics.forEach((name, k) => {
      bars.text([0.075, k + 0.2], name, { "text-anchor": "end" });
      const ratio = Math.min(100, Math.max(0.1, ratios[k] ?? 100));
      if (open()) {
        const colour = (ratios[k] ?? Infinity) > data.seen ? COLOURS.blue : COLOURS.grey;
        bars.segments([[[0.1, k], [ratio, k]]], { colour, width: 14 }); // prettier-ignore
        bars.text([650, k + 0.2], values[k], { "text-anchor": "end" });
      }
    });
    bars.segments([[[1, -0.6], [1, data.metrics.length - 0.4]]], { colour: COLOURS.black }); // prettier-ignore
  }
  function draw() {
    const found = chosen();
    drawSection();
    drawStrip(found);
    drawBars();
    const points = state.metric === data.exact ? "no points" : `${state.count.toLocaleString("en")} points`;
    const head = `${state.error}, ${planted().size}; ${state.metric}, ${points}: `;
    if (!found) {
      return { status: `${head}not measured, since exact transport of so many points takes minutes.`, values: {} };
    }
    const floor = estimate(found.floor);
    const spread = floor.error * Math.sqrt(found.floor.length);
    const own = floor.mean < 1e-9 ? "0" : `${digits(floor.mean, 2)} ± ${digits(spread, 2)} mm`;
    const detected = data.metrics.filter((_, k) => (planted().ratios[k] ?? Infinity) > data.seen);
    const values = { floor: floor.mean, spread, asked: state.asked, right: state.right };
    if (!open()) {
      return { status: `${head}the target with itself gives ${own}. Is the error above all ten?`, values };
    }
    const verdict = state.guess ? ` Your guess is ${guessed(found) ? "right" : "wrong"}.` : "";
    const score = state.asked ? ` So far ${state.right} of ${state.asked}.` : "";
    const status =
      `${head}${found.value < 1e-9 ? 0 : digits(found.value, 3)} mm, the target with itself ${own}. ` +
      `${found.above ? "Above" : "Not above"} all ten.${verdict}${score} ` +
      `Detected at 20,000 points by ${detected.join(", ") || "none"}.`;
    return {
      status,
      values: { ...values, value: found.value, above: Number(found.above), detected: detected.join("|") },
    };
  }
  const guessed = ({ above }) => (state.guess === "above") === above;
  function guess(word) {
    state.guess = word;
    state.asked += 1;
    state.right += Number(guessed(chosen()));
  }
  const asking = () => !open() && chosen() !== null;
  figure.run({
    draw,
    changed(key) {
      state.size = Math.min(state.size, data.errors[state.error].states.length - 1);
      if (key) {
        state.guess = "";
      }
    },
    controls: [
      { kind: "choice", key: "error", label: "Error", options: names },
      {
        kind: "range",
        key: "size",
        label: "size",
        min: 0,
        max: Math.max(...names.map((name) => data.errors[name].states.length)) - 1,
        step: 1,
        say: (k) => data.errors[state.error].states[k]?.size ?? "",
        when: () => data.errors[state.error].states.length > 1,
      },
      { kind: "choice", key: "metric", label: "Metric", options: Object.keys(data.floors) },
      {
        kind: "choice",
        key: "count",
        label: "Points",
        options: data.counts.map((count) => [count, count.toLocaleString("en")]),
        when: () => state.metric !== data.exact,
      },
      { kind: "button", label: "I guess: above", press: () => guess("above"), when: asking },
      { kind: "button", label: "I guess: not above", press: () => guess("not"), when: asking },
      { kind: "choice", key: "show", label: "Show", options: ["after my guess", "at once"] },
    ],
  });
}

function pairs(numbers) {
  return Array.from({ length: numbers.length / 2 }, (_, i) => [numbers[2 * i] / 400, numbers[2 * i + 1] / 400]);
}
