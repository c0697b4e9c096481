import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const INKS = ["blue", "vermillion", "green", "orange", "purple", "sky", "black", "grey"].map((name) => COLOURS[name]);
const DASHES = ["", "7 4"];

// Learning curves of trainings: which is first after how many steps?
export function main(root, data) {
  const groups = [...new Set(data.courses.map(({ group }) => group))];
  const most = Math.max(...groups.map((name) => data.courses.filter(({ group }) => group === name).length));
  const figure = panel(root, { group: groups[0], budget: data.budget, kept: "last", rates: false });
  const { state } = figure;
  const curves = figure.plot({
    name: "distance in validation over the steps",
    x: { range: [50, 17000], log: true, label: "steps", ticks: [100, 300, 1000, 3000, 10000] },
    y: { range: [0.25, 0.7], label: "ASSD in validation (mm)" },
    width: 350,
    height: 340,
  });
  const list = figure.plot({
    name: "the trainings in their order at this budget",
    x: { range: [0, 1] },
    y: { range: [most + 1.2, 0] },
    width: 320,
    height: 340,
  });

  const steps = () => Math.round(10 ** state.budget);
  // The value of a course after so many steps: of the last check until then, or the smallest so far.
  function valueOf({ step, assd }, at) {
    const seen = assd.slice(0, step.filter((each) => each <= at).length);
    return state.kept === "best" ? Math.min(...seen) : (seen.at(-1) ?? Infinity);
  }
  function draw() {
    const own = data.courses.filter(({ group }) => group === state.group);
    const looks = own.map((_, k) => ({ colour: INKS[k % 8], dash: DASHES[Math.floor(k / 8)], width: 2 }));
    const all = own.flatMap(({ assd, rates }) => [...assd, ...(state.rates ? rates : [])]).concat(data.start);
    const [low, high] = [Math.min(...all), Math.max(...all)];
    curves.rescale([low - 0.05 * (high - low), high + 0.05 * (high - low)]);
    curves.segments([[[50, data.start], [17000, data.start]]], { colour: COLOURS.grey, width: 2, dash: "2 4" }); // prettier-ignore
    curves.segments([[[steps(), low], [steps(), high]]], { colour: COLOURS.grey, width: 1 }); // prettier-ignore
    own.forEach((course, k) => {
      curves.curve(
        course.step.map((step, i) => [step, course.assd[i]]),
        looks[k],
      );
      if (state.rates) {
        const places = course.rates.map((score, i) => [data.short * [0.87, 1, 1.15][i], score]);
        curves.dots(places, { ...looks[k], size: 6, square: true });
      }
    });
    const rows = own.map((course, k) => ({ ...course, ...looks[k], value: valueOf(course, steps()) }));
    const checked = rows.filter(({ value }) => value < Infinity).toSorted((a, b) => a.value - b.value);
    const later = rows.toSorted((a, b) => valueOf(a, Infinity) - valueOf(b, Infinity));
    curves.dots(
      checked.map(({ value }) => [steps(), value]),
      { colour: COLOURS.black, size: 5 },
    );
    list.text([0, 0.5], `after ${steps().toLocaleString("en")} steps (mm)`);
    list.text([1, 0.5], "at the end", { "text-anchor": "end" });
    checked.forEach((row, k) => {
      list.dots([[0.02, k + 1.35]], { colour: row.colour, size: 10, square: row.dash !== "" });
      list.text([0.06, k + 1.5], `${row.value.toFixed(3)} ${row.name}`);
      list.text([1, k + 1.5], `${later.findIndex(({ name }) => name === row.name) + 1}.`, { "text-anchor": "end" });
    });
    const nearer = checked.filter(({ value }) => value < data.start).length;
    const ended = checked.filter(({ step }) => step.at(-1) < steps()).length;
    const first = checked[0];
    const status = first
      ? `After ${steps().toLocaleString("en")} steps ${first.name} is first, ${digits(first.value)} mm; the last is ` +
        `${checked.at(-1).name}, ${digits(checked.at(-1).value)} mm. ${nearer} of ${checked.length} are nearer than the ` +
        `initial surface (${digits(data.start)} mm).${ended ? ` ${ended} have ended before.` : ""}`
      : "No training has been checked yet.";
    const order = checked.map(({ name }) => name).join(" | ");
    return { status, values: { order, first: first?.value ?? -1, nearer, ended } };
  }
  figure.run({
    draw,
    controls: [
      { kind: "choice", key: "group", label: "Trainings", options: groups },
      { kind: "range", key: "budget", label: "budget", min: 1.75, max: 4.18, step: 0.01, say },
      {
        kind: "choice",
        key: "kept",
        label: "Weights",
        options: [
          ["last", "of the last check"],
          ["best", "of the best check so far"],
        ],
      },
      { kind: "check", key: "rates", label: "scores of the three rates, in short trainings" },
    ],
  });
}

function say(value) {
  return `${Math.round(10 ** value).toLocaleString("en")} steps`;
}
