// One plot of a live figure: an SVG whose scales take data units, marks that are drawn anew, points that are dragged.
import { turnable } from "../../../meshot/view/assets/turning.js";
import { addShape, addText, mark } from "./svg.js";

// Scales are twelve lines here, and dragging is the turning hand of the surfaces, which knows two fingers and keys too.
// d3-scale and d3-drag with what they need have 47 kB when bundled and minified; this file and that hand have 13 kB.

/**
 * @typedef {object} Axis
 * @property {number[]} range its two ends, in data units
 * @property {string} [label] with its unit; an axis without label and ticks is not drawn
 * @property {boolean} [log]
 * @property {number[]} [ticks] chosen evenly if left out
 */

/** Okabe and Ito, 2008: the style sheet has their values, and lighter ones for a dark ground. */
export const COLOURS = {
  black: "var(--black)",
  blue: "var(--blue)",
  green: "var(--green)",
  grey: "var(--grey)",
  orange: "var(--orange)",
  purple: "var(--purple)",
  sky: "var(--sky)",
  vermillion: "var(--vermillion)",
};

/**
 * @typedef {object} Look of a line or a shape
 * @property {string} colour
 * @property {number} [width]
 * @property {string} [dash]
 * @property {number} [opacity]
 */
/** @typedef {number[]} Point two numbers in data units */
/** @typedef {{left: number, right: number, top: number, bottom: number}} Box in pixels of the plot */

/**
 * @param {Element} holder
 * @param {{x: Axis, y: Axis, name: string, title?: string, width?: number, height?: number, equal?: boolean}} options
 *   equal: a unit has the same length along both axes, and the height follows; name: what the picture shows, in words
 */
export function addPlot(holder, { x, y, name, title, width: wanted = 340, height = 280, equal = false }) {
  // A wide plot is narrower on a telephone, so that its words keep their size.
  const width = Math.min(wanted, Math.max(300, holder.parentElement.clientWidth - 16));
  const [left, right, top] = [y.label ? 50 : 10, width - 12, title || y.label ? 28 : 8];
  const below = x.label ? 48 : x.ticks ? 26 : 8;
  const unit = (right - left) / (x.range[1] - x.range[0]);
  const tall = equal ? top + below + unit * (y.range[1] - y.range[0]) : height;
  const box = { left, right, top, bottom: tall - below };
  const svg = addShape(holder, "svg", {
    viewBox: `0 0 ${width} ${tall.toFixed(1)}`,
    role: "group",
    "aria-label": name,
  });
  svg.style.flexBasis = `${width}px`;
  svg.style.maxWidth = `${1.25 * width}px`;
  const scales = { x: scale(x, box.left, box.right), y: scale(y, box.bottom, box.top) };
  const frame = addShape(svg, "g", {});
  const layer = addShape(svg, "g", {});
  drawAxes(frame, box, scales, { x, y, title });
  /** @param {Point} point */
  const at = ([a, b]) => [scales.x.to(a), scales.y.to(b)];
  /** @type {(points: Point[], closed: boolean) => string} */
  const path = (points, closed) => "M" + points.map((p) => at(p).map(short).join(" ")).join("L") + (closed ? "Z" : "");
  /** @type {(kind: string, look: Record<string, string | number>) => Element} */
  const add = (kind, look) => addShape(layer, kind, look);
  return {
    svg,
    box,
    at,
    /**
     * The data units under a pointer.
     * @param {PointerEvent} event
     */
    under(event) {
      const { left: start, top: above, width: wide } = svg.getBoundingClientRect();
      const [u, v] = [event.clientX - start, event.clientY - above].map((d) => (d * width) / wide);
      return [scales.x.from(u), scales.y.from(v)];
    },
    clear: () => layer.replaceChildren(),
    /**
     * Another range of the vertical axis.
     * @param {number[]} range
     */
    rescale(range) {
      scales.y = scale({ ...y, range }, box.bottom, box.top);
      frame.replaceChildren();
      drawAxes(frame, box, scales, { x, y: { ...y, range }, title });
    },
    /**
     * Dots of one size and colour, as a single shape: fast for many.
     * @param {Point[]} points
     * @param {{colour: string, size?: number, square?: boolean, opacity?: number}} look
     */
    dots(points, { colour, size = 8, square = false, opacity = 1 }) {
      const d = points.map((p) => `M${at(p).map(short).join(" ")}h0`).join("");
      add("path", { d, stroke: colour, "stroke-width": size, "stroke-linecap": square ? "square" : "round", opacity });
    },
    /**
     * Discs of different areas.
     * @param {Point[]} points
     * @param {ArrayLike<number>} radii in pixels of the plot
     * @param {Look} look
     */
    discs(points, radii, { colour, opacity = 1 }) {
      points.forEach((p, i) => {
        const [cx, cy] = at(p);
        add("circle", { cx, cy, r: radii[i], fill: colour, opacity, stroke: "var(--ground)" });
      });
    },
    /** @type {(points: Point[], look: Look) => unknown} */
    curve: (points, look) => points.length && add("path", { d: path(points, false), fill: "none", ...line(look) }),
    /** @type {(points: Point[], look: Look) => unknown} */
    area: (points, { colour, opacity = 0.25 }) => add("path", { d: path(points, true), fill: colour, opacity }),
    /** @type {(points: Point[], look: Look) => unknown} */
    outline: (points, look) => add("path", { d: path(points, true), fill: "none", ...line(look) }),
    /**
     * Separate straight lines, as a single shape.
     * @param {Point[][]} pairs
     * @param {Look} look
     */
    segments(pairs, look) {
      if (pairs.length) {
        add("path", { d: pairs.map((pair) => path(pair, false)).join(""), fill: "none", ...line(look) });
      }
    },
    /**
     * Arrows from points, in data units.
     * @param {Point[]} points
     * @param {number[][]} vectors
     * @param {Look} look
     */
    arrows(points, vectors, look) {
      let d = "";
      points.forEach((point, i) => {
        const [u, v] = at(point);
        const [s, t] = at(point.map((value, k) => value + vectors[i][k]));
        const length = Math.hypot(s - u, t - v);
        if (length > 1) {
          const head = Math.min(6, length / 2);
          const [c, e] = [((s - u) / length) * head, ((t - v) / length) * head];
          const wings = [1, -1].map((sign) => `${short(s - c - (sign * e) / 2)} ${short(t - e + (sign * c) / 2)}`);
          d += `M${short(u)} ${short(v)}L${short(s)} ${short(t)}M${wings[0]}L${short(s)} ${short(t)}L${wings[1]}`;
        }
      });
      add("path", { d, fill: "none", ...line(look) });
    },
    /** @type {(point: Point, words: string, look?: Record<string, string | number>) => void} */
    text(point, words, look = {}) {
      const [u, v] = at(point);
      addText(layer, words, { x: u, y: v, class: "on-white", ...look });
    },
  };
}

/**
 * @typedef {object} Movable points that a reader can move
 * @property {string} name what they are, in the plural
 * @property {() => Point[]} points where they are
 * @property {(i: number, to: number[]) => unknown} move
 * @property {number} step of an arrow key; ten times it with Shift
 * @property {(i: number) => void} [choose]
 * @property {Record<string, (i: number, event: KeyboardEvent) => void>} [keys] more keys
 * @property {(i: number) => string} [say] the place in words
 * @property {number} [reach] radius within which a finger takes a point, in pixels of the plot
 */

/**
 * Points that can be moved: by mouse or finger, each where it is seen, and by keys, one of them after another.
 * @param {ReturnType<typeof addPlot>} plot
 * @param {Movable} options
 */
export function addMovable(plot, { name, points, move, step, choose, keys = {}, say, reach = 15 }) {
  const node = addShape(plot.svg, "g", {
    class: "movable",
    role: "slider",
    tabindex: 0,
    "aria-label": name,
    "aria-roledescription": "points to move",
    "aria-valuemin": 1,
  });
  let chosen = 0;
  const ring = addShape(node, "circle", { class: "ring", r: reach - 3 });
  const grips = addShape(node, "g", {});

  function update() {
    const places = points();
    chosen = Math.min(chosen, places.length - 1);
    while (grips.childElementCount > places.length) {
      grips.lastChild.remove();
    }
    places.forEach((place, i) => {
      const [cx, cy] = plot.at(place);
      const grip = grips.children[i] ?? addShape(grips, "circle", { r: reach, class: "grip" });
      mark(grip, { cx, cy });
    });
    const [cx, cy] = plot.at(places[chosen]);
    mark(ring, { cx, cy });
    const words = say ? say(chosen) : "at " + places[chosen].map((value) => value.toFixed(2)).join(", ");
    mark(node, {
      "aria-valuemax": places.length,
      "aria-valuenow": chosen + 1,
      "aria-valuetext": `${chosen + 1} of ${places.length}, ${words}`,
    });
  }
  /** @param {number} i */
  function take(i) {
    const n = points().length;
    chosen = (i + n) % n;
    choose?.(chosen);
    update();
  }
  /** @type {(u: number, v: number) => (event: KeyboardEvent) => void} */
  const by = (u, v) => (event) => {
    const size = event.shiftKey ? 10 * step : step;
    const [a, b] = points()[chosen];
    move(chosen, [a + u * size, b + v * size]);
  };
  const own = Object.entries(keys).map(([key, act]) => [key, (event) => act(chosen, event)]);
  turnable(node, {
    press: (event) => {
      event.preventDefault();
      node.focus({ preventScroll: true });
      const [u, v] = plot.at(plot.under(event));
      const gaps = points().map((place) => Math.hypot(plot.at(place)[0] - u, plot.at(place)[1] - v));
      take(gaps.indexOf(Math.min(...gaps)));
    },
    drag: (event) => move(chosen, plot.under(event)),
    keys: {
      ArrowLeft: by(-1, 0),
      ArrowRight: by(1, 0),
      ArrowUp: by(0, 1),
      ArrowDown: by(0, -1),
      PageDown: () => take(chosen + 1),
      PageUp: () => take(chosen - 1),
      ...Object.fromEntries(own),
    },
  });
  return { node, update };
}

/**
 * A number with so many digits that count.
 * @param {number} value
 */
export function digits(value, count = 3) {
  return Number(value.toPrecision(count)).toString().replace("-", "−");
}

/** @type {(value: number, axis: Axis) => string} */
function written(value, { log }) {
  const power = Math.round(Math.log10(value));
  const raised = Array.from(String(power), (sign) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign] ?? "⁻").join("");
  return log && (power < -2 || power > 3) ? "10" + raised : digits(value);
}

function short(value) {
  return value.toFixed(1);
}

/** @param {Look} look */
function line({ colour, width = 1.5, dash, opacity = 1 }) {
  return { stroke: colour, "stroke-width": width, opacity, ...(dash ? { "stroke-dasharray": dash } : {}) };
}

/**
 * @param {Axis} axis
 * @param {number} start in pixels of the plot
 * @param {number} end
 */
function scale({ range, log }, start, end) {
  const inner = log ? Math.log : Number;
  const [low, high] = range.map(inner);
  const share = (end - start) / (high - low);
  return {
    to: (value) => start + (inner(log ? Math.max(value, range[0] / 1e6) : value) - low) * share,
    from: (pixel) => (log ? Math.exp : Number)(low + (pixel - start) / share),
  };
}

/** @param {Axis} axis */
function ticksOf({ range: [low, high], ticks, log }) {
  if (ticks) {
    return ticks;
  }
  if (log) {
    const powers = Array.from({ length: 40 }, (_, k) => 10 ** (k - 20));
    return powers.filter((value) => value >= low * 0.999 && value <= high * 1.001);
  }
  const raw = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((k) => k * power >= raw * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, k) => (first + k) * step);
}

/**
 * @param {Element} frame
 * @param {Box} box
 * @param {{x: ReturnType<typeof scale>, y: ReturnType<typeof scale>}} scales
 * @param {{x: Axis, y: Axis, title?: string}} axes
 */
function drawAxes(frame, { left, right, top, bottom }, scales, { x, y, title }) {
  const stroke = { stroke: COLOURS.black, "stroke-width": 1 };
  if (x.label || x.ticks) {
    addShape(frame, "path", { d: `M${left} ${bottom}H${right}`, fill: "none", ...stroke });
    for (const value of ticksOf(x)) {
      const u = scales.x.to(value);
      addShape(frame, "path", { d: `M${u} ${bottom}v5`, ...stroke });
      addText(frame, written(value, x), { x: u, y: bottom + 19, "text-anchor": "middle" });
    }
    addText(frame, x.label ?? "", { x: (left + right) / 2, y: bottom + 40, "text-anchor": "middle" });
  }
  if (y.label || y.ticks) {
    addShape(frame, "path", { d: `M${left} ${top}V${bottom}`, fill: "none", ...stroke });
    for (const value of ticksOf(y)) {
      const v = scales.y.to(value);
      addShape(frame, "path", { d: `M${left} ${v}h-5`, ...stroke });
      addText(frame, written(value, y), { x: left - 8, y: v + 5, "text-anchor": "end" });
    }
    addText(frame, y.label ?? "", { x: 4, y: 15 });
  }
  if (title) {
    addText(frame, title, { x: (left + right) / 2, y: 16, "text-anchor": "middle" });
  }
}
