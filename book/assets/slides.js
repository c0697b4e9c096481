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

// Interactive figures are frames: they say how high they are, and pass on the keys that turn pages.
const TURNS = { PageDown: () => Reveal.next(), PageUp: () => Reveal.prev(), Escape: () => window.focus() };
window.addEventListener("message", ({ source, data }) => {
  const frame = [...document.querySelectorAll("iframe.live")].find((one) => one.contentWindow === source);
  if (!frame) return;
  if (data.height && frame.height !== String(data.height)) {
    frame.height = data.height;
    fitShown();
  }
  TURNS[data.key]?.();
});
