/**
 * Makes a node rotatable by dragging (mouse or finger), zoomable by wheel or two fingers, and usable by keys.
 * @param {any} node of HTML or SVG
 * @param {object} acts
 * @param {(event: PointerEvent) => void} [acts.press]
 * @param {(event: PointerEvent, dx: number, dy: number) => void} acts.drag
 * @param {(factor: number) => void} [acts.zoom]
 * @param {Record<string, (event: KeyboardEvent) => void>} [acts.keys]
 */
export function turnable(node, { press, drag, zoom, keys }) {
  const fingers = new Map();
  node.addEventListener("pointerdown", (event) => {
    node.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    press?.(event);
  });
  node.addEventListener("pointermove", (event) => {
    const finger = fingers.get(event.pointerId);
    if (!finger) {
      return;
    }
    const before = spread(fingers);
    const dx = event.clientX - finger.x;
    const dy = event.clientY - finger.y;
    Object.assign(finger, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) {
      drag(event, dx, dy);
    } else if (before) {
      zoom?.(spread(fingers) / before);
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    node.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  if (node instanceof SVGElement) {
    // The style touch-action does not apply to SVG groups. Without this, browsers would scroll.
    node.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
  }
  if (zoom) {
    listenToWheel(node, zoom);
  }
  if (keys) {
    listenToKeys(node, keys);
  }
}

// The distance between two fingers; 0 for any other number of fingers.
function spread(fingers) {
  const [a, b] = fingers.values();
  return fingers.size === 2 ? Math.hypot(a.x - b.x, a.y - b.y) : 0;
}

function listenToWheel(node, zoom) {
  const turnWheel = (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
  };
  node.addEventListener("wheel", turnWheel, { passive: false });
}

function listenToKeys(node, keys) {
  node.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    keys[event.key](event);
  });
}
