// One radio button for each name. The first is selected.
export function offerChoices(holder, group, names, choose) {
  names.forEach((name, i) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    Object.assign(box, { type: "radio", name: group, checked: i === 0 });
    box.addEventListener("change", () => choose(i));
    label.append(box, " " + name);
    holder.append(label);
  });
  holder.hidden = names.length < 2;
}
