import { exactLoss } from "../../assets/assignment.js";
import { panel } from "../../assets/panel.js";
import { COLOURS, digits } from "../../assets/plot.js";
import { atAngle, project, slicedLoss } from "../../assets/projection.js";

const REACH = 4;
const ROWS = [2.9, 3.2]; // distances of the two rows of projections from the middle
const LOOKS = [{ colour: COLOURS.blue }, { colour: COLOURS.orange, square: true }];
const DEGREES = Array.from({ length: 180 }, (_, angle) => angle);

// Two different sets of points that agree along chosen directions: built in two ways, and looked at along any other one.
export function main(root, data) {
  const figure = panel(root, {
    construction: "polygon",
    count: data.count,
    angles: data.angles,
    turn: 0,
    probe: data.probe,
  });
  const { state } = figure;
  const plane = figure.plot({
    name: "two sets of points, the chosen directions, and projections along another one",
    x: { range: [-REACH, REACH] },
    y: { range: [-REACH, REACH] },
    width: 320,
    equal: true,
  });
  const curve = figure.plot({
    name: "the cost over the angle of the line, zero at the chosen directions",
    x: { range: [0, 180], label: "angle of the line (degrees)", ticks: [0, 45, 90, 135, 180] },
    y: { range: [0, 1], label: "cost on the line (units²)" },
    width: 320,
    height: 320,
  });

  function chosen() {
    const even = (l) => halfTurn(state.turn + (180 * (l + 0.5)) / state.count);
    return Array.from({ length: state.count }, (_, l) =>
      state.construction === "polygon" ? even(l) : state.angles[l],
    );
  }
  // The corners of a regular polygon, alternately: a reflection at each direction exchanges the two sets.
  function polygon() {
    const corners = Array.from({ length: 2 * state.count }, (_, k) =>
      towards(state.turn + (180 * k) / state.count).map((value) => 2 * value),
    );
    return [0, 1].map((first) => corners.filter((_, k) => k % 2 === first));
  }
  // For one more direction, each set gets the other one, moved at a right angle to it.
  function doubled() {
    let sets = [[[0, 0]], []];
    for (const angle of chosen()) {
      const across = towards(angle + 90);
      const moved = sets.map((points) => points.map((point) => point.map((value, k) => value + across[k])));
      sets = [
        [...sets[0], ...moved[1]],
        [...sets[1], ...moved[0]],
      ];
    }
    const middle = [0, 1].map((k) => sets[0].reduce((sum, point) => sum + point[k], 0) / sets[0].length);
    return sets.map((points) => points.map((point) => point.map((value, k) => value - middle[k])));
  }
  function drawPlane(sets) {
    for (const angle of chosen()) {
      const end = towards(angle).map((value) => 2.5 * value);
      plane.segments([[end.map((value) => -value), end]], { colour: COLOURS.grey, width: 1 });
      plane.dots([end], { colour: COLOURS.grey, size: 11 });
    }
    const [c, s] = towards(state.probe);
    sets.forEach((points, k) => {
      const foot = (value) => [value * c + ROWS[k] * s, value * s - ROWS[k] * c];
      plane.dots(points, { ...LOOKS[k], size: 8 });
      plane.dots(Array.from(project(points, [c, s]), foot), { ...LOOKS[k], size: 6 });
    });
    const tip = [3.2 * c, 3.2 * s];
    plane.segments([[[0, 0], tip]], { colour: COLOURS.vermillion, width: 1.5, dash: "6 4" });
    plane.dots([tip], { colour: COLOURS.vermillion, size: 13 });
  }
  function draw() {
    const sets = state.construction === "polygon" ? polygon() : doubled();
    const costsAt = (angles) => [...slicedLoss(sets[0], sets[1], angles.map(towards)).costs];
    drawPlane(sets);
    const [costs, own, [here]] = [DEGREES, chosen(), [state.probe]].map(costsAt);
    curve.rescale([0, 1.1 * Math.max(...costs)]);
    curve.curve(
      [...costs, costs[0]].map((cost, angle) => [angle, cost]),
      { colour: COLOURS.black, width: 2 },
    );
    curve.dots(
      chosen().map((angle, l) => [angle, own[l]]),
      { colour: COLOURS.grey, size: 11 },
    );
    curve.dots([[state.probe, here]], { colour: COLOURS.vermillion, size: 11 });
    const mean = costs.reduce((sum, cost) => sum + cost, 0) / costs.length;
    const n = sets[0].length;
    const values = { points: n, own: Math.max(...own), cost: here, sliced: Math.sqrt(mean) };
    values.exact = Math.sqrt(exactLoss(sets[0], sets[1]).cost);
    const status =
      `${n} points in each set, equal projections along ${own.filter((cost) => cost < 1e-12).length} directions. ` +
      `Cost at ${Math.round(state.probe)}°: ${here < 1e-12 ? "0" : digits(here)}. Over all directions SW₂ is ` +
      `${digits(values.sliced)}, and W₂ is ${digits(values.exact)}. ` +
      `${n + 1} directions always separate two different sets of ${n} points.`;
    return { status, values };
  }
  function choose(l, angle) {
    if (state.construction === "polygon") {
      state.turn = halfTurn(state.turn + angle - chosen()[l]);
    } else {
      state.angles[l] = halfTurn(angle);
    }
  }
  figure.movable(plane, {
    key: "angles",
    name: "chosen directions",
    step: 0.05,
    say: (l) => `${Math.round(chosen()[l])} degrees`,
    points: () => chosen().map((angle) => towards(angle).map((value) => 2.5 * value)),
    move: (l, to) => choose(l, angleOf(to)),
    keys: turningKeys((l, degrees) => {
      choose(l, chosen()[l] + degrees);
      figure.changed("angles");
    }),
  });
  figure.movable(plane, {
    key: "probe",
    name: "direction of the line",
    step: 0.05,
    say: () => `${Math.round(state.probe)} degrees`,
    points: () => [towards(state.probe).map((value) => 3.2 * value)],
    move: (_, to) => (state.probe = angleOf(to)),
    keys: turningKeys((_, degrees) => {
      state.probe = halfTurn(state.probe + degrees);
      figure.changed("probe");
    }),
  });
  figure.run({
    draw,
    controls: [
      {
        kind: "choice",
        key: "construction",
        label: "Build",
        options: [
          ["polygon", "from a regular polygon"],
          ["doubling", "by doubling, for any directions"],
        ],
      },
      { kind: "range", key: "count", label: "chosen directions", min: 2, max: 7, step: 1 },
      {
        kind: "range",
        key: "probe",
        label: "line",
        min: 0,
        max: 179,
        step: 1,
        say: (angle) => `${Math.round(angle)}°`,
      },
    ],
  });
}

/** @param {number} degrees */
function towards(degrees) {
  return atAngle((degrees * Math.PI) / 180);
}

/** @param {number} degrees */
function halfTurn(degrees) {
  return ((degrees % 180) + 180) % 180;
}

/** @param {number[]} to a point under the pointer */
function angleOf([u, v]) {
  return halfTurn((Math.atan2(v, u) * 180) / Math.PI);
}

/** @param {(l: number, degrees: number) => void} by turns direction l */
function turningKeys(by) {
  const act = Object.entries({ ArrowLeft: 1, ArrowUp: 1, ArrowRight: -1, ArrowDown: -1 });
  return Object.fromEntries(act.map(([key, degrees]) => [key, (/** @type {number} */ l) => by(l, degrees)]));
}
