import { offerChoices } from "../../../meshot/view/assets/choices.js";
import { player } from "./player.js";

// The controls under a surface that deforms: which deformation, when, and a button that plays it.
export function main(root, data) {
  const scene = root.querySelector(".surface-scene");
  const controls = root.querySelector(".controls");
  if (!scene.showItem) {
    return;
  }
  let items = data.choices[0].items;
  const rests = () => items.length === 1;
  const time = player(controls, {
    show: (moment) => scene.showItem(items[Math.min(moment, items.length - 1)]),
    say: (moment) => (rests() ? "it rests" : "t = " + data.times[moment].toFixed(2)),
    pace: { perSecond: 10, step: 1 },
    reducedPace: { perSecond: 2, step: 1 },
  });
  const names = data.choices.map((choice) => choice.name);
  offerChoices(root.querySelector(".choices"), root.id, names, (i) => {
    items = data.choices[i].items;
    if (rests()) {
      time.rest();
    }
    time.enable(!rests());
    time.again();
  });
  time.tell();
  controls.hidden = false;
}
