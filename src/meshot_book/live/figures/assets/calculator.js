import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

// Time and memory of a loss, between the sizes at which they were measured.
export function main(root, data) {
  const figure = panel(root, { peer: data.peers[0], d: 3, size: 4, steps: 3 });
  const { state } = figure;
  const times = figure.plot({ name: "seconds over supports", ...axes(1e-3, 100, "value and gradient (s)") });
  const spaces = figure.plot({ name: "megabytes over supports", ...axes(0.1, 1e4, "peak memory (MB)") });

  const rowsOf = (peer, key) => data.rows.filter((row) => row.peer === peer && row.d === state.d && row[key] > 0);
  function drawPlot(plot, low, key, count, found) {
    for (const peer of data.peers) {
      const chosen = peer === state.peer;
      const points = rowsOf(peer, key).map((row) => [row.m, row[key]]);
      plot.curve(points, { colour: chosen ? COLOURS.blue : COLOURS.grey, width: chosen ? 2.5 : 1 });
      plot.dots(points, { colour: chosen ? COLOURS.blue : COLOURS.grey, size: chosen ? 8 : 4 });
    }
    if (found) {
      plot.segments([[[count, low], [count, found.value]]], { colour: COLOURS.vermillion, dash: "4 3" }); // prettier-ignore
      plot.dots([[count, found.value]], { colour: COLOURS.vermillion, size: 11 });
    }
  }
  function draw() {
    const count = Math.round(10 ** state.size);
    const seconds = between(rowsOf(state.peer, "seconds"), "seconds", count);
    const megabytes = between(rowsOf(state.peer, "megabytes"), "megabytes", count);
    drawPlot(times, 1e-3, "seconds", count, seconds);
    drawPlot(spaces, 0.1, "megabytes", count, megabytes);
    const calls = Math.round(10 ** state.steps);
    const head = `${state.peer}, ${count.toLocaleString("en")} supports in ${state.d} dimensions: `;
    const stopped = data.stopped.find((row) => row.peer === state.peer && row.d === state.d);
    const time = seconds
      ? `${digits(seconds.value, 2)} s (measured from ${digits(seconds.low, 2)} to ${digits(seconds.high, 2)} s nearby), ` +
        `${calls.toLocaleString("en")} steps ${span(seconds.value * calls)}`
      : `not measured here${stopped ? ` (stopped at ${stopped.m.toLocaleString("en")}: ${stopped.why})` : ""}`;
    const space = megabytes ? `, ${digits(megabytes.value, 2)} MB.` : "; memory not measured here.";
    const values = { count, seconds: seconds?.value ?? -1, megabytes: megabytes?.value ?? -1 };
    return { status: head + time + space, values };
  }
  figure.run({
    draw,
    controls: [
      { kind: "choice", key: "peer", label: "Loss", options: data.peers },
      { kind: "choice", key: "d", label: "Dimension", options: [3, 6].map((d) => [d, `${d}`]) },
      { kind: "range", key: "size", label: "supports", min: 3, max: 6, step: 0.05, say: power },
      { kind: "range", key: "steps", label: "steps of a training", min: 0, max: 6, step: 0.25, say: power },
    ],
  });
}

function axes(low, high, label) {
  return {
    x: { range: [800, 1.3e6], log: true, label: "supports on each side" },
    y: { range: [low, high], log: true, label },
    height: 300,
  };
}

function power(value) {
  return Math.round(10 ** value).toLocaleString("en");
}

// On a straight line between the two measurements around a size, in logarithms; null outside of what was measured.
function between(rows, key, count) {
  const after = rows.findIndex(({ m }) => m >= count);
  if (after < 0 || (after === 0 && rows[0].m > count)) {
    return null;
  }
  const [one, two] = [rows[Math.max(0, after - 1)], rows[after]];
  const share = two.m === one.m ? 0 : Math.log(count / one.m) / Math.log(two.m / one.m);
  const near = [one, two];
  return {
    value: one[key] * (two[key] / one[key]) ** share,
    low: Math.min(...near.map((row) => row.low ?? row[key])),
    high: Math.max(...near.map((row) => row.high ?? row[key])),
  };
}

function span(seconds) {
  /** @type {[string, number][]} */
  const units = [
    ["days", 86400],
    ["hours", 3600],
    ["minutes", 60],
    ["seconds", 1],
  ];
  const [unit, size] = units.find(([, length]) => seconds >= length) ?? ["seconds", 1];
  return `${digits(seconds / size, 2)} ${unit}`;
}
