import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { peopleNeeded, powerOfGroups, varianceFactors } from "../../assets/power.js";

const SCANS = [1, 2, 3, 4, 5, 6];
const SIZES = Array.from({ length: 34 }, (_, k) => Math.round(2 * 1.2 ** k)).filter((n, k, all) => n !== all[k - 1]);

// How many people does a study of two groups need, and how well is that number known?
export function main(root, data) {
  const names = Object.keys(data.outcomes);
  const start = { outcome: names[0], people: 23, scans: 1, pilot: data.pilot };
  const figure = panel(root, { ...start, ...settingsOf(data.outcomes[names[0]]) });
  const { state } = figure;
  const powers = figure.plot({
    name: "power over the number of people, with the band of σ",
    x: { range: [2, 700], log: true, label: "people in each group", ticks: [2, 5, 10, 20, 50, 100, 200, 500] },
    y: { range: [0, 100], label: "power (%)" },
    width: 360,
    height: 320,
  });
  const sizes = figure.plot({
    name: "people needed over the scans of each, with the band of σ",
    x: { range: [0.6, 6.4], label: "scans of each person", ticks: SCANS },
    y: { range: [0, 100], label: "people in each group for 80 %" },
    width: 300,
    height: 320,
  });

  // The effect in standard deviations of the people, as k scans of each measure them.
  const seen = (scans) => state.effect / Math.sqrt(state.between ** 2 + state.method ** 2 / scans);
  function drawPowers(factors, effect) {
    const over = (f) => SIZES.map((n) => [n, 100 * powerOfGroups(effect / Math.sqrt(f), n)]);
    const ends = factors.map(over);
    powers.area([...ends[0], ...ends[1].toReversed()], { colour: COLOURS.blue, opacity: 0.2 });
    powers.curve(over(1), { colour: COLOURS.blue, width: 2.5 });
    powers.segments([[[2, 80], [700, 80]]], { colour: COLOURS.grey, dash: "6 4" }); // prettier-ignore
    const power = powerOfGroups(effect, state.people);
    powers.segments([[[state.people, 0], [state.people, 100 * power]]], { colour: COLOURS.vermillion, dash: "4 3" }); // prettier-ignore
    powers.dots([[state.people, 100 * power]], { colour: COLOURS.vermillion, size: 11 });
    return power;
  }
  function drawSizes(factors) {
    const rows = SCANS.map((k) => [1, ...factors].map((f) => peopleNeeded(seen(k) / Math.sqrt(f))));
    sizes.rescale([0, 1.1 * Math.max(...rows.flat())]);
    sizes.segments(
      rows.map(([, low, high], k) => [
        [SCANS[k], low],
        [SCANS[k], high],
      ]),
      { colour: COLOURS.blue, width: 7, opacity: 0.3 },
    );
    sizes.dots(
      rows.map(([n], k) => [SCANS[k], n]),
      { colour: COLOURS.blue, size: 9 },
    );
    const [needed, low, high] = rows[SCANS.indexOf(state.scans)];
    sizes.dots([[state.scans, needed]], { colour: COLOURS.vermillion, size: 11 });
    return { needed, low, high };
  }
  function draw() {
    const factors = varianceFactors(state.pilot - 2);
    const power = drawPowers(factors, seen(state.scans));
    const { needed, low, high } = drawSizes(factors);
    const reliability = state.between ** 2 / (state.between ** 2 + state.method ** 2);
    const scans = state.scans === 1 ? "one scan" : `${state.scans} scans`;
    const status =
      `${state.people} people in each group and ${scans} of each: power ${digits(100 * power)} %. ` +
      `A power of 80 % needs ${needed} in each group. Because ${state.pilot} people gave σ, the 95 % interval of this ` +
      `number is ${low} to ${high}. Reliability of one scan: ${digits(reliability)}.`;
    return { status, values: { power, needed, low, high, reliability } };
  }
  const say = (value) => `${digits(value * data.outcomes[state.outcome].between)} ${data.outcomes[state.outcome].unit}`;
  figure.run({
    draw,
    changed: (key) => key === "outcome" && Object.assign(state, settingsOf(data.outcomes[state.outcome])),
    controls: [
      { kind: "choice", key: "outcome", label: "Outcome", options: names },
      { kind: "range", key: "effect", label: "effect", min: 0.2, max: 2, step: 0.01, say },
      { kind: "range", key: "between", label: "σ between people", min: 0.5, max: 2, step: 0.01, say },
      { kind: "range", key: "method", label: "σ of the method", min: 0, max: 2, step: 0.01, say },
      { kind: "range", key: "people", label: "people in each group", min: 2, max: 200, step: 1 },
      { kind: "range", key: "scans", label: "scans of each person", min: 1, max: 6, step: 1 },
      { kind: "range", key: "pilot", label: "people who gave σ", min: 6, max: 200, step: 2 },
    ],
  });
}

// In units of the spread between people, so that the sliders fit every outcome.
function settingsOf({ effect, between, method }) {
  return { effect: effect / between, between: 1, method: method / between };
}
