"use strict";
// Versions of one image: each file is contained once, as text, and shown and downloaded as a blob.
(() => {
  const { viewer } = warpsplat.byId("viewer");
  for (const [name, svg] of Object.entries(warpsplat.data())) {
    const url = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
    viewer.set(name, url);
    const card = document.querySelector(`.version[data-key="${name}"]`);
    card.querySelector("img").src = url;
    card.querySelector("a[download]").href = url;
  }

  const buttons = [...document.querySelectorAll(".version button[data-side]")];
  const keyOf = (button) => button.closest(".version").dataset.key;
  const mark = () => {
    for (const button of buttons) {
      button.setAttribute("aria-pressed", String(viewer.shown(button.dataset.side) === keyOf(button)));
    }
  };
  for (const button of buttons) {
    button.addEventListener("click", () => viewer.show(button.dataset.side, keyOf(button)));
  }
  viewer.addEventListener("show", mark);
  mark();
})();
