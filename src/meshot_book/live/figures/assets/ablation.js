import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const WIDEST = 1.4; // of the axis of the loss in the second plot
const INKS = ["blue", "vermillion", "green", "orange", "purple", "sky"].map((name) => COLOURS[name]);

// The course of several trainings: does a measure of the surface improve while the training's own loss falls?
export function main(root, data) {
  const arms = data.trainings.map(({ name }) => name);
  const measures = Object.keys(data.start);
  const last = data.trainings[0].steps.at(-1);
  const first = data.trainings[0].steps[0];
  const figure = panel(root, { arm: arms[0], step: last, measure: measures[0], others: false });
  const { state } = figure;
  const ratios = data.trainings.flatMap(ratiosOf);
  const span = [0.7 * Math.min(...ratios), 1.4 * Math.max(...ratios)];
  const losses = figure.plot({
    name: "the loss of a training over its value at the beginning",
    x: { range: [0, last], label: "step" },
    y: { range: span, log: true, label: "own loss / at the beginning" },
    width: 330,
    height: 300,
  });
  const plane = figure.plot({
    name: "the measure over the loss, check by check",
    x: { range: [0.2, WIDEST], label: "own loss / at the beginning" },
    y: { range: [0, 1], label: "validation: the chosen measure" },
    width: 330,
    height: 300,
  });

  // The checks until now, each with the loss at its step.
  function checksOf(training, until = state.step) {
    const loss = ratiosOf(training);
    const seen = training.checks.filter(({ step }) => step <= until);
    return seen.map((check) => [loss[training.steps.indexOf(check.step)], check[state.measure]]);
  }
  function onAxis([ratio]) {
    return ratio <= WIDEST;
  }
  function draw() {
    const chosen = data.trainings[arms.indexOf(state.arm)];
    const shown = state.others ? data.trainings : [chosen];
    const start = data.start[state.measure];
    const all = shown.flatMap((training) => checksOf(training, last).filter(onAxis)).map(([, value]) => value);
    const ends = [...all, ...(start ? [start] : [])];
    const [low, high] = ends.length ? [Math.min(...ends), Math.max(...ends)] : [0, 1];
    const edge = 0.12 * (high - low || 1);
    plane.rescale([low - edge, high + edge]);
    if (start) {
      plane.segments([[[0.2, start], [WIDEST, start]]], { colour: COLOURS.grey, width: 2, dash: "2 4" }); // prettier-ignore
    }
    losses.segments([[[0, 1], [last, 1]]], { colour: COLOURS.grey, width: 2, dash: "2 4" }); // prettier-ignore
    losses.segments([[[state.step, span[0]], [state.step, span[1]]]], { colour: COLOURS.grey, width: 1 }); // prettier-ignore
    for (const training of shown) {
      const look = { colour: INKS[arms.indexOf(training.name) % 6], width: training === chosen ? 2.5 : 1 };
      const loss = ratiosOf(training);
      losses.curve(
        training.steps.map((step, k) => [step, loss[k]]),
        look,
      );
      const path = checksOf(training).filter(onAxis);
      plane.curve(path, look);
      plane.dots(path, { ...look, size: training === chosen ? 7 : 4 });
      plane.dots(path.slice(-1), { ...look, size: training === chosen ? 13 : 7 });
    }
    if (!checksOf(chosen).every(onAxis)) {
      plane.text([WIDEST, high], "its loss is beyond this axis", { "text-anchor": "end" });
    }
    const k = chosen.steps.findLastIndex((step) => step <= state.step);
    const ratio = ratiosOf(chosen)[k];
    losses.dots([[chosen.steps[k], ratio]], { colour: INKS[arms.indexOf(state.arm) % 6], size: 12 });
    const value = checksOf(chosen).at(-1)?.[1] ?? -1;
    const unit = data.units[state.measure];
    const found = value < 0 ? "not checked yet" : `${digits(value)}${unit} at the last check`;
    const before = start ? ` (initial surface: ${digits(start)}${unit})` : "";
    const status =
      `${state.arm}, step ${state.step}: its own loss is ${digits(ratio)} times that at the beginning. ` +
      `${state.measure} in validation: ${found}${before}.`;
    return { status, values: { ratio, value, step: state.step } };
  }
  figure.run({
    draw,
    play: {
      perSecond: 15,
      step() {
        state.step = state.step >= last ? first : state.step + data.every;
        return state.step < last;
      },
    },
    controls: [
      { kind: "choice", key: "arm", label: "Training", options: arms },
      { kind: "range", key: "step", label: "step", min: first, max: last, step: data.every },
      { kind: "choice", key: "measure", label: "Measure", options: measures },
      { kind: "check", key: "others", label: "all trainings" },
    ],
  });
}

// The mean of the last eleven entries, a tenth of the training, over the first one.
function ratiosOf({ loss }) {
  return loss.map((_, k) => {
    const late = loss.slice(Math.max(0, k - 10), k + 1);
    return late.reduce((sum, value) => sum + value, 0) / late.length / loss[0];
  });
}
