// The still gives way to what is alive, once that has been drawn.
export function replaceStill(root) {
  // SVG elements have no property `hidden` of their own in every browser.
  root.querySelectorAll(":scope > [hidden]").forEach((node) => node.removeAttribute("hidden"));
  root.querySelector("img").hidden = true;
}
