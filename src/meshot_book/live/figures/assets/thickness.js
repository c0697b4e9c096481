import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

const N = 240; // pieces of each curve
const FILLED = 0.3; // by this part the outer curve is less deep than the inner one

// Two folded curves: the distance of pairs, both nearest distances, and their mean, as the outer points slide.
export function main(root, data) {
  const start = { depth: data.depth, wave: data.wave, gap: data.gap, slide: data.slide, place: data.place };
  const figure = panel(root, start);
  const { state } = figure;
  const scene = figure.plot({
    name: "a white and a pial curve, with the distances at one vertex",
    x: { range: [0, data.length], label: "position (mm)" },
    y: { range: [-10, 16] },
    width: 640,
    height: 330,
    equal: true,
  });
  const along = figure.plot({
    name: "thickness along the white curve by two definitions",
    x: { range: [0, data.length], label: "position (mm)" },
    y: { range: [0, 8], label: "thickness (mm)" },
    width: 640,
    height: 220,
  });

  const white = (x) => [x, state.depth * Math.cos((2 * Math.PI * x) / state.wave)];
  const pial = (x) => [x, (1 - FILLED) * state.depth * Math.cos((2 * Math.PI * x) / state.wave) + state.gap];
  const places = Array.from({ length: N + 1 }, (_, k) => (k * data.length) / N);
  // Both curves go on beyond the frame, so that no nearest point is missing.
  const wider = Array.from({ length: 4 * N + 1 }, (_, k) => (k * data.length) / (2 * N) - data.length / 2);

  function draw() {
    const [inner, outer] = [wider.map(white), wider.map(pial)];
    const at = (x) => {
      const [w, p] = [white(x), pial(x + state.slide)];
      const [there, back] = [nearest(outer, w), nearest(inner, p)];
      return { w, p, there, back, pair: distance(w, p), both: (there.distance + back.distance) / 2 };
    };
    const found = places.map(at);
    const here = at(state.place);
    scene.curve(places.map(white), { colour: COLOURS.black, width: 2.5 });
    scene.curve(places.map(pial), { colour: COLOURS.vermillion, width: 2.5 });
    scene.segments([[here.w, here.p]], { colour: COLOURS.grey, width: 2, dash: "5 4" }); // prettier-ignore
    scene.segments([[here.w, here.there.point]], { colour: COLOURS.blue, width: 3 }); // prettier-ignore
    scene.segments([[here.p, here.back.point]], { colour: COLOURS.orange, width: 3 }); // prettier-ignore
    scene.dots([here.w, here.p], { colour: COLOURS.black, size: 9 });
    scene.text([0.5, 14.4], "black: white curve, orange-red: pial curve");
    along.curve(places.map((x, k) => [x, found[k].pair]), { colour: COLOURS.grey, width: 2, dash: "5 4" }); // prettier-ignore
    along.curve(places.map((x, k) => [x, found[k].both]), { colour: COLOURS.blue, width: 2.5 }); // prettier-ignore
    along.text([0.5, 7.3], "grey: distance of pairs", { fill: COLOURS.grey });
    along.text([0.5, 6.4], "blue: mean of both nearest distances", { fill: COLOURS.blue });
    along.segments([[[state.place, 0], [state.place, 8]]], { colour: COLOURS.black, dash: "2 3" }); // prettier-ignore
    const mean = (key) => found.reduce((sum, each) => sum + each[key], 0) / found.length;
    const [meanPair, meanBoth] = [mean("pair"), mean("both")];
    const status =
      `At ${digits(state.place)} mm: pair ${digits(here.pair)} mm, nearest there ${digits(here.there.distance)} mm and ` +
      `back ${digits(here.back.distance)} mm, their mean ${digits(here.both)} mm. Means along the curve: pairs ` +
      `${digits(meanPair)} mm, nearest ${digits(meanBoth)} mm.`;
    const values = { pair: here.pair, there: here.there.distance, back: here.back.distance, both: here.both };
    return { status, values: { ...values, meanPair, meanBoth } };
  }
  figure.run({
    draw,
    controls: [
      { kind: "range", key: "slide", label: "slide of the pial points", min: -4, max: 4, step: 0.25, say: mm },
      { kind: "range", key: "depth", label: "depth of the folds", min: 0, max: 8, step: 0.5, say: mm },
      { kind: "range", key: "wave", label: "length of a fold", min: 10, max: 30, step: 1, say: mm },
      { kind: "range", key: "gap", label: "gap between the curves", min: 1, max: 5, step: 0.25, say: mm },
      { kind: "range", key: "place", label: "look at", min: 0, max: data.length, step: 0.5, say: mm },
    ],
  });
}

function mm(value) {
  return `${digits(value)} mm`;
}

/** @typedef {import("../../assets/plot.js").Point} Point */

/** @type {(first: Point, second: Point) => number} */
function distance(first, second) {
  return Math.hypot(first[0] - second[0], first[1] - second[1]);
}

/**
 * The point of a chain of segments that is nearest to another point.
 * @type {(chain: Point[], from: Point) => {distance: number, point: Point}}
 */
function nearest(chain, from) {
  let best = { distance: Infinity, point: chain[0] };
  for (let k = 1; k < chain.length; k += 1) {
    const [start, end] = [chain[k - 1], chain[k]];
    const [u, v] = [end[0] - start[0], end[1] - start[1]];
    const part = Math.min(1, Math.max(0, ((from[0] - start[0]) * u + (from[1] - start[1]) * v) / (u * u + v * v)));
    const point = [start[0] + part * u, start[1] + part * v];
    const away = distance(point, from);
    if (away < best.distance) {
      best = { distance: away, point };
    }
  }
  return best;
}
