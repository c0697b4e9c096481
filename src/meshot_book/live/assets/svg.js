const SVG = "http://www.w3.org/2000/svg";

export function addShape(parent, kind, attributes) {
  const node = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, value);
  }
  parent.append(node);
  return node;
}

export function addText(parent, text, attributes) {
  const node = addShape(parent, "text", attributes);
  node.textContent = text;
  return node;
}
