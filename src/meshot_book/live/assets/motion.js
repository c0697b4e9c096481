// Motion at the reader's wish: play, pause, one step. It rests when it is not seen.

const JUMP = 0.5; // seconds between two pictures where reduced motion is asked for
const MOST = 20; // steps in a picture: a slow machine is slow rather than frozen

/** @typedef {{step: () => boolean, perSecond: number}} Play one step of what moves, false at the end */

/**
 * @param {HTMLElement} root
 * @param {{play: HTMLElement, once: HTMLElement}} buttons
 * @param {Play} what
 * @param {() => void} draw
 */
export function motion(root, { play, once }, { step, perSecond }, draw) {
  const reduced = window.matchMedia("(prefers-reduced-motion: reduce)");
  const status = root.querySelector(".status");
  let frame = 0;

  function rest() {
    cancelAnimationFrame(frame);
    frame = 0;
    play.textContent = "▶ play";
    status.setAttribute("aria-live", "polite");
  }
  function start() {
    let before = performance.now();
    let due = 1;
    const advance = (/** @type {number} */ now) => {
      if (!root.isConnected) {
        return;
      }
      const gone = Math.max(0, (now - before) / 1000);
      let goesOn = true;
      if (!reduced.matches || gone >= JUMP) {
        due = Math.min(due + gone * perSecond, MOST);
        before = now;
        for (; due >= 1 && goesOn; due -= 1) {
          goesOn = step();
        }
        draw();
      }
      if (goesOn) {
        frame = requestAnimationFrame(advance);
      } else {
        rest();
      }
    };
    play.textContent = "❚❚ pause";
    // A screen reader would be flooded: it hears where the motion ends.
    status.setAttribute("aria-live", "off");
    frame = requestAnimationFrame(advance);
  }
  play.addEventListener("click", () => (frame ? rest() : start()));
  once.addEventListener("click", () => {
    rest();
    step();
    draw();
  });
  new IntersectionObserver(([{ isIntersecting }]) => isIntersecting || rest()).observe(root);
  return { rest };
}
