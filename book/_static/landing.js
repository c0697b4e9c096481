// What moves on the landing page starts by itself, a few times, unless reduced motion is asked for or the reader acts.

const ROUNDS = 3;
const PAUSE = 2500;

window.addEventListener("load", () => {
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  document.querySelectorAll(".shown.moving").forEach((box) => {
    const button = box.querySelector("button[data-moving]");
    if (!button) return;
    const resting = button.textContent;
    let rounds = 0;
    let mine = false;
    const start = () => {
      rounds += 1;
      mine = true;
      button.click();
      mine = false;
    };
    const stop = () => {
      if (!mine) rounds = ROUNDS;
    };
    box.addEventListener("click", stop);
    box.addEventListener("input", stop);
    new MutationObserver(() => {
      if (button.textContent === resting && rounds < ROUNDS) setTimeout(() => rounds < ROUNDS && start(), PAUSE);
    }).observe(button, { childList: true, characterData: true, subtree: true });
    start();
  });
});
