// Slides of 1280 by 720; what does not fit is made smaller, once formulas are set.
const ROOM = 690;
const SMALLEST = 0.35;

function fit(section) {
  const content = section.querySelector(".content");
  content.style.zoom = 1;
  const head = section.querySelector(".section")?.offsetHeight ?? 0;
  const need = Math.max(content.scrollHeight / (ROOM - 1.5 * head), content.scrollWidth / (content.clientWidth + 1));
  if (need > 1) content.style.zoom = Math.max(SMALLEST, 1 / need);
}

Reveal.initialize({
  width: 1280,
  height: 720,
  margin: 0.04,
  center: false,
  hash: true,
  transition: "none",
  slideNumber: "h.v",
  plugins: [RevealNotes],
});
const fitShown = () => fit(Reveal.getCurrentSlide());
Reveal.on("slidechanged", fitShown);
window.addEventListener("load", () => (window.MathJax?.startup?.promise ?? Promise.resolve()).then(fitShown));
