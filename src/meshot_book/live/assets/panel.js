// The machine of one live figure: state, plots, controls, motion, the question above and the status below.
import { replaceStill } from "../../figures/assets/figure.js";
import { addControl } from "./controls.js";
import { motion } from "./motion.js";
import { addMovable, addPlot } from "./plot.js";

/**
 * @typedef {object} Acts what a figure does
 * @property {() => {status: string, values?: object}} draw all marks, and what they show in words
 * @property {(key: string | null | undefined) => void} [changed] before drawing, when an entry has changed; null: all may
 */

/**
 * A panel: `state` is plain data, starts as given or as the address of the page says, and `run` brings it to life.
 * @template State
 * @param {HTMLElement} root
 * @param {State} start plain data
 */
export function panel(root, start) {
  const find = (/** @type {string} */ name) => /** @type {HTMLElement} */ (root.querySelector(name));
  const name = root.dataset.figure;
  const state = { ...structuredClone(start), ...stored(name, start) };
  /** @type {ReturnType<typeof addPlot>[]} */
  const plots = [];
  /** @type {ReturnType<typeof addMovable>[]} */
  const movables = [];
  /** @type {(() => void)[]} */
  let shows = [];
  /** @type {Acts} */
  let act;
  /** @type {ReturnType<typeof motion> | null} */
  let mover = null;

  Object.assign(root, { state }); // for the console, and for tests

  function draw() {
    plots.forEach((plot) => plot.clear());
    const { status, values } = act.draw();
    movables.forEach(({ update }) => update());
    shows.forEach((show) => show());
    find(".status").textContent = status;
    // Numbers for those who check them.
    Object.assign(root.dataset, values);
  }
  /** @param {string | null | undefined} key */
  function changed(key) {
    act.changed?.(key);
    draw();
  }
  function reset() {
    mover?.rest();
    Object.assign(state, structuredClone(start));
    changed(null);
  }
  function link() {
    const different = Object.keys(start).filter((key) => JSON.stringify(start[key]) !== JSON.stringify(state[key]));
    const kept = JSON.stringify(Object.fromEntries(different.map((key) => [key, state[key]])), rounded);
    history.replaceState(null, "", `#${name}=${encodeURIComponent(kept)}`);
    find(".status").textContent = "The address of this page now leads to what you see.";
  }

  return {
    state,
    changed,
    /**
     * A plot, drawn anew with the figure. Its options are those of addPlot.
     * @param {Parameters<typeof addPlot>[1]} options
     */
    plot(options) {
      const plot = addPlot(find(".plots"), options);
      plots.push(plot);
      return plot;
    },
    /**
     * Points of the state to be moved.
     * @param {ReturnType<typeof addPlot>} plot
     * @param {import("./plot.js").Movable & {key: string}} options key names the entry that changes
     */
    movable(plot, { key, move, ...options }) {
      const by = (/** @type {number} */ i, /** @type {number[]} */ to) => {
        move(i, to);
        changed(key);
      };
      movables.push(addMovable(plot, { ...options, move: by }));
    },
    /**
     * Draws and listens.
     * @param {Acts & {controls: import("./controls.js").Control[], play?: import("./motion.js").Play}} given
     */
    run({ controls, play, ...given }) {
      act = given;
      if (play) {
        const buttons = { play: find(".play"), once: find(".once") };
        mover = motion(root, buttons, play, draw);
        Object.values(buttons).forEach((button) => (button.hidden = false));
      }
      shows = controls.map((control) => addControl(find(".own"), root.id, state, control, changed));
      find(".reset").addEventListener("click", reset);
      find(".link").addEventListener("click", link);
      find(".wide").hidden = !document.fullscreenEnabled;
      find(".wide").addEventListener("click", () =>
        document.fullscreenElement === root ? document.exitFullscreen() : root.requestFullscreen(),
      );
      // The still stays, and nothing is computed, until the reader has chosen an answer or wants none.
      const begin = () => {
        if (root.dataset.begun) {
          return;
        }
        root.dataset.begun = "yes";
        act.changed?.(null);
        draw();
        replaceStill(root);
        find(".show").hidden = true;
        find(".keys").hidden = movables.length === 0;
      };
      ask(root, begin);
      // An address with a state leads to it at once.
      if (location.hash.startsWith(`#${name}=`)) {
        begin();
        root.scrollIntoView();
      }
    },
  };
}

/**
 * What the address of the page says of a figure: entries that it has, of the kind that it has them.
 * @template State
 * @param {string} name
 * @param {State} start
 * @returns {Partial<State>}
 */
function stored(name, start) {
  if (!location.hash.startsWith(`#${name}=`)) {
    return {};
  }
  try {
    const found = JSON.parse(decodeURIComponent(location.hash.slice(name.length + 2)));
    const alike = Object.keys(start).filter((key) => key in found && typeof found[key] === typeof start[key]);
    return /** @type {any} */ (Object.fromEntries(alike.map((key) => [key, found[key]])));
  } catch {
    return {};
  }
}

function rounded(_, value) {
  return typeof value === "number" ? Number(value.toFixed(4)) : value;
}

/**
 * The reader chooses an answer, tries, and only then asks whether it was right.
 * @param {HTMLElement} root
 * @param {() => void} begin
 */
function ask(root, begin) {
  /** @type {HTMLFieldSetElement} */
  const question = root.querySelector(".question");
  /** @type {HTMLButtonElement} */
  const judge = question.querySelector(".judge");
  const verdict = question.querySelector(".verdict");
  const answers = [...question.querySelectorAll("input")];
  for (const answer of answers) {
    answer.addEventListener("change", () => {
      begin();
      judge.disabled = false;
      verdict.textContent = "Now try it below. Then ask whether you were right.";
    });
  }
  question.querySelector(".show").addEventListener("click", begin);
  question.hidden = false;
  judge.addEventListener("click", () => {
    const { right, because } = answers.find((answer) => answer.checked).dataset;
    verdict.textContent = `${right === "yes" ? "Right." : "Not so."} ${because}`;
  });
}
