// A slider and a button that moves it: at rest until the reader presses, in steps where reduced motion is asked for.
// show(moment) draws; say(moment) puts it in words; a pace is { perSecond, step }, and step 0 glides.
// What turns comes back to its start after the period; all else ends where the slider ends.
export function player(controls, { show, say, pace, reducedPace, period = 0 }) {
  const button = controls.querySelector("button[data-moving]");
  const slider = controls.querySelector("input[type=range]");
  const output = controls.querySelector("output");
  const restingWord = button.textContent;
  const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const { perSecond, step } = reduced ? reducedPace : pace;
  const last = Number(slider.max);
  let moment = Number(slider.value);
  let frame = 0;

  function tell() {
    const words = say(moment);
    slider.setAttribute("aria-valuetext", words);
    if (output) {
      output.textContent = words;
    }
  }
  function goTo(to) {
    moment = period ? ((to % period) + period) % period : to;
    slider.value = Math.floor(moment);
    show(moment);
    tell();
  }
  function rest() {
    cancelAnimationFrame(frame);
    frame = 0;
    button.textContent = restingWord;
  }
  function play() {
    let at = period || moment < last ? moment : 0;
    const end = period ? at + period : last;
    let before = performance.now();
    const advance = (now) => {
      if (!controls.isConnected) {
        return;
      }
      // A frame may be dated before the press. However slow the machine, no step is left out.
      const gone = Math.max(0, ((now - before) / 1000) * perSecond);
      if (gone >= step) {
        at = Math.min(at + (step || gone), end);
        before = now;
        goTo(at);
      }
      if (at < end) {
        frame = requestAnimationFrame(advance);
      } else {
        rest();
      }
    };
    button.textContent = button.dataset.moving;
    goTo(at);
    frame = requestAnimationFrame(advance);
  }
  button.addEventListener("click", () => (frame ? rest() : play()));
  slider.addEventListener("input", () => {
    rest();
    goTo(Number(slider.value));
  });
  const enable = (can) => {
    slider.disabled = button.disabled = !can;
  };
  return { goTo, rest, tell, enable, again: () => goTo(moment) };
}
