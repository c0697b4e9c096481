import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { addShape } from "../../assets/svg.js";

const REFERENCE = "#f0e442";
const TOPS = [0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 1];
const LOOKS = [
  { name: "inside", colour: "#ff7a33", width: 3.4, is: (error, limit) => error < -limit },
  { name: "outside", colour: "#e28ac4", width: 3.4, is: (error, limit) => error > limit },
  { name: "near", colour: "#56b4e9", width: 1.3, is: (error, limit) => Math.abs(error) <= limit },
];

// Slices of a person from back to front: the lines of two surfaces, and where one lies far from the other.
export function main(root, data) {
  const figure = panel(root, { slice: data.first, show: "both", limit: 1 });
  const { state } = figure;
  const slices = data.slices.map((each) => ({ ...each, ...unpacked(each, data) }));
  const [left, right, bottom, top] = slices[0].extent;
  const brain = figure.plot({
    name: "a slice with the lines of two surfaces",
    x: { range: [left, right] },
    y: { range: [bottom, top] },
    width: 520,
    equal: true,
  });
  const profile = figure.plot({
    name: "the share of our line beyond the limit, over the slices",
    x: {
      range: [slices[0].position - 4, slices.at(-1).position + 4],
      label: "y of the slice (mm), from back to front",
    },
    y: { range: [0, 1], label: "share beyond the limit" },
    width: 340,
    height: 240,
  });
  const picture = addShape(brain.svg, "image", { preserveAspectRatio: "none" });
  brain.svg.prepend(picture);

  function drawSlice(chosen) {
    const [west, east, south, north] = chosen.extent;
    const [x, y] = brain.at([west, north]);
    const [end, base] = brain.at([east, south]);
    const place = { x, y, width: end - x, height: base - y, href: `data:image/webp;base64,${chosen.picture}` };
    Object.entries(place).forEach(([key, value]) => picture.setAttribute(key, String(value)));
    if (state.show !== "ours") {
      chosen.reference.forEach((line) => brain.curve(line, { colour: REFERENCE, width: 1.6 }));
    }
    if (state.show !== "FreeSurfer's") {
      for (const look of LOOKS) {
        const own = chosen.pieces.filter(({ error }) => look.is(error, state.limit));
        brain.segments(
          own.map(({ ends }) => ends),
          look,
        );
      }
    }
  }
  function draw() {
    const chosen = slices[state.slice];
    drawSlice(chosen);
    const rows = slices.map((each) => measured(each, state.limit));
    const largest = Math.max(...rows.map(({ beyond }) => beyond));
    profile.rescale([0, TOPS.find((end) => end >= largest)]);
    const places = rows.map(({ beyond }, k) => [slices[k].position, beyond]);
    profile.curve(places, { colour: COLOURS.grey });
    profile.dots(places, { colour: COLOURS.blue, size: 7 });
    profile.dots([places[state.slice]], { colour: COLOURS.vermillion, size: 12 });
    const { length, mean, beyond } = rows[state.slice];
    const side = mean < 0 ? "inside" : "outside";
    return {
      status:
        `Slice y = ${digits(chosen.position)} mm: ${Math.round(length)} mm of our line. On average it lies ` +
        `${digits(Math.abs(mean), 2)} mm ${side} FreeSurfer's surface. ${digits(100 * beyond, 2)} % of it lies farther ` +
        `than ${state.limit} mm: thick, orange if inside, pink if outside. FreeSurfer's line is yellow.`,
      values: { length, mean, beyond },
    };
  }
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "slice",
        label: "slice",
        min: 0,
        max: slices.length - 1,
        step: 1,
        say: (k) => `y = ${digits(slices[k].position)} mm`,
      },
      { kind: "choice", key: "show", label: "Lines", options: ["both", "ours", "FreeSurfer's"] },
      { kind: "range", key: "limit", label: "limit", min: 0.5, max: 3, step: 0.5, say: (mm) => `${mm} mm` },
    ],
  });
}

// Each piece of a line counts by its length, with the mean error of its ends.
function measured({ pieces }, limit) {
  let [length, sum, far] = [0, 0, 0];
  for (const piece of pieces) {
    length += piece.length;
    sum += piece.length * piece.error;
    far += Math.abs(piece.error) > limit ? piece.length : 0;
  }
  return { length, mean: sum / length, beyond: far / length };
}

function unpacked({ found, reference, errors }, { step, errorStep }) {
  const bytes = Uint8Array.from(atob(errors), (sign) => sign.charCodeAt(0));
  const values = new Int8Array(bytes.buffer);
  const pieces = [];
  let start = 0;
  for (const line of linesOf(found, step)) {
    for (let k = 0; k + 1 < line.length; k += 1) {
      const [one, two] = [line[k], line[k + 1]];
      const error = (values[start + k] * errorStep + values[start + k + 1] * errorStep) / 2;
      pieces.push({ ends: [one, two], length: Math.hypot(two[0] - one[0], two[1] - one[1]), error });
    }
    start += line.length;
  }
  return { pieces, reference: linesOf(reference, step) };
}

// For each line its number of points and its first point, then steps of one byte each, or of two after −128.
function linesOf(text, step) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const lines = [];
  let place = 0;
  const short = () => {
    place += 2;
    return view.getInt16(place - 2, true);
  };
  const byte = () => {
    place += 1;
    return view.getInt8(place - 1);
  };
  while (place < bytes.length) {
    const count = short();
    let point = [short(), short()];
    const line = [point];
    while (line.length < count) {
      const first = byte();
      const move = first === -128 ? [short(), short()] : [first, byte()];
      point = point.map((value, k) => value + move[k]);
      line.push(point);
    }
    lines.push(line.map((at) => at.map((value) => value * step)));
  }
  return lines;
}
