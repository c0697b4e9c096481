// A page that is shown twice is brought to life once.
export function wake(id, main) {
  const root = document.getElementById(id);
  if (!root || root.dataset.ready) {
    return;
  }
  root.dataset.ready = "yes";
  main(root);
}
