// The controls of a live figure: each is bound to one entry of its state.

/**
 * @typedef {object} Control
 * @property {"range" | "choice" | "check" | "button"} kind
 * @property {string} label
 * @property {string} [key] the entry of the state; of a button, the entry that it changes itself
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [step]
 * @property {(value: number) => string} [say] the value of a range in words
 * @property {(string | [string | number, string])[]} [options] of a choice, or pairs of value and text
 * @property {() => void} [press] of a button
 * @property {(state: object) => boolean} [when] whether it can be used; always if left out
 */

/**
 * @typedef {object} Parts of a control on the page
 * @property {(HTMLInputElement | HTMLButtonElement)[]} inputs
 * @property {() => void} show shows the state again
 */
/** @typedef {Record<string, any>} State plain data */
/** @typedef {(holder: Element, id: string, state: State, control: Control, set: (value?: unknown) => void) => Parts} Add */

/**
 * Adds a control.
 * @param {Element} holder
 * @param {string} id of the figure
 * @param {State} state
 * @param {Control} control
 * @param {(key: string | undefined) => void} changed
 * @returns {() => void} shows the state again
 */
export function addControl(holder, id, state, control, changed) {
  const nodes = { range: addRange, choice: addChoice, check: addCheck, button: addButton };
  const { inputs, show } = nodes[control.kind](holder, id, state, control, (value) => {
    // A button has no value: it has changed the state itself.
    if (control.key && control.kind !== "button") {
      state[control.key] = value;
    }
    changed(control.key);
  });
  return () => {
    show();
    inputs.forEach((input) => {
      input.disabled = control.when ? !control.when(state) : false;
    });
  };
}

/**
 * @template {keyof HTMLElementTagNameMap} Kind
 * @param {Element | null} parent
 * @param {Kind} kind
 * @param {object} properties
 * @param {...(Node | string)} children
 */
function element(parent, kind, properties, ...children) {
  const node = Object.assign(document.createElement(kind), properties);
  node.append(...children);
  parent?.append(node);
  return node;
}

/** @type {Add} */
function addRange(holder, id, state, { key, label, min, max, step, say = String }, set) {
  const whole = element(holder, "label", { className: "range" }, element(holder, "span", { textContent: label }));
  const input = element(whole, "input", { type: "range", min, max, step, name: `${id}-${key}` });
  const output = element(whole, "output", {});
  input.addEventListener("input", () => set(Number(input.value)));
  const show = () => {
    input.value = state[key];
    output.textContent = say(state[key]);
    input.setAttribute("aria-valuetext", say(state[key]));
  };
  return { inputs: [input], show };
}

/** @type {Add} */
function addChoice(holder, id, state, { key, label, options }, set) {
  const group = element(holder, "fieldset", {}, element(null, "legend", { textContent: label }));
  const inputs = options.map((option) => {
    const [value, text] = Array.isArray(option) ? option : [option, option];
    const input = element(null, "input", { type: "radio", name: `${id}-${key}`, value });
    element(group, "label", {}, input, " " + text);
    input.addEventListener("change", () => set(value));
    return { input, value };
  });
  const show = () => {
    for (const { input, value } of inputs) {
      input.checked = state[key] === value;
    }
  };
  return { inputs: inputs.map(({ input }) => input), show };
}

/** @type {Add} */
function addCheck(holder, id, state, { key, label }, set) {
  const input = element(null, "input", { type: "checkbox", name: `${id}-${key}` });
  element(holder, "label", {}, input, " " + label);
  input.addEventListener("change", () => set(input.checked));
  const show = () => {
    input.checked = state[key];
  };
  return { inputs: [input], show };
}

/** @type {Add} */
function addButton(holder, id, state, { label, press }, set) {
  const button = element(holder, "button", { type: "button", textContent: label });
  button.addEventListener("click", () => {
    press();
    set();
  });
  return { inputs: [button], show: () => {} };
}
