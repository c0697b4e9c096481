import { offerChoices } from "./choices.js";
import { unpack } from "./packing.js";
import { turnable } from "./turning.js";
import { renderer } from "./webgl.js";

// A static image that a click replaces by an interactive surface. Controls of an enclosing page call root.showItem(i).
export function main(root, data) {
  const find = (name) => root.querySelector(name);
  const [start, hint, help] = [".start", ".hint", ".help"].map(find);
  let shown = 0;
  let opened = null;
  let view = null;

  async function open() {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    try {
      if (!gl) {
        throw new Error("WebGL 2 is missing in this browser");
      }
      view = { canvas, gl, paint: renderer(canvas, gl, data, await unpack(data.packed, data.lengths)) };
    } catch (error) {
      hint.textContent = "Only the still can be shown: " + error.message + ".";
      return;
    }
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute(
      "aria-label",
      root.getAttribute("aria-label") + ". " + help.firstChild.textContent.replace(/\s+/g, " "),
    );
    find(".stage").append(canvas);
    start.hidden = true;
    help.hidden = false;
    view.redraw = letTurn(view, data.turn, () => shown, close);
  }
  function close() {
    view.canvas.remove();
    view.gl.getExtension("WEBGL_lose_context")?.loseContext();
    start.hidden = false;
    help.hidden = true;
    opened = view = null;
    start.focus();
  }
  function show(i) {
    shown = i;
    opened ??= open();
    view?.redraw();
    return opened;
  }
  hint.textContent = "click, or press Enter, to turn it";
  start.addEventListener("click", async () => {
    await show(shown);
    view?.canvas.focus({ preventScroll: true });
  });
  find(".back").addEventListener("click", () => view && close());
  root.showItem = show;
  const names = data.items.map((item) => item.name);
  offerChoices(find(".names"), root.id, names, show);
}

function letTurn({ canvas, paint }, first, shown, close) {
  let turn = first;
  let zoom = 1;
  let waiting = false;
  const draw = () => {
    waiting = false;
    if (canvas.isConnected) {
      paint(shown(), turn, zoom);
    }
  };
  const redraw = () => {
    waiting = waiting || requestAnimationFrame(draw);
  };
  const rotate = (x, y) => {
    turn = times(about(0, y), times(about(1, x), turn));
    redraw();
  };
  const enlarge = (factor) => {
    zoom = Math.min(20, Math.max(0.3, zoom * factor));
    redraw();
  };
  const asBefore = () => {
    [turn, zoom] = [first, 1];
    redraw();
  };
  const keys = {
    ArrowLeft: () => rotate(-0.1, 0),
    ArrowRight: () => rotate(0.1, 0),
    ArrowUp: () => rotate(0, -0.1),
    ArrowDown: () => rotate(0, 0.1),
    "+": () => enlarge(1.15),
    "=": () => enlarge(1.15),
    "-": () => enlarge(1 / 1.15),
    0: asBefore,
    Escape: close,
  };
  turnable(canvas, { drag: (_, dx, dy) => rotate(dx / 150, dy / 150), zoom: enlarge, keys });
  new ResizeObserver(redraw).observe(canvas);
  draw();
  return redraw;
}

function times(a, b) {
  return a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
}

function about(axis, angle) {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  return axis
    ? [
        [c, 0, s],
        [0, 1, 0],
        [-s, 0, c],
      ]
    : [
        [1, 0, 0],
        [0, c, -s],
        [0, s, c],
      ];
}
