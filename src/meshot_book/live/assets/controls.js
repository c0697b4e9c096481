// The controls of a live figure: each is bound to one entry of its state.

/**
 * @typedef {object} Control
 * @property {"range" | "choice" | "check" | "button"} kind
 * @property {string} label
 * @property {string} [key] the entry of the state
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [step]
 * @property {(value: number) => string} [say] the value of a range in words
 * @property {(string | [string | number, string])[]} [options] of a choice, or pairs of value and text
 * @property {() => void} [press] of a button
 * @property {(state: object) => boolean} [when] whether it can be used; always if left out
 */

/**
 * Adds a control.
 * @param {Element} holder
 * @param {string} id of the figure
 * @param {object} state
 * @param {Control} control
 * @param {(key: string) => void} changed
 * @returns {() => void} shows the state again
 */
export function addControl(holder, id, state, control, changed) {
  const nodes = { range: addRange, choice: addChoice, check: addCheck, button: addButton };
  const { inputs, show } = nodes[control.kind](holder, id, state, control, (value) => {
    if (control.key) {
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

function element(parent, kind, properties, ...children) {
  const node = Object.assign(document.createElement(kind), properties);
  node.append(...children);
  parent.append(node);
  return node;
}

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

function addChoice(holder, id, state, { key, label, options }, set) {
  const group = element(
    holder,
    "fieldset",
    {},
    Object.assign(document.createElement("legend"), { textContent: label }),
  );
  const inputs = options.map((option) => {
    const [value, text] = Array.isArray(option) ? option : [option, option];
    const box = element(
      group,
      "label",
      {},
      Object.assign(document.createElement("input"), { type: "radio" }),
      " " + text,
    );
    const input = Object.assign(box.firstChild, { name: `${id}-${key}`, value });
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

function addCheck(holder, id, state, { key, label }, set) {
  const box = element(
    holder,
    "label",
    {},
    Object.assign(document.createElement("input"), { type: "checkbox" }),
    " " + label,
  );
  const input = Object.assign(box.firstChild, { name: `${id}-${key}` });
  input.addEventListener("change", () => set(input.checked));
  const show = () => {
    input.checked = state[key];
  };
  return { inputs: [input], show };
}

function addButton(holder, id, state, { label, press }, set) {
  const button = element(holder, "button", { type: "button", textContent: label });
  button.addEventListener("click", () => {
    press();
    set();
  });
  return { inputs: [button], show: () => {} };
}
