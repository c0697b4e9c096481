import { panel } from "../../assets/panel.js";
import { COLOURS } from "../../assets/plot.js";
import { ballGrowth, onGrid, solidTopology, voxelGrid } from "../../assets/voxels.js";

const SIZE = 19;
const MIDDLE = 9;
const RADIUS = 6;
const START = Math.PI; // the ring is thickest here
const PRIORITIES = ["depth", "nearness to the start", "the same for all"];

// A ring of voxels in which a ball grows, voxel by voxel: where is the ring cut?
export function main(root, data) {
  const figure = panel(root, { angle: data.angle, narrowing: data.narrowing, priority: PRIORITIES[0], step: 0 });
  const { state } = figure;
  const grid = voxelGrid([SIZE, SIZE, 1]);
  const places = Array.from({ length: SIZE * SIZE }, (_, p) => [Math.floor(p / SIZE), p % SIZE]);
  /** @type {(place: number[]) => number} */
  const at = ([i, k]) => (i + 1) * grid.strides[0] + (k + 1) * grid.strides[1] + 1;
  const plane = figure.plot({
    name: "a ring of voxels, and the ball that has grown in it",
    x: { range: [-0.6, SIZE - 0.4] },
    y: { range: [-0.6, SIZE - 0.4] },
    equal: true,
    width: 420,
  });

  // How deep a voxel lies in a ring whose half width changes along it, in voxels.
  function depthOf([i, k]) {
    const [u, v] = [i - MIDDLE, k - MIDDLE];
    const angle = Math.atan2(v, u);
    const away = turned(angle - (state.angle * Math.PI) / 180);
    const half = 2.2 + 0.5 * Math.cos(angle - START) - state.narrowing * Math.exp(-((away / 0.5) ** 2));
    return Math.round(1e6 * (half - Math.abs(Math.hypot(u, v) - RADIUS))) / 1e6;
  }
  function priorityOf(place, depth) {
    const near = -Math.round(1e6 * Math.hypot(place[0] - MIDDLE + RADIUS, place[1] - MIDDLE)) / 1e6;
    return [depth, near, 0][PRIORITIES.indexOf(state.priority)];
  }
  // The mask, and the ball after so many trials.
  function grownTo(step) {
    const depths = places.map(depthOf);
    const mask = Uint8Array.from(
      onGrid(
        depths.map((depth) => Number(depth > 0)),
        grid,
      ),
    );
    const priority = onGrid(
      places.map((place, p) => priorityOf(place, depths[p])),
      grid,
    );
    const growth = ballGrowth(mask, priority, grid);
    let last = null;
    let done = 0;
    let ended = false;
    while (done < step && !ended) {
      const tried = growth.next();
      ended = tried === null;
      last = tried ?? last;
      done += Number(!ended);
    }
    return { mask, grown: growth.grown, last, done, ended };
  }
  function draw() {
    const { mask, grown, last, ended } = grownTo(state.step);
    const kind = (inside, ball) => places.filter((place) => mask[at(place)] === inside && grown[at(place)] === ball);
    const unit = plane.at([1, 0])[0] - plane.at([0, 0])[0];
    const squares = (shown, colour) => plane.dots(shown, { colour, size: 0.9 * unit, square: true });
    const left = kind(1, 0);
    squares(left, ended ? COLOURS.vermillion : COLOURS.grey);
    squares(kind(1, 1), COLOURS.blue);
    const tried = last && places.find((place) => at(place) === last.place);
    if (tried && !ended) {
      plane.dots([tried], { colour: last.added ? COLOURS.sky : COLOURS.vermillion, size: 0.5 * unit, square: true });
    }
    const mark = around(state.angle, RADIUS + 3.2);
    plane.dots([mark], { colour: COLOURS.orange, size: 13 });
    plane.text([MIDDLE, MIDDLE - 0.3], "hole", { "text-anchor": "middle" });
    const size = left.length + kind(1, 1).length;
    const before = solidTopology(mask, grid, true);
    const now = solidTopology(grown, grid, true);
    const cut = ended && left.length ? cutAt(left) : null;
    const values = {
      size,
      ball: size - left.length,
      handles: before.handles,
      now: now.handles,
      cut: cut ?? "",
      ended: Number(ended),
    };
    const head = `The mask has ${size} voxels and ${before.handles} handle${before.handles === 1 ? "" : "s"}. `;
    if (ended) {
      const where = cut === null ? "" : ` They lie at ${Math.round(cut)}° on average.`;
      return { status: `${head}The ball ends with ${values.ball} voxels and gives up ${left.length}.${where}`, values };
    }
    const word = last && (last.added ? "was added" : "was refused: it would change the topology");
    const end = last ? `The last voxel ${word}.` : "Press play or one step: a ball grows from the voxel of highest priority."; // prettier-ignore
    return { status: `${head}The ball has ${values.ball} voxels and ${now.handles} handles. ${end}`, values };
  }
  const turn = (degrees) => (state.angle = (Math.round(degrees) + 360) % 360);
  function by(degrees) {
    turn(state.angle + degrees);
    figure.changed("angle");
  }
  figure.movable(plane, {
    key: "angle",
    name: "the narrow place",
    step: 5,
    say: () => `at ${state.angle} degrees`,
    points: () => [around(state.angle, RADIUS + 3.2)],
    move: (_, [i, k]) => turn((Math.atan2(k - MIDDLE, i - MIDDLE) * 180) / Math.PI),
    keys: { ArrowLeft: () => by(5), ArrowUp: () => by(5), ArrowRight: () => by(-5), ArrowDown: () => by(-5) },
  });
  figure.run({
    draw,
    changed(key) {
      if (key) {
        state.step = 0;
      }
    },
    play: {
      perSecond: 15,
      step() {
        state.step += 1;
        return !grownTo(state.step).ended;
      },
    },
    controls: [
      {
        kind: "range",
        key: "narrowing",
        label: "narrowing",
        min: 0,
        max: 1.6,
        step: 0.1,
        say: (value) => `${value.toFixed(1)} voxels`,
      },
      { kind: "choice", key: "priority", label: "Priority", options: PRIORITIES },
      { kind: "button", label: "to the end", press: () => (state.step = 10 * SIZE * SIZE) },
      { kind: "button", label: "begin again", press: () => (state.step = 0) },
    ],
  });
}

function around(degrees, radius) {
  const angle = (degrees * Math.PI) / 180;
  return [MIDDLE + radius * Math.cos(angle), MIDDLE + radius * Math.sin(angle)];
}

// An angle between −π and π.
function turned(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

// The mean direction of the voxels given up, in degrees from 0 to 360.
function cutAt(left) {
  const sums = [0, 1].map((axis) =>
    left.reduce((sum, place) => sum + (place[axis] - MIDDLE) / Math.hypot(place[0] - MIDDLE, place[1] - MIDDLE), 0),
  );
  return ((Math.atan2(sums[1], sums[0]) * 180) / Math.PI + 360) % 360;
}
