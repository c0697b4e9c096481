// Starts the script of a page once, also if the page is shown twice.
export function wake(id, main) {
  const root = document.getElementById(id);
  if (!root || root.dataset.ready) {
    return;
  }
  root.dataset.ready = "yes";
  main(root);
}
