import { expectedLargest, leadByChance } from "../../assets/normal.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { estimate, generator, normal } from "../../assets/random.js";

const LONGEST = 60;
const FIRST = 20; // studies at the beginning
const COUNTS = Array.from({ length: LONGEST - 1 }, (_, k) => k + 2);

// Losses that are equally good, with noisy scores: how much better than it is does the best of them look?
export function main(root, data) {
  const figure = panel(root, {
    count: data.count,
    between: data.between,
    seeds: 1,
    subject: data.subject,
    subjects: data.subjects,
    lead: data.lead,
    draw: 1,
  });
  const { state } = figure;
  const scores = figure.plot({
    name: "the scores of one study, the best of them, and its score when it is measured again",
    x: { range: [0, 1] },
    y: { range: [-0.03, 0.03], label: "score minus true value (mm)" },
    width: 330,
    height: 300,
  });
  const luck = figure.plot({
    name: "how much better the best looks, over the number of losses",
    x: { range: [1.8, 66], log: true, label: "number of losses", ticks: [2, 3, 6, 10, 20, 30, 60] },
    y: { range: [0, 0.03], label: "luck of the best (mm)" },
    width: 330,
    height: 300,
  });
  const largest = COUNTS.map(expectedLargest);
  let random = generator(state.draw);
  let last = { drawn: [0], best: 0, again: 0 };
  let lucks = [];
  let again = [];

  const deviation = () => Math.hypot(state.between / Math.sqrt(state.seeds), state.subject / Math.sqrt(state.subjects));
  const noise = () => deviation() * normal(random);
  const at = (k) => (k + 0.5) / state.count;
  function study() {
    const drawn = Array.from({ length: state.count }, noise);
    last = { drawn, best: drawn.indexOf(Math.min(...drawn)), again: noise() };
    lucks.push(-drawn[last.best]);
    again.push(-last.again);
    return lucks.length < 2000;
  }
  function restart() {
    random = generator(state.draw);
    [lucks, again] = [[], []];
    for (let k = 0; k < FIRST; k += 1) {
      study();
    }
  }
  function drawScores(scale) {
    scores.rescale([-scale, scale]);
    scores.segments([[[0, 0], [1, 0]]], { colour: COLOURS.grey, width: 2, dash: "6 4" }); // prettier-ignore
    scores.dots(
      last.drawn.map((value, k) => [at(k), value]),
      { colour: COLOURS.black, size: 7 },
    );
    const x = at(last.best);
    scores.segments([[[x, last.drawn[last.best]], [x, last.again]]], { colour: COLOURS.blue, dash: "3 3" }); // prettier-ignore
    scores.dots([[x, last.again]], { colour: COLOURS.blue, size: 9, square: true });
    scores.dots([[x, last.drawn[last.best]]], { colour: COLOURS.vermillion, size: 11 });
    scores.text([0.04, -0.82 * scale], "round: the best score", { fill: COLOURS.vermillion });
    scores.text([0.04, -0.95 * scale], "square: measured again", { fill: COLOURS.blue });
  }
  function drawLuck(scale, expected, { mean, error }) {
    luck.rescale([0, scale]);
    luck.curve(
      COUNTS.map((n, k) => [n, deviation() * largest[k]]),
      { colour: COLOURS.black, width: 2 },
    );
    luck.segments([[[state.count, mean - 2 * error], [state.count, mean + 2 * error]]], { colour: COLOURS.vermillion, width: 3 }); // prettier-ignore
    luck.dots([[state.count, mean]], { colour: COLOURS.vermillion, size: 9 });
    luck.dots([[state.count, expected]], { colour: COLOURS.black, size: 5 });
  }
  function draw() {
    const expected = deviation() * expectedLargest(state.count);
    const [found, later] = [estimate(lucks), estimate(again)];
    const scale = 3.4 * Math.max(deviation(), 1e-5);
    drawScores(scale);
    drawLuck(0.8 * scale, expected, found);
    const chance = deviation() > 0 ? leadByChance(state.count, state.lead / deviation()) : 0;
    const status =
      `${state.count} equal losses, deviation of a score ${digits(deviation(), 2)} mm. In ${lucks.length} studies the ` +
      `best looked ${digits(found.mean, 2)} ± ${digits(found.error, 1)} mm better than it is; expected ` +
      `${digits(expected, 2)} mm. Measured again: ${digits(later.mean, 2)} ± ${digits(later.error, 1)} mm. A lead of ` +
      `${digits(state.lead)} mm over one given loss occurs by chance in ${digits(100 * chance, 2)} % of studies.`;
    const values = { expected, mean: found.mean, error: found.error, again: later.mean, chance, studies: lucks.length };
    return { status, values };
  }
  figure.run({
    draw,
    play: { step: study, perSecond: 20 },
    changed: (key) => key !== "lead" && restart(),
    controls: [
      { kind: "range", key: "count", label: "losses", min: 2, max: LONGEST, step: 1 },
      { kind: "range", key: "between", label: "deviation between seeds", min: 0, max: 0.02, step: 0.0005, say: mm },
      { kind: "range", key: "seeds", label: "seeds of each", min: 1, max: 10, step: 1 },
      { kind: "range", key: "subject", label: "deviation of a subject", min: 0, max: 0.05, step: 0.001, say: mm },
      {
        kind: "range",
        key: "subjects",
        label: "subjects",
        min: 2,
        max: 64,
        step: 1,
        when: ({ subject }) => subject > 0,
      },
      { kind: "range", key: "lead", label: "lead", min: 0, max: 0.05, step: 0.0005, say: mm },
      { kind: "button", key: "draw", label: "draw anew", press: () => (state.draw += 1) },
    ],
  });
}

function mm(value) {
  return `${digits(value)} mm`;
}
