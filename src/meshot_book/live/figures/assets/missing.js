import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";

// Area is missing in one region of a surface: how far does transport along an axis move the mass of all others?
export function main(root, data) {
  const { areas, low, slab, needed, reach } = data;
  const figure = panel(root, { missing: data.missing, width: data.width, middle: data.middle, place: data.place });
  const { state } = figure;
  const edges = Array.from({ length: areas.length + 1 }, (_, k) => low + slab * k);
  const x = { range: [edges[0], edges.at(-1)], label: "position from back to front (mm)" };
  const largest = 1.12 * Math.max(...areas);
  const density = figure.plot({
    name: "area of the surface along the axis, and what is missing of it",
    x,
    y: { range: [0, largest / slab], label: "area (mm² per mm)" },
    width: 640,
    height: 190,
  });
  const moved = figure.plot({
    name: "displacement of the mass along the axis, over the whole surface and in windows",
    x,
    y: { range: [-1.6, 2.2], label: "displacement (mm)" },
    width: 640,
    height: 250,
  });

  const region = () => [state.middle - state.width / 2, state.middle + state.width / 2];
  // The part of every slab that lies within the region, and the area that is left.
  function leftOver() {
    const [from, to] = region();
    return areas.map((area, k) => {
      const inside = Math.max(0, Math.min(to, edges[k + 1]) - Math.max(from, edges[k])) / slab;
      return area * (1 - (state.missing / 100) * inside);
    });
  }
  function draw() {
    const left = leftOver();
    const [source, target] = [left, areas].map(cumulated);
    const away = edges.map((edge, k) => quantile(target, source[k], edges) - edge);
    const local = edges.map((edge) => meanWithin(areas, edge) - meanWithin(left, edge));
    const mean = middleOf(areas) - middleOf(left); // of the displacement, over the mass
    density.area(steps(left), { colour: COLOURS.sky });
    const [from, to] = region().map((end) => Math.min(Math.max(end, edges[0]), edges.at(-1)));
    density.area([[from, 0], [from, largest / slab], [to, largest / slab], [to, 0]], { colour: COLOURS.vermillion, opacity: 0.3 }); // prettier-ignore
    density.text([edges[0] + 3, 0.86 * (largest / slab)], "shaded: the region that lacks area");
    for (const side of [-needed, needed]) {
      moved.segments([[[edges[0], side], [edges.at(-1), side]]], { colour: COLOURS.grey, dash: "3 4" }); // prettier-ignore
    }
    const curve = (values) => edges.map((edge, k) => [edge, values[k]]);
    moved.curve(curve(local), { colour: COLOURS.orange, width: 2.5, dash: "8 4" });
    moved.curve(curve(away), { colour: COLOURS.blue, width: 2.5 });
    moved.text([edges[0] + 3, 1.85], "transport over the whole surface", { fill: COLOURS.blue });
    moved.text([edges[0] + 3, 1.45], `in windows of ${reach} mm`, { fill: COLOURS.orange });
    moved.text([edges.at(-1) - 3, -1.4], "dotted: the needed displacement (rms)", { "text-anchor": "end" });
    const at = (values) => interpolated(edges, values, state.place);
    const [here, within] = [at(away), at(local)];
    for (const plot of [density, moved]) {
      const ends = plot === moved ? [-1.6, 2.2] : [0, largest / slab];
      plot.segments([ends.map((end) => [state.place, end])], { colour: COLOURS.black, dash: "2 3" });
    }
    moved.dots([[state.place, here]], { colour: COLOURS.blue, size: 11 });
    moved.dots([[state.place, within]], { colour: COLOURS.orange, size: 11, square: true });
    const share = 1 - total(left) / total(areas);
    const most = away.reduce((best, value, k) => (Math.abs(value) > Math.abs(away[best]) ? k : best), 0);
    const status =
      `${digits(100 * share, 2)} % of the area is missing. Transport moves the mass at ${state.place} mm by ` +
      `${digits(here, 2)} mm, in windows by ${Math.abs(within) < 0.005 ? "less than 0.01" : digits(within, 2)} mm. The largest displacement is ` +
      `${digits(away[most], 2)} mm, at ${edges[most]} mm; the mean over the mass is ${digits(mean, 2)} mm.`;
    return { status, values: { share, here, within, largest: away[most], where: edges[most], mean } };
  }
  function meanWithin(masses, place) {
    let [sum, first] = [0, 0];
    masses.forEach((mass, k) => {
      const gap = (edges[k] + edges[k + 1]) / 2 - place;
      const weight = mass * Math.exp(-0.5 * (gap / reach) ** 2);
      sum += weight;
      first += weight * gap;
    });
    return first / sum;
  }
  function middleOf(masses) {
    return masses.reduce((sum, mass, k) => sum + mass * (edges[k] + slab / 2), 0) / total(masses);
  }
  function steps(masses) {
    const tops = masses.flatMap((mass, k) => [
      [edges[k], mass / slab],
      [edges[k + 1], mass / slab],
    ]);
    return [[edges[0], 0], ...tops, [edges.at(-1), 0]];
  }
  figure.run({
    draw,
    controls: [
      {
        kind: "range",
        key: "missing",
        label: "missing in the region",
        min: 0,
        max: 10,
        step: 0.5,
        say: (q) => `${q} %`,
      },
      { kind: "range", key: "width", label: "width of the region", min: 4, max: 60, step: 2, say: mm },
      { kind: "range", key: "middle", label: "middle of the region", min: -80, max: 50, step: 2, say: mm },
      { kind: "range", key: "place", label: "look at", min: -90, max: 60, step: 2, say: mm },
    ],
  });
}

function mm(value) {
  return `${value} mm`;
}

function total(masses) {
  return masses.reduce((sum, mass) => sum + mass, 0);
}

// The shares of the mass up to every edge.
function cumulated(masses) {
  const [shares, all] = [[0], total(masses)];
  masses.forEach((mass) => shares.push(shares.at(-1) + mass / all));
  return shares;
}

// Where a share of the mass lies: within a slab the mass is spread evenly.
function quantile(shares, share, edges) {
  const bounded = Math.min(Math.max(share, 0), shares.at(-1));
  return interpolated(shares, edges, bounded);
}

function interpolated(places, values, place) {
  let k = 1;
  while (k < places.length - 1 && places[k] < place) {
    k += 1;
  }
  const part = (place - places[k - 1]) / (places[k] - places[k - 1]);
  return values[k - 1] + part * (values[k] - values[k - 1]);
}
