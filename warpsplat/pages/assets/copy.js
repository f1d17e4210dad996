"use strict";
// The button that copies a page's command; where the clipboard is closed, the command is selected.
(() => {
  const command = document.getElementById("command");
  document.getElementById("copy")?.addEventListener("click", async ({ currentTarget: button }) => {
    try {
      await navigator.clipboard.writeText(command.textContent);
      button.textContent = "Copied";
    } catch {
      getSelection().selectAllChildren(command);
      button.textContent = "Selected";
    }
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
})();
