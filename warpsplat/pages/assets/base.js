"use strict";
// Helpers of all pages.
globalThis.warpsplat = {
  byId: (id) => document.getElementById(id),
  counted: (number, word) => `${number} ${word}${Number(number) === 1 ? "" : "s"}`,

  // The data that the template wrote for the script.
  data: () => JSON.parse(document.getElementById("data").textContent),

  // A new element with properties and children; texts are never parsed as markup.
  node(tag, properties, ...children) {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  },

  // Copy a text and show so on the button; `refused` is called, and may return a label, if the browser does not allow it.
  async copy(text, button, refused) {
    button.dataset.label ??= button.textContent;
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      button.textContent = refused() ?? button.dataset.label;
    }
    setTimeout(() => (button.textContent = button.dataset.label), 1500);
  },
};

// The button that copies a report's command.
document.getElementById("copy")?.addEventListener("click", ({ currentTarget }) => {
  const command = document.getElementById("command");
  warpsplat.copy(command.textContent, currentTarget, () => {
    getSelection().selectAllChildren(command);
    return "Selected";
  });
});
