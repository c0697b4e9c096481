const SVG = "http://www.w3.org/2000/svg";

/** @typedef {Record<string, string | number>} Attributes */

/**
 * @param {Element} node
 * @param {Attributes} attributes
 */
export function mark(node, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, String(value));
  }
}

/**
 * @param {Element} parent
 * @param {string} kind
 * @param {Attributes} attributes
 */
export function addShape(parent, kind, attributes) {
  const node = document.createElementNS(SVG, kind);
  mark(node, attributes);
  parent.append(node);
  return node;
}

/**
 * @param {Element} parent
 * @param {string} text
 * @param {Attributes} attributes
 */
export function addText(parent, text, attributes) {
  const node = addShape(parent, "text", attributes);
  node.textContent = text;
  return node;
}
