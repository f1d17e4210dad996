"use strict";
// Several versions of one image: each file is held once, as text, and shown and downloaded as a blob.
(() => {
  const files = JSON.parse(document.getElementById("data").textContent);
  const viewer = document.getElementById("viewer").viewer;
  for (const [name, svg] of Object.entries(files)) {
    const url = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
    viewer.set(name, url);
    for (const image of document.querySelectorAll(".version img")) if (image.dataset.name === name) image.src = url;
    for (const link of document.querySelectorAll("a[download]")) if (link.dataset.name === name) link.href = url;
  }

  const buttons = [...document.querySelectorAll(".version button[data-side]")];
  const mark = () => {
    for (const button of buttons) {
      const key = button.closest(".version").dataset.key;
      button.setAttribute("aria-pressed", String(viewer.shown(button.dataset.side) === key));
    }
  };
  for (const button of buttons) {
    button.addEventListener("click", () => viewer.show(button.dataset.side, button.closest(".version").dataset.key));
  }
  viewer.addEventListener("show", mark);
  mark();
})();
